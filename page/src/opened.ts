/** The description that is open: its text is the truth, and what the server says of it. */
import { signal } from "@preact/signals";
import { ask, newest, read, Refused, write, type Problem } from "./server";
import type { Drawing } from "./circuit";

export interface Field {
  key: string;
  text: string;
  origin: string;
  kind: "given" | "source" | "identified" | "assumed" | "default";
  number?: number;
  unit?: string;
  units?: string[]; // of the same quantity
  component: string; // of the drawing
  low?: number;
  high?: number;
}

export interface Checked {
  problems: Problem[];
  name?: string;
  kind?: "drive" | "circuit";
  valves?: string[];
  values?: Field[];
  notes?: string[];
  sliders?: string[];
}

export interface Opened {
  path: string;
  text: string;
  saved: string;
  sha256: string;
}

export const opened = signal<Opened | null>(null);
export const problems = signal<Problem[]>([]);
/** What was last valid: it stays while the text is wrong. */
export const valid = signal<Checked | null>(null);
export const drawing = signal<Drawing | null>(null);
export const said = signal("");

let asked = 0;

export async function open(path: string): Promise<void> {
  if (opened.value?.path === path) return;
  said.value = "";
  valid.value = null;
  drawing.value = null;
  const mine = ++asked;
  try {
    const found = await read<{ text: string; sha256: string | null; checked: Checked }>("/api/file", { path, checked: "1" });
    if (mine !== asked) return;
    opened.value = { path, text: found.text, saved: found.text, sha256: found.sha256 ?? "" };
    take(found.checked, mine, opened.value);
  } catch (error) {
    if (mine !== asked) return;
    opened.value = null;
    problems.value = error instanceof Refused ? error.problems : [];
  }
}

/** Take another text for the open file and have it checked; only the newest answer counts. */
export async function change(text: string): Promise<void> {
  if (!opened.value || opened.value.text === text) return;
  opened.value = { ...opened.value, text };
  asked += 1;
  await check();
}

/** Show what the server says of a text, and its drawing behind that; only the newest answer counts. */
function take(found: Checked, mine: number, { path, text }: { path: string; text: string }): void {
  if (mine !== asked) return;
  problems.value = found.problems;
  if (found.problems.length) return;
  valid.value = found;
  toDraw = { mine, path, text };
  void draw();
}

function refused(error: unknown, mine: number): void {
  if (!(error instanceof Refused)) throw error;
  if (mine === asked) problems.value = error.problems;
}

/** One text is checked at a time: problems show as soon as the server answers, however fast keys follow each other. */
const check = newest(async () => {
  const [mine, { path, text }] = [asked, opened.value!];
  try {
    take(await ask<Checked>("/api/check", { path, text }), mine, { path, text });
  } catch (error) {
    refused(error, mine);
  }
});

let toDraw = { mine: 0, path: "", text: "" }; // the last text without a problem
const draw = newest(async () => {
  const { mine, path, text } = toDraw;
  try {
    const shapes = await ask<Drawing>("/api/drawing", { path, text });
    if (mine === asked) drawing.value = shapes;
  } catch (error) {
    refused(error, mine);
  }
});

/** Set one value in the text, written in a unit if one is given; the server keeps comments and order. */
export async function set(key: string, value: string | number, unit?: string): Promise<void> {
  if (!opened.value) return;
  try {
    const { text } = await ask<{ text: string }>("/api/edit", { text: opened.value.text, key, value, unit });
    await change(text);
  } catch (error) {
    if (error instanceof Refused) problems.value = error.problems;
  }
}

/** Save; a file that changed on disk meanwhile is not overwritten. */
export async function save(path: string): Promise<void> {
  const now = opened.value;
  if (!now) return;
  try {
    const { sha256 } = await write(path, now.text, path === now.path ? now.sha256 : "");
    opened.value = { ...opened.value!, path, saved: now.text, sha256 };
    said.value = `Saved ${path}.`;
    if (path !== now.path) location.hash = location.hash.replace(encodeURIComponent(now.path), encodeURIComponent(path));
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    if (error.status === 412)
      said.value = `${path} changed on disk: nothing was written. Save under another name, or open the file again.`;
    else problems.value = error.problems;
  }
}
