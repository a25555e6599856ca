/** The description that is open: its text is the truth, and what the server says of it. */
import { signal } from "@preact/signals";
import { ask, read, Refused, write, type Problem } from "./server";
import type { Drawing } from "./circuit";

export interface Field {
  key: string;
  text: string;
  origin: string;
  kind: "given" | "source" | "identified" | "assumed" | "default";
  number?: number;
  unit?: string;
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
    void take(path, found.text, mine, Promise.resolve(found.checked));
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
  await check(text);
}

/** Show what the server says of a text, and its drawing behind that; only the newest answer counts. */
async function take(path: string, text: string, mine: number, answered: Promise<Checked>): Promise<void> {
  try {
    const found = await answered;
    if (mine !== asked) return;
    problems.value = found.problems;
    if (found.problems.length) return;
    valid.value = found;
    const shapes = await ask<Drawing>("/api/drawing", { path, text });
    if (mine === asked) drawing.value = shapes;
  } catch (error) {
    if (mine === asked && error instanceof Refused) problems.value = error.problems;
  }
}

const check = (text: string): Promise<void> => take(opened.value!.path, text, ++asked, ask<Checked>("/api/check", { path: opened.value!.path, text }));

/** Set one value in the text; the server keeps comments and order. */
export async function set(key: string, value: string | number): Promise<void> {
  if (!opened.value) return;
  try {
    const { text } = await ask<{ text: string }>("/api/edit", { text: opened.value.text, key, value });
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
