import { describe, expect, it } from "vitest";
import { withFile } from "../src/command";

describe("a command from a file", () => {
  it("is the file of a drive", () => expect(withFile("0 s: 1", "", "steps.csv")).toBe("steps.csv"));
  it("takes the line of its valve alone", () => {
    expect(withFile("left: 0 s: 1\nleft_b.command: 0.2\n", "left", "a.csv")).toBe("left_b.command: 0.2\nleft: a.csv");
  });
});
