/** The address of a view: `#/simulate/<file>`. */
import { signal } from "@preact/signals";

export type View = "studies" | "drive" | "simulate" | "recording" | "friction" | "campaign" | "validation" | "sizing" | "control" | "handover";

export const route = signal<{ view: View; path: string }>({ view: "studies", path: "" });

export const link = (view: View, path = ""): string => `#/${view}/${encodeURIComponent(path)}`;

/** Whether a name is that of a TOML file, whoever wrote its ending. */
export const isToml = (path: string): boolean => path.toLowerCase().endsWith(".toml");

export function follow(): void {
  const [, view, path] = /^#\/(\w+)\/?(.*)$/.exec(location.hash) ?? [];
  const known: View[] = ["studies", "drive", "simulate", "recording", "friction", "campaign", "validation", "sizing", "control", "handover"];
  route.value = { view: known.find((one) => one === view) ?? "studies", path: decoded(path ?? "") };
}

/** A part of an address; one that was cut off stays as it is. */
function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

/** The view that shows a file of a kind. */
export const VIEW_OF: Record<string, View> = { drive: "simulate", circuit: "simulate", recording: "recording", "friction map": "friction", fit: "friction", campaign: "campaign", comparison: "control", validation: "validation", task: "sizing", sizing: "sizing", fmu: "handover", other: "drive" };
