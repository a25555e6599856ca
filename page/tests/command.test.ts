import { describe, expect, it } from "vitest";
import { withFile, word } from "../src/workspace/command";

describe("a command from a file", () => {
  it("is the file of a drive", () => expect(withFile("0 s: 1", "", "steps.csv")).toBe("steps.csv"));
  it("takes the line of its valve alone", () => {
    expect(withFile("left: 0 s: 1\nleft_b.command: 0.2\n", "left", "a.csv")).toBe("left_b.command: 0.2\nleft: a.csv");
  });
});

describe("a name as one word of a shell", () => {
  it("is itself where it can", () => expect(word("campaigns/first-1.b")).toBe("campaigns/first-1.b"));
  it("stands in quotes else", () => expect(word("campaigns/it's mine")).toBe(`'campaigns/it'\\''s mine'`));
});
