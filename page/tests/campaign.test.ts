import { describe, expect, it, vi } from "vitest";

vi.stubGlobal("location", { hash: "", pathname: "/" });
vi.stubGlobal("addEventListener", () => undefined);
const { paced } = await import("../src/measured/campaign");

describe("the pace of a campaign", () => {
  it("is a number, or nothing was typed: a decimal comma is refused", () => {
    expect(paced(" ")).toEqual({});
    expect(paced("2.5")).toEqual({ pace: 2.5 });
    for (const text of ["2,5", "fast", "1e999", "NaN"])
      expect(() => paced(text)).toThrow("Times real time is no number");
  });
});
