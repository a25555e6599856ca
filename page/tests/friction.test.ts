import { describe, expect, it } from "vitest";
import { levels } from "../src/measured/friction";
import { pointsFigure } from "../src/plots/points";

describe("speeds of a map", () => {
  it("are one level where they hardly differ", () => {
    expect(levels([0.1, 0.0301, 0.03, 0.0302, 0.101])).toEqual([0.03, 0.1]);
  });
});

describe("a figure of points", () => {
  const group = (label: string) => ({ label, points: [{ x: 1, y: 30, spread: 2 }] });
  const marks = (count: number) =>
    pointsFigure({
      ...{ name: "f", x: "speed, mm/s", y: "friction, N" },
      panels: [{ title: "", groups: Array.from({ length: count }, (_, k) => group(`p${k}`)) }],
    }).figure.panels[0]!.marks;
  it("names at most four series, the first and the last among them, and draws all others grey", () => {
    const named = marks(7).flatMap((mark) => ("label" in mark && mark.label ? [mark.label] : []));
    expect(named).toEqual(["p0", "p2", "p4", "p6"]);
    expect(marks(7).length).toBe(7);
  });
  it("holds the bars of its points", () => expect(marks(1)[0]).toMatchObject({ low: [28], high: [32] }));
});
