import { describe, expect, it } from "vitest";
import { outline } from "../src/measured/fit";

describe("the outline of a profile", () => {
  it("runs down the lower ends and up the upper ends, without open ones", () => {
    const found = outline({ value: 4.5, low: [4, 3, null], high: [5, 7, 9], probability: [0.5, 0.9, 0.95] });
    expect(found.x).toEqual([3, 4, 4.5, 5, 7, 9]);
    expect(found.y).toEqual([90, 50, 0, 50, 90, 95]);
  });
});
