import { describe, expect, it } from "vitest";
import { digits } from "../src/plots/looks";
import { unpack } from "../src/server/frame";

/** A frame as `pneudrive.web.messages.pack` makes it. */
function frame(): ArrayBuffer {
  const head = JSON.stringify({
    number: 3,
    arrays: [
      ["x", "f8", 0, 2],
      ["y", "f4", 16, 3],
    ],
  });
  const start = Math.ceil((4 + head.length) / 8) * 8;
  const bytes = new ArrayBuffer(start + 32);
  new DataView(bytes).setUint32(0, start - 4, true);
  new Uint8Array(bytes).set(new TextEncoder().encode(head.padEnd(start - 4)), 4);
  new Float64Array(bytes, start, 2).set([1.5, -2]);
  new Float32Array(bytes, start + 16, 3).set([1, NaN, 3]);
  return bytes;
}

describe("frames", () => {
  it("give their arrays without copying", () => {
    const bytes = frame();
    const { head, arrays } = unpack<{ number: number }>(bytes);
    expect(head).toEqual({ number: 3 });
    expect([...arrays.get("x")!]).toEqual([1.5, -2]);
    expect([...arrays.get("y")!]).toEqual([1, NaN, 3]);
    expect(arrays.get("y")!.buffer).toBe(bytes);
  });
  it("give numbers that lie about another in full", () => {
    const head = JSON.stringify({ arrays: [["x", "f4", 0, 2, 100000]] });
    const start = Math.ceil((4 + head.length) / 8) * 8;
    const bytes = new ArrayBuffer(start + 8);
    new DataView(bytes).setUint32(0, start - 4, true);
    new Uint8Array(bytes).set(new TextEncoder().encode(head.padEnd(start - 4)), 4);
    new Float32Array(bytes, start, 2).set([2 ** -20, -0.5]);
    expect([...unpack(bytes).arrays.get("x")!]).toEqual([100000 + 2 ** -20, 99999.5]);
  });
  it("that are cut off are refused", () => {
    expect(() => unpack(frame().slice(0, 20))).toThrow();
    expect(() => unpack(frame().slice(0, -8))).toThrow();
  });
});

describe("numbers", () => {
  it("are short and never wrong by more than their last digit", () => {
    expect(digits(0.123456)).toBe("0.123");
    expect(digits(-1234567)).toBe("-1230000");
    expect(digits(30)).toBe("30");
    expect(digits(-9.21e-6)).toBe("-9.21e-6");
    expect(digits(null)).toBe("–");
  });
});
