import { expect, test, vi } from "vitest";
import { count, isSevere, pretty, sentence } from "../src/plots/looks";
import { pads } from "../src/workspace/fields";
import { reached } from "../src/workspace/jobs";

test("decimal points of a column are below each other, whatever follows the number", () => {
  const texts = ["9.98", "12.1 mm", "-3 ± 1", "not determined", ""];
  const points = texts.map((one, k) => (pads(texts)[k]! + one).search(/\.|(?<=\d)(?= )/));
  expect(points.slice(0, 3)).toEqual([2, 2, 2]);
  expect(pads(texts).slice(3)).toEqual(["", ""]);
  expect(pads(["a 1", "22"])).toEqual(["", ""]); // one number alone has nothing to be aligned with
});

test("messages and units as people write them", () => {
  expect(sentence("the gas cools")).toBe("The gas cools.");
  expect(sentence("leg_1: this set is not passive")).toBe("leg_1: this set is not passive.");
  expect([count(1, "impact"), count(3, "impact")]).toEqual(["1 impact", "3 impacts"]);
  expect(["19.7 um", "3 us", "dm3/(s bar)", "m^3/(s Pa)", "number", "drum3"].map(pretty)).toEqual([
    "19.7 µm",
    "3 µs",
    "dm³/(s bar)",
    "m³/(s Pa)",
    "number",
    "drum3",
  ]);
});

test("findings that endanger people, machine or order are told from notes", () => {
  expect(
    ["Hazard: cylinder: 3 of 3 impacts", "Open check: side load", "Not ready to order: one check"].every(isSevere),
  ).toBe(true);
  expect(["the gas cools", "no Hazard: here"].some(isSevere)).toBe(false);
});

test("the time left of a job follows from the part that is done", () => {
  vi.useFakeTimers({ now: 0 });
  const at = (ms: number, done: number) => (
    vi.setSystemTime(ms), reached({ number: 1, progress: { task: "drives simulated", done, total: 40 } })
  );
  expect(at(0, 10)).toBe("drives simulated: 10 of 40");
  expect(at(1000, 11)).toBe("drives simulated: 11 of 40"); // too early to tell
  expect(at(60_000, 20)).toBe("drives simulated: 20 of 40, about 2 min left in this step");
  vi.useRealTimers();
});
