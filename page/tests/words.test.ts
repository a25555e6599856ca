import { expect, test } from "vitest";
import { count, pretty, sentence } from "../src/plots/looks";
import { pads } from "../src/workspace/tables";

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
  expect(["19.7 um", "3 us", "dm3/(s bar)", "m^3/(s Pa)", "number", "drum3"].map(pretty)).toEqual(["19.7 µm", "3 µs", "dm³/(s bar)", "m³/(s Pa)", "number", "drum3"]);
});
