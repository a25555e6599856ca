import { describe, expect, it, vi } from "vitest";

vi.stubGlobal("addEventListener", () => undefined);
const { short } = await import("../src/simulate/beside");

describe("the name of a run beside another", () => {
  it("is that of its file, with the folder where two have that name", () => {
    const all = ["monday/axis.toml", "axis.toml", "heavy.toml", "catalogue:reference"];
    expect(all.map((one) => short(one, all))).toEqual(["monday/axis.toml", "axis.toml", "heavy.toml", "reference"]);
  });
});
