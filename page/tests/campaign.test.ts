import { beforeEach, describe, expect, it, vi } from "vitest";

vi.stubGlobal("location", { hash: "", pathname: "/" });
vi.stubGlobal("addEventListener", () => undefined);
const { look, paced, unread } = await import("../src/measured/campaign");

describe("the pace of a campaign", () => {
  it("is a number, or nothing was typed: a decimal comma is refused", () => {
    expect(paced(" ")).toEqual({});
    expect(paced("2.5")).toEqual({ pace: 2.5 });
    for (const text of ["2,5", "fast", "1e999", "NaN"])
      expect(() => paced(text)).toThrow("Times real time is no number");
  });
});

describe("a look at a campaign", () => {
  const answers: [number, object][] = [];
  beforeEach(() =>
    vi.stubGlobal("fetch", async () => {
      const [status, body] = answers.shift()!;
      return new Response(JSON.stringify(body), { status, headers: { "content-type": "application/json" } });
    }),
  );
  it("that succeeds takes away the problem of the one before", async () => {
    answers.push(
      [400, { problems: [{ what: "campaigns/first is no campaign" }] }],
      [200, { groups: [] }],
      [400, { problems: [{ what: "late" }] }],
    );
    await look("campaigns/first", () => false);
    expect(unread.value.map((one) => one.what)).toEqual(["campaigns/first is no campaign"]);
    await look("campaigns/first", () => false);
    expect(unread.value).toEqual([]);
    await look("campaigns/first", () => true);
    expect(unread.value).toEqual([]);
  });
});
