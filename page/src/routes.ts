/**
 * Addresses name a view, an object, and the choices in the view: `#/friction/<file>?seal=PK`. Undo and redo have one stack for
 * all that is set in the page, choices and sliders as well as the open text.
 */
import { effect, type Signal, signal } from "@preact/signals";

export const route = signal<{ view: string; path: string }>({ view: "studies", path: "" });

export const link = (view: string, path = ""): string => `#/${view}/${encodeURIComponent(path)}`;

/** Return whether a name is that of a TOML file, in upper or lower case. */
export const isToml = (path: string): boolean => path.toLowerCase().endsWith(".toml");

export const inCatalogue = (path: string): boolean => path.startsWith("catalogue:");

const states: Record<string, Signal<string>> = {};
const parts = (): string[] => (typeof location === "undefined" ? "" : location.hash).split("?");

/** Return the signal of a choice that the address keeps, so that a shared link and a reload show it again. */
export function kept(name: string): Signal<string> {
  const choice = (states[name] ??= undoable(signal(new URLSearchParams(parts()[1]).get(name) ?? "")));
  effect(() => {
    const [value, [object, query]] = [choice.value, parts()];
    const all = new URLSearchParams(query);
    if ((all.get(name) ?? "") === value) return;
    if (value) all.set(name, value);
    else all.delete(name);
    history.replaceState(null, "", [object, all.toString()].filter(Boolean).join("?"));
  });
  return choice;
}

export function follow(): void {
  const [, view, path, query] = /^#\/(\w+)\/?([^?]*)\??(.*)$/.exec(location.hash) ?? [];
  const all = new URLSearchParams(query);
  for (const [name, choice] of Object.entries(states)) choice.value = all.get(name) ?? "";
  route.value = { view: view ?? "studies", path: decoded(path ?? "") };
}

/** Decode a part of an address. Invalid codes, as in a truncated part, stay. */
const decoded = (part: string): string =>
  new URLSearchParams(`part=${part.replace(/[+&]/g, encodeURIComponent)}`).get("part") ?? "";

/** Value that a step sets. `write` gets what `read` has returned before. */
export interface Source {
  read: () => unknown;
  write: (value: never) => unknown;
}

interface Step {
  values: Map<Source, unknown>;
  action: number;
  at: number;
}

export const past = signal<Step[]>([]);
export const future = signal<Step[]>([]);
const MOST_STEPS = 200;
const QUICK_MS = 800; // changes of one value within it are one step: keys, and a slider on its way

let action = 0; // number of the user's action whose handlers run; 0 outside of them
let actions = 0;
let isStepping = false;

/** Keep the value that a source had before a change. Changes of one action are one step. */
export function remember(source: Source, before: unknown, isQuick = true): void {
  const now = performance.now();
  const at = isQuick ? now : -Infinity;
  const last = past.peek().at(-1);
  const isNext = isQuick && last?.values.size === 1 && last.values.has(source) && now - last.at < QUICK_MS;
  future.value = [];
  if (last && (isNext || (action && last.action === action))) {
    if (!last.values.has(source)) last.values.set(source, before);
    last.at = at;
  } else past.value = [...past.peek().slice(1 - MOST_STEPS), { values: new Map([[source, before]]), action, at }];
}

/** Give a signal a place in the stack. Values that the page itself sets are not undone. */
export function undoable<T>(choice: Signal<T>): Signal<T> {
  let before = choice.peek();
  const source = { read: () => choice.peek(), write: (value: T) => (choice.value = value) };
  choice.subscribe((value) => {
    if (action && !isStepping && value !== before) remember(source, before);
    before = value;
  });
  return choice;
}

/** Go back or forward by one step, whatever made it. */
export function step(from: typeof past, to: typeof past): void {
  const last = from.peek().at(-1);
  if (!last) return;
  from.value = from.peek().slice(0, -1);
  const values = new Map([...last.values.keys()].map((source) => [source, source.read()]));
  to.value = [...to.peek(), { values, action: 0, at: 0 }];
  isStepping = true;
  for (const [source, value] of last.values) source.write(value as never);
  isStepping = false;
}

/** Forget all steps: they belong to another object. */
export const forgetSteps = (): void => void (past.value = future.value = []);

const TEXTS = "textarea, [contenteditable], input:not([type]), input[type=text], input[type=search]";

/** Follow the actions of the user, and Ctrl Z, Ctrl Shift Z and Ctrl Y outside of a text that is being typed. */
export function followActions(): void {
  for (const name of ["input", "change", "click", "keydown"])
    addEventListener(
      name,
      () => {
        const number = (action = ++actions);
        setTimeout(() => void (action === number && (action = 0)));
      },
      true,
    );
  let typed = ""; // text of a field when it was entered, or last taken
  const note = ({ target }: Event) => void (typed = (target as HTMLInputElement).value ?? "");
  addEventListener("focusin", note);
  addEventListener("change", note);
  addEventListener("keydown", (event) => {
    const key = event.key.toLowerCase();
    if (!(event.ctrlKey || event.metaKey) || event.altKey || (key !== "z" && key !== "y") || event.defaultPrevented)
      return;
    const at = event.composedPath()[0] as HTMLInputElement;
    if (at.matches?.(TEXTS) && (at.value === undefined || at.value !== typed)) return; // the browser undoes it
    event.preventDefault();
    if (key === "y" || event.shiftKey) step(future, past);
    else step(past, future);
  });
}
