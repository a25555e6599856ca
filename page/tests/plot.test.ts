import type uPlot from "uplot";
import { describe, expect, it, vi } from "vitest";
import { instant } from "../src/plots/looks";
import { isInDash, lines } from "../src/plots/paint";
import { curveOf, valueAt } from "../src/plots/plot";

describe("a dense curve", () => {
  it("is pale in the gaps of its dash", () => {
    expect(Array.from({ length: 8 }, (_, k) => isInDash(k, [2, 1]))).toEqual([
      true,
      true,
      false,
      true,
      true,
      false,
      true,
      true,
    ]);
    expect(isInDash(7, [4, 1, 2, 1])).toBe(false);
    expect(isInDash(6, [4, 1, 2, 1])).toBe(true);
    expect(isInDash(5, [])).toBe(true);
  });
});

/** Corners of the lines that are drawn in 10 x 10 pixels from (0, 0), of values between 0 and 10 over times between 0 and 10. */
function drawn(x: number[], y: (number | null | undefined)[], idxs: [number, number]): string[] {
  const out: string[] = [];
  const put =
    (word: string) =>
    (...at: number[]) =>
      out.push(`${word} ${at.join(" ")}`);
  const ctx = Object.fromEntries(
    ["save", "restore", "beginPath", "rect", "clip", "stroke", "setLineDash"].map((name) => [name, () => undefined]),
  );
  const scale = { min: 0, max: 10 };
  const series = [{ idxs }, { stroke: () => "#111111", width: 1 }];
  const bbox = { left: 0, top: 0, width: 10, height: 10 };
  lines(
    {
      data: [x, y],
      bbox,
      scales: { x: scale, y: scale },
      series,
      ctx: { ...ctx, moveTo: put("to"), lineTo: put("line"), arc: (x: number, y: number) => put("dot")(x, y) },
    } as unknown as uPlot,
    1,
  );
  return out;
}

describe("the lines of a curve", () => {
  vi.stubGlobal("devicePixelRatio", 1);
  it("come in from the value before the view and leave it to the one behind", () => {
    expect(drawn([-2, 1, 5, 14], [0, 4, 10, 1], [1, 2])).toEqual(["to -2 10", "line 1 6", "line 5 0", "line 14 9"]);
  });
  it("stop at a gap, and pass over times of other curves", () => {
    const [x, y] = [
      [1, 2, 3, 4, 5],
      [1, undefined, 2, null, 3],
    ];
    expect(drawn(x, y, [0, 4])).toEqual(["to 1 9", "line 3 8", "to 5 7", "dot 5 7"]);
  });
});

describe("a value between two gaps", () => {
  it("is a dot, as one of a channel of a slower clock", () => {
    expect(drawn([1, 2, 3, 4, 5], [null, 5, null, 7, null], [0, 4])).toEqual([
      "to 2 5",
      "dot 2 5",
      "to 4 3",
      "dot 4 3",
    ]);
  });
  it("is a dot also as the lowest and the highest of a pixel", () => {
    expect(drawn([1, 2, 2.4, 3], [null, 5, 5, null], [0, 3])).toEqual(["to 2 5", "line 2.4 5", "dot 2.4 5"]);
  });
});

describe("a value that is read at a time", () => {
  const of = (...values: number[]) => new Float64Array(values);
  const x = of(0, 1, 3);
  it("is the run's, not the lowest or the highest of a pixel", () => {
    const one = curveOf(
      new Map([
        ["x", of(-9, 9, -9)],
        ["x/at", of(0, 2, 4)],
      ]),
      x,
      "x",
      "x",
    );
    expect([0, 1, 2, 3].map((time) => valueAt(one, time))).toEqual([0, 2, 3, 4]);
  });
  it("is of that time also for a curve with other times, and none beyond its ends", () => {
    expect([-1, 0, 0.5, 3, 4].map((time) => valueAt({ label: "", x, y: of(0, 2, 4) }, time))).toEqual([
      Number.NaN,
      0,
      1,
      4,
      Number.NaN,
    ]);
  });
});

describe("a time", () => {
  it("differs from its neighbours", () => {
    for (const [begin, step] of [
      [0, 0.03],
      [1772000000, 1e-3],
      [8.5, 1e-5],
    ] as const) {
      const times = Array.from({ length: 50 }, (_, k) => begin + k * step);
      const told = times.map((time) => instant(time, step));
      expect(new Set(told).size).toBe(50);
      told.forEach((one, k) => void expect(Math.abs(Number(one) - times[k]!)).toBeLessThan(0.01 * step));
    }
    expect(instant(0.09, 0.03)).toBe("0.09");
    expect(instant(1772000000.123, 0.001)).toBe("1772000000.123");
  });
});
