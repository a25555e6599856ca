/** Looks of curves: colour and line style differ, as in the figures of pneudrive's reports. */

import { signal } from "@preact/signals";

export interface Look {
  light: string;
  dark: string;
  dash: number[];
}

export const LOOKS: Look[] = [
  { light: "#111111", dark: "#f2f2f2", dash: [] },
  { light: "#1f5f99", dark: "#7fb8ec", dash: [8, 4] },
  { light: "#b45f06", dark: "#f0a33f", dash: [8, 3, 2, 3] },
  { light: "#3f6f3e", dark: "#8fc98d", dash: [2, 3] },
  { light: "#6b6b6b", dark: "#a8a8a8", dash: [10, 2] },
  { light: "#111111", dark: "#f2f2f2", dash: [2, 2] },
  { light: "#1f5f99", dark: "#7fb8ec", dash: [6, 2, 2, 2, 2, 2] },
  { light: "#b45f06", dark: "#f0a33f", dash: [14, 4] },
];

const DARK = typeof matchMedia === "undefined" ? null : matchMedia("(prefers-color-scheme: dark)");

const dark = signal(DARK?.matches ?? false);
DARK?.addEventListener("change", ({ matches }) => (dark.value = matches));

/** Return whether the paper is dark. Drawings that read this are drawn again when it changes. */
export const isDark = (): boolean => dark.value;

/**
 * Follow the notebook's paper: it counts as dark if the text around an element is light. Return a function that
 * ends this.
 */
export function followInk(at: Element): () => void {
  const ink = document.createElement("canvas").getContext("2d", { willReadFrequently: true })!;
  const follow = () => {
    ink.fillStyle = getComputedStyle(at).color;
    ink.fillRect(0, 0, 1, 1); // whatever the notation of the colour, as bytes
    const [red, green, blue] = ink.getImageData(0, 0, 1, 1).data;
    dark.value = 0.299 * red! + 0.587 * green! + 0.114 * blue! > 128;
  };
  const seen = new MutationObserver(follow);
  for (const one of [document.documentElement, document.body]) seen.observe(one, { attributes: true });
  const placed = new ResizeObserver(follow); // an element has no colour before it has a place
  placed.observe(at);
  DARK?.addEventListener("change", follow);
  return () => {
    seen.disconnect();
    placed.disconnect();
    DARK?.removeEventListener("change", follow);
  };
}

export function look(index: number): { color: string; dash: number[] } {
  const found = LOOKS[index % LOOKS.length] as Look;
  return { color: isDark() ? found.dark : found.light, dash: found.dash };
}

/**
 * Return a time with enough digits to tell it from a time one hundredth of a step away. A clock time in a recording
 * has ten digits before the point.
 */
export function instant(time: number | undefined, step: number): string {
  if (time === undefined || Number.isNaN(time)) return "–";
  const count = time && step > 0 ? Math.ceil(Math.log10(Math.abs(time) / step)) + 3 : 15;
  return digits(time, Math.min(Math.max(count, 4), 15));
}

/** Return a number for people: four digits, no trailing zeros. */
export function digits(value: number | null | undefined, count = 4): string {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  return String(Number(value.toPrecision(count)));
}
