/** The open description: its text, and the last answer of the server about this text. */
import { effect, signal, untracked } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { link, remember, route, type Source } from "../routes";
import type { Checked, TextFile as Found, Problem } from "../server/generated";
import { answering, ask, isAnswering, newest, problemsOf, Refused, read, useAnswer, write } from "../server/server";
import type { Drawing } from "./circuit";

export interface Opened {
  path: string;
  text: string;
  saved: string;
  sha256: string;
  isTask: boolean; // of a sizing, not a description
}

export const opened = signal<Opened | null>(null);
export const problems = signal<Problem[]>([]);
/** Last valid answer with its text, kept while the text is wrong. */
export const valid = signal<(Checked & Pick<Opened, "path" | "text">) | null>(null);
export const said = signal("");
/** Text on disk, if it differs from the text that the page started from and the page has unsaved changes. */
export const onDisk = signal<Found | null>(null);

/** Texts that were left, as they were then. */
const left = new Map<string, Opened>();
const isSaved = (one: Opened | null | undefined): boolean => !one || one.text === one.saved;

/** Return whether the page has unsaved text of a description. Runs that read the file do not see this text. */
export const isUnsaved = (path: string): boolean =>
  !isSaved(opened.value?.path === path ? opened.value : left.get(path));

globalThis.addEventListener?.("beforeunload", (event) => {
  if (![opened.value, ...left.values()].every(isSaved)) event.preventDefault();
});

let asked = 0;

const openText: Source = { read: () => opened.value?.text ?? "", write: (text: string) => void put(text) };

/** Read a file. A task without a name begins with the text of the server. */
const readText = (path: string): Promise<Found> =>
  path ? read<Found>("/api/file", { path }) : ask<Found>("/api/task", {});

/** Open a file as a description or a task, or check whether the open one still equals the file on disk. */
export async function open(path: string, isTask = false): Promise<void> {
  const before = opened.value;
  const isOpen = before?.path === path && before.isTask === isTask;
  if (!isOpen) {
    if (before) left.set(before.path, before);
    said.value = "";
    problems.value = [];
    onDisk.value = valid.value = null;
  }
  const draft = isOpen ? before : left.get(path);
  const mine = isOpen ? asked : ++asked;
  try {
    const { text, sha256 } = await readText(path);
    if (mine !== asked) return;
    if (isOpen && opened.value?.sha256 !== before.sha256) return; // it was saved meanwhile
    const found = { text, sha256: sha256 ?? "" };
    if (isOpen && found.sha256 === before.sha256) {
      if (said.value !== wasSaved(path)) said.value = ""; // it may have been away
      return;
    }
    const own = draft && !isSaved(draft) ? draft : null;
    onDisk.value = own && own.sha256 !== found.sha256 ? found : null;
    if (!own) return show({ path, isTask, ...found, saved: text });
    if (!isOpen) await show({ ...own, isTask });
  } catch (error) {
    if (mine !== asked || !(error instanceof Refused)) return;
    if (isOpen) said.value = `${path} cannot be read any more: ${error.message}.`;
    else [opened.value, problems.value] = [null, error.problems];
  }
}

/** Replace the page's text by the text on disk. */
export function takeFromDisk(): void {
  if (!opened.value || !onDisk.value) return;
  const { text, sha256 } = onDisk.value;
  onDisk.value = null;
  void show({ ...opened.value, text, saved: text, sha256: sha256 ?? "" });
}

/** Show a text, and check it. */
function show(text: Opened): Promise<void> {
  said.value = "";
  left.delete(text.path);
  opened.value = text;
  asked += 1;
  return check();
}

/** Replace the text of the open file and check it. `typed`: keys that follow one another are one step of undo. */
export async function change(text: string, typed = false): Promise<void> {
  if (!opened.value || opened.value.text === text) return;
  remember(openText, opened.value.text, typed);
  await put(text);
}

async function put(text: string): Promise<void> {
  if (!opened.value) return;
  opened.value = { ...opened.value, text };
  asked += 1;
  await check();
}

function refused(error: unknown, mine: number): void {
  const found = problemsOf(error);
  if (mine === asked) problems.value = found;
}

/** Only one check is in flight. Problems therefore appear as soon as the server answers, even during fast typing. */
const check = newest(async () => {
  const [mine, now] = [asked, opened.value];
  if (!now) return; // it was left meanwhile
  const { path, text, isTask } = now;
  try {
    const found = await ask<Checked>(isTask ? "/api/task" : "/api/check", { path, text });
    if (mine !== asked) return;
    problems.value = found.problems;
    if (!found.problems.length) valid.value = { ...found, path, text };
  } catch (error) {
    refused(error, mine);
  }
});

effect(() => {
  if (isAnswering()) untracked(() => void check()); // what was typed while the server did not answer
});

const QUIET_MS = 100; // without a change of the text, before it is drawn again

/** The drawing of the last valid text, for as long as it is shown: nobody else waits for the server to make it. */
export function useDrawing(): Drawing | null {
  const { kind, path = "", text } = valid.value ?? {};
  const question = () => ask<Drawing>("/api/drawing", { path, text });
  const isDrawn = useRef(false);
  const [drawing, wrong] = useAnswer(kind ? path : "", question, [valid.value], isDrawn.current ? QUIET_MS : 0);
  isDrawn.current = drawing !== null;
  useEffect(() => void (wrong.length && (problems.value = wrong)), [wrong]);
  return drawing;
}

let edits = Promise.resolve();

type Then = (chosen: string) => void; // gets the component to show

/** Edit the text at a door of the server, after all earlier edits. */
function queue(address: string, what: object, then?: Then): Promise<void> {
  const into = opened.value?.path;
  return (edits = edits.then(() => edit(into, address, what, then)));
}

/** Set one value in the text, with an optional unit. The server keeps comments and order. */
export const set = (key: string, value: string | number, unit?: string): Promise<void> =>
  queue("/api/edit", { key, value, unit });

/** Change the structure of a circuit in the text. */
export const restructure = (what: { act: string; one?: string; other?: string; kind?: string }, then: Then): void =>
  void queue("/api/structure", { path: opened.value?.path, ...what }, then);

/** Write the values of a part of the catalogue into a table of the text. */
export const takePart = (table: string, part: string): void => void queue("/api/part", { table, part });

async function edit(into: string | undefined, address: string, what: object, then?: Then): Promise<void> {
  for (let now = opened.value; now && now.path === into; now = opened.value) {
    try {
      const { text, chosen } = await ask<{ text: string; chosen?: string }>(address, { text: now.text, ...what });
      if (opened.value?.path === into && opened.value.text !== now.text) continue; // it was typed in meanwhile
      if (opened.value?.path !== into) return;
      const drawn = change(text);
      then?.(chosen ?? ""); // with the new text: what is selected after it stays selected
      await drawn;
    } catch (error) {
      if (!isAnswering()) {
        await answering();
        continue;
      }
      if (error instanceof Refused) problems.value = error.problems;
    }
    return;
  }
}

export const wasSaved = (path: string): string => `Saved ${path}.`;

/** Save the text. A file that changed on disk since then is not overwritten. */
export async function save(path: string): Promise<void> {
  const before = opened.value?.path;
  await edits; // values that are on their way into the text belong to it
  const now = opened.value;
  if (!now || now.path !== before) return;
  try {
    const { sha256 } = await write(path, now.text, path === now.path ? now.sha256 : "");
    const saved = { saved: now.text, sha256 };
    if (opened.value?.path !== now.path) {
      const text = left.get(now.path); // it was left during the save, and may have been typed on before
      if (text) left.set(now.path, { ...text, ...saved });
      return;
    }
    opened.value = { ...opened.value, ...saved, path };
    onDisk.value = null;
    said.value = wasSaved(path);
    void check(); // what was wrong with another name is not wrong with the text
    if (path !== now.path) location.hash = link(route.peek().view, path);
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    said.value = "";
    if (opened.value?.path !== now.path) said.value = `${path} was not saved: ${error.message}. Its text is kept.`;
    else if (error.status !== 412) problems.value = error.problems;
    else if (path !== now.path) {
      said.value = `${path} is there already: nothing was written. Choose another name.`;
      void check();
    } else {
      said.value = `${path} changed on disk: nothing was written.`;
      await open(path, now.isTask); // shows what stands there
    }
  }
}
