import { describe, expect, it } from "vitest";
import { movedShape, type PistonShapes, pistonAt, type Shape } from "../src/drive/circuit";

const at: PistonShapes = { barrel: [2, 18, 14, 22], piston: [5, 5.8], moves: { 1: [true, false] } };
const rod: Shape = {
  word: "line",
  points: [
    [5.8, 20],
    [17, 20],
  ],
  component: "cylinder",
  size: 0,
  text: "",
  align: "",
  angles: [0, 360],
  net: -1,
};

describe("a piston", () => {
  it("goes from cover to cover, chamber a growing on the left", () => {
    expect(pistonAt(at, 0)).toBe(2);
    expect(pistonAt(at, 1)).toBeCloseTo(13.2);
    expect(pistonAt(at, 1.02)).toBeCloseTo(13.2); // into a soft stop
    expect(pistonAt(at, 0.5)).toBeCloseTo(7.6);
  });
  it("takes the near end of its rod along", () => {
    const points = movedShape(rod, 1, at, 0.5).points;
    expect(points[0]![0]).toBeCloseTo(5.8 + 2.6);
    expect(points[1]).toEqual([17, 20]);
    expect(movedShape(rod, 2, at, 0.5)).toBe(rod);
  });
});
