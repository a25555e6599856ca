/** Addresses name a view and an object: `#/simulate/<file>`. */
import { signal } from "@preact/signals";

export const route = signal<{ view: string; path: string }>({ view: "studies", path: "" });

export const link = (view: string, path = ""): string => `#/${view}/${encodeURIComponent(path)}`;

/** Return whether a name is that of a TOML file, in upper or lower case. */
export const isToml = (path: string): boolean => path.toLowerCase().endsWith(".toml");

export const inCatalogue = (path: string): boolean => path.startsWith("catalogue:");

export function follow(): void {
  const [, view, path] = /^#\/(\w+)\/?(.*)$/.exec(location.hash) ?? [];
  route.value = { view: view ?? "studies", path: decoded(path ?? "") };
}

/** Decode a part of an address. A truncated part stays unchanged. */
function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}
