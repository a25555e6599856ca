import { describe, expect, it } from "vitest";
import { braked, stepsOf, written } from "../src/simulate/steps";

describe("the steps of a command", () => {
  it("are read and written, in the order of time", () => {
    const steps = stepsOf("1 s: -1, 0 s: 1")!;
    expect(steps).toEqual([
      [0, 1],
      [1, -1],
    ]);
    expect(written(steps)).toBe("0 s: 1, 1 s: -1");
    for (const other of ["run.csv", "0.5", "0 s: fast", ""]) expect(stepsOf(other)).toBeNull();
  });

  it("get a brake before each impact, and the same brake acts earlier the second time", () => {
    const once = braked(stepsOf("0 s: 1, 1 s: -1")!, [0.1, 1.2]);
    expect(written(once)).toBe("0 s: 1, 0.04 s: 0.05, 1 s: -1, 1.08 s: -0.05");
    const twice = braked(once, [0.12, 1.4]);
    expect(written(twice)).toBe("0 s: 1, 0.032 s: 0.05, 1 s: -1, 1.064 s: -0.05");
    expect(braked(stepsOf("0 s: 1")!, [])).toEqual([[0, 1]]);
  });
});
