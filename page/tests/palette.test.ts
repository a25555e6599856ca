import { expect, test } from "vitest";
import { matching } from "../src/workspace/palette";

test("all words count, and names that begin with the first one come first", () => {
  const entries = ["results/axis/fit.toml", "fast/axis.toml", "axis.toml", "Overview"].map((title) => ({ title }));
  expect(matching(entries, "axis").map(({ title }) => title)).toEqual([
    "fast/axis.toml",
    "axis.toml",
    "results/axis/fit.toml",
  ]);
  expect(matching(entries, "TOML fit").map(({ title }) => title)).toEqual(["results/axis/fit.toml"]);
  expect(matching(entries, "")).toHaveLength(4);
  expect(matching([{ title: "a", note: "recording" }], "record")).toHaveLength(1);
});
