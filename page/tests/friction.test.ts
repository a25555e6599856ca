import { describe, expect, it } from "vitest";
import { levels } from "../src/friction";
import { reached } from "../src/plots/scatter";

describe("speeds of a map", () => {
  it("are one level where they hardly differ", () => {
    expect(levels([0.1, 0.0301, 0.03, 0.0302, 0.101])).toEqual([0.03, 0.1]);
  });
});

describe("the axis of points with bars", () => {
  const group = (y: number, spread: number) => ({ label: "x", points: [{ x: 1, y, spread }] });
  it("begins at zero for friction and holds every bar of a difference", () => {
    expect(reached([group(10, 2)], 10, 10)[0]).toBe(0);
    expect(reached([group(10, 2)], 10, 10)[1]).toBeGreaterThan(12);
    const [low, high] = reached([group(-3, 2)], -3, -3);
    expect(low).toBeLessThan(-5);
    expect(high).toBe(0);
  });
});
