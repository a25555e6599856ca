import { describe, expect, it } from "vitest";
import { isInDash } from "../src/plot";

describe("a dense curve", () => {
  it("is pale in the gaps of its dash", () => {
    expect(Array.from({ length: 8 }, (_, k) => isInDash(k, [2, 1]))).toEqual([true, true, false, true, true, false, true, true]);
    expect(isInDash(7, [4, 1, 2, 1])).toBe(false);
    expect(isInDash(6, [4, 1, 2, 1])).toBe(true);
    expect(isInDash(5, [])).toBe(true);
  });
});
