import { describe, expect, it } from "vitest";
import { alike, marksOf, nextPlace, shiftOf, told } from "../src/measured/measure";
import type { Stroke } from "../src/server/generated";
import { newest } from "../src/server/server";

const stroke = (from: number, direction: number): Stroke => ({ from, to: from + 1, direction, speed: 0.1 * direction });

describe("two recordings", () => {
  const [own, other] = [
    [stroke(2, -1), stroke(4, 1)],
    [stroke(10, 1), stroke(13, -1)],
  ];
  it("begin with the first strokes that go the same way", () => {
    expect(alike(own, other)).toEqual([1, 2]);
    expect(alike(own, [stroke(10, 1)])).toEqual([1, 1]); // none goes that way
  });
  it("are moved so that a time of the other one becomes one of this", () => {
    expect(13 + shiftOf(own, other, [1, 2])!).toBe(2);
    expect(shiftOf(own, other, [3, 1])).toBeUndefined(); // it has no such stroke
  });
});

describe("the time of a cursor", () => {
  it("is told to the sample, on the clock of a computer too", () => {
    expect(told(1772000001.234, [1772000000, 1772000060])).toBe("1772000001.234");
    expect(told(12.3456, [0, 60])).toBe("12.3456");
    expect([told(1772000001, [1772000000, 1772000001]), told(3, [3, 3])]).toEqual(["1772000001", "3"]);
  });
});

describe("faults", () => {
  const faults = {
    spike: {
      count: 2,
      places: [
        [1, 1],
        [5, 5],
      ] as [number, number][],
    },
    rows: { count: 3, places: [] },
  };
  it("are marked where they are", () =>
    expect(marksOf(faults)).toEqual([
      { from: 1, to: 1 },
      { from: 5, to: 5 },
    ]));
  it("are gone through in turn", () => {
    expect(nextPlace(faults.spike.places, 0)).toEqual([1, 1]);
    expect(nextPlace(faults.spike.places, 1)).toEqual([5, 5]);
    expect(nextPlace(faults.spike.places, 5)).toEqual([1, 1]);
  });
});

describe("what asks once at a time", () => {
  it("asks again for the newest alone", async () => {
    let [count, most, now] = [0, 0, 0];
    const ask = newest(async () => {
      count += 1;
      most = Math.max(most, ++now);
      await new Promise((resolve) => setTimeout(resolve, 5));
      now -= 1;
    });
    await Promise.all([ask(), ask(), ask(), ask()]);
    expect([count, most]).toEqual([2, 1]);
  });
});
