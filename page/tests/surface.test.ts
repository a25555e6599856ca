import { describe, expect, it } from "vitest";
import { backFirst, byCell, cellOf, draw, seen, TALL, type Scene } from "../src/space";
import { logTicks, sceneOf, type Surfaces } from "../src/surface";

/** A canvas that keeps the colours in which areas were filled, in their order. */
function paper() {
  const filled: string[] = [];
  const ink = { fillStyle: "", fill: () => filled.push(ink.fillStyle), measureText: (text: string) => ({ width: 7 * text.length }) } as Record<string, unknown> & { fillStyle: string };
  for (const name of ["clearRect", "beginPath", "moveTo", "lineTo", "closePath", "rect", "stroke", "save", "restore", "translate", "rotate", "fillText"]) ink[name] = () => undefined;
  return { ink: ink as unknown as CanvasRenderingContext2D, filled };
}

const every = (of: boolean) => [[of, of, of], [of, of, of]];
const surfaces: Surfaces = {
  chamber: "b",
  fit: "",
  speeds: [0.01, 0.1, 1],
  gauges: [0, 2e5],
  levels: [{ label: "chamber a at 0 bar gauge", groups: [0, 1], at: [0, 2e5], friction: [[10, 6, 8], [20, 16, 18]], inside: every(true), expected: [[10, 8], [16]] }],
};
const groups = [
  { points: [{ recording: "monday", speed: 0.01, friction: 11 }, { recording: "monday", speed: 1, friction: 7 }] },
  { points: [{ recording: "tuesday", speed: 0.1, friction: 12 }] },
];
const { scene, words, share } = sceneOf(surfaces, surfaces.levels[0]!, groups);

function drawn(turn: number, tilt: number, of: Scene = scene) {
  const { ink, filled } = paper();
  const spots = draw(ink, of, byCell(of), { turn, tilt, width: 800, height: 500 }, { text: "text", grid: "grid", paper: "paper", of: (z) => share(z).toFixed(2) });
  return { filled: filled.filter((one) => one.includes(".")), at: [0, 1, 2].map((k) => [spots[2 * k]!, spots[2 * k + 1]!] as const) };
}

describe("a place in space", () => {
  it("is seen from the front, from the side and from above", () => {
    const close = (found: number[], expected: number[]) => expected.forEach((one, k) => expect(found[k]).toBeCloseTo(one, 12));
    close(seen(0, 0)(0.2, 0.3, 0.4), [0.2, 0.4, 0.3]); // y leads away
    close(seen(-90, 0)(0.2, 0.3, 0.4), [0.3, 0.4, -0.2]); // y to the right, x towards who looks
    close(seen(0, 90)(0.2, 0.3, 0.4), [0.2, 0.3, -0.4]); // what is high is near
  });
  it("lies in the cell whose nodes are around it", () => {
    expect([-1, 0, 0.4, 1, 1.5, 2, 9].map((one) => cellOf([0, 1, 2], one))).toEqual([0, 0, 0, 1, 1, 1, 1]);
    expect(backFirst(3, 1)).toEqual([2, 1, 0]);
    expect(backFirst(3, -1)).toEqual([0, 1, 2]);
  });
});

describe("a surface", () => {
  it("has its points where speed, friction and pressure are", () => {
    const [slow, fast, between] = drawn(0, 0).at as [readonly [number, number], readonly [number, number], readonly [number, number]];
    expect(slow[0]).toBeLessThan(between[0]);
    expect(fast[0] - between[0]).toBeCloseTo(between[0] - slow[0], 6); // decades
    expect(fast[1]).toBeGreaterThan(slow[1]); // 7 N lie below 11 N
    expect((fast[1] - slow[1]) / (slow[1] - between[1])).toBeCloseTo(4, 6);
    const above = drawn(0, 90).at;
    expect(above[2]![1]).toBeLessThan(above[0]![1]); // 2 bar lie beyond 0 bar
    expect(above[0]![1]).toBeCloseTo(above[1]![1], 6);
  });
  it("is drawn from what is behind to what is in front", () => {
    const [slow, fast] = [share(TALL * (13 / 21)), share(TALL * (12 / 21))].map((one) => one.toFixed(2));
    expect(drawn(-35, 25).filled).toEqual([slow, fast]); // the fast end is turned to who looks
    expect(drawn(35, 25).filled).toEqual([fast, slow]);
  });
  it("is told in words, with the point farthest from the fit and what is extrapolated", () => {
    expect(words).toContain("friction from 6 to 20 N over speed, 10 to 1000 mm/s, and chamber b, 0 to 2 bar gauge");
    expect(words).toContain("3 points, the one farthest from the fit by 4 N at 100 mm/s and 2 bar; 0 % of the surface");
    const half = { ...surfaces.levels[0]!, inside: [[true, true, true], [false, false, false]] };
    expect(sceneOf(surfaces, half, groups).words).toContain("50 % of the surface");
  });
  it("is points above the floor without a fit", () => {
    const bare = sceneOf(surfaces, { ...surfaces.levels[0]!, friction: null, inside: null, expected: null }, groups);
    expect(bare.scene.points.map((one) => one.foot)).toEqual([0, 0, 0]);
    expect(drawn(-35, 25, bare.scene).filled).toEqual([]);
    expect(bare.words).toMatch(/3 points$/);
  });
});

describe("the numbers of an axis of decades", () => {
  it("are few", () => {
    expect(logTicks(2, 250)).toEqual([2, 5, 10, 20, 50, 100, 200]);
    expect(logTicks(0.1, 1000)).toEqual([0.1, 1, 10, 100, 1000]);
  });
});
