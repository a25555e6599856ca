/** Address of a view: `#/simulate/<file>`. */
import { signal } from "@preact/signals";

export type View = "studies" | "drive" | "simulate" | "recording" | "friction" | "campaign" | "validation" | "sizing" | "control" | "handover";

export const route = signal<{ view: View; path: string }>({ view: "studies", path: "" });

export const link = (view: View, path = ""): string => `#/${view}/${encodeURIComponent(path)}`;

/** Return whether a name is that of a TOML file, in upper or lower case. */
export const isToml = (path: string): boolean => path.toLowerCase().endsWith(".toml");

export function follow(): void {
  const [, view, path] = /^#\/(\w+)\/?(.*)$/.exec(location.hash) ?? [];
  const known: View[] = ["studies", "drive", "simulate", "recording", "friction", "campaign", "validation", "sizing", "control", "handover"];
  route.value = { view: known.find((one) => one === view) ?? "studies", path: decoded(path ?? "") };
}

/** Decode a part of an address. A truncated part stays unchanged. */
function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

/** Return the view that shows files of this kind. */
export const VIEW_OF: Record<string, View> = { drive: "simulate", circuit: "simulate", recording: "recording", "friction map": "friction", fit: "friction", campaign: "campaign", comparison: "control", validation: "validation", task: "sizing", sizing: "sizing", fmu: "handover", other: "drive" };
