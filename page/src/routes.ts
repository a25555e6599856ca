/** Addresses name a view, an object, and the choices in the view: `#/friction/<file>?seal=PK`. */
import { effect, type Signal, signal } from "@preact/signals";
import { undoable } from "./undo";

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

/** Decode a part of an address. What is no code, as in a truncated part, stays. */
const decoded = (part: string): string =>
  new URLSearchParams(`part=${part.replace(/[+&]/g, encodeURIComponent)}`).get("part") ?? "";
