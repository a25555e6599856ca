import { describe, expect, it } from "vitest";
import { levels } from "../src/measured/friction";
import { reached } from "../src/plots/scatter";

describe("speeds of a map", () => {
  it("are one level where they hardly differ", () => {
    expect(levels([0.1, 0.0301, 0.03, 0.0302, 0.101])).toEqual([0.03, 0.1]);
  });
});

describe("the axis of points with bars", () => {
  const group = (y: number, spread: number) => ({ label: "x", points: [{ x: 1, y, spread }] });
  it("fits the data, holds every bar, and wastes no room", () => {
    const [low, high] = reached([group(30, 2)], 28, 34);
    expect(low).toBeGreaterThan(26);
    expect(low).toBeLessThan(28);
    expect(high).toBeGreaterThan(34);
    expect(high).toBeLessThan(36);
  });
});
