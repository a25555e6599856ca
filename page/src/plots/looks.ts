/** Looks of curves: colour and line style differ, as in the figures of pneudrive's reports. */

import { signal } from "@preact/signals";
import { type Field, SEVERE } from "../server/generated";

/** Millimetre and bar in SI. */
export const [MM, BAR] = [1e-3, 1e5];

/** Line styles of eight curves. Their colours are the tokens `--look-1` to `--look-8`; `page/tests/looks.test.ts` measures them. */
const DASHES: number[][] = [[], [8, 4], [8, 3, 2, 3], [2, 3], [10, 2], [2, 2], [6, 2, 2, 2, 2, 2], [14, 4]];

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

const colours = new Map<string, string>();

/** Return the colour of a token on the paper of the moment, for a canvas. */
export function token(name: string): string {
  const key = `${name} ${isDark()}`;
  if (!colours.has(key)) {
    const text = getComputedStyle(document.querySelector(".pneudrive")!).getPropertyValue(`--${name}`).trim();
    const [, light = text, dark = text] = /light-dark\(\s*([^,\s]+)\s*,\s*([^)\s]+)\s*\)/.exec(text) ?? [];
    colours.set(key, isDark() ? dark : light);
  }
  return colours.get(key)!;
}

export function look(index: number): { color: string; dash: number[] } {
  const place = index % DASHES.length;
  return { color: token(`look-${place + 1}`), dash: DASHES[place]! };
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

const TINY = 1e-4; // smaller numbers have an exponent

/** A number for people: three digits, no trailing zeros. */
export function digits(value: number | null | undefined, count = 3): string {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  const short = Number(value.toPrecision(count));
  return Math.abs(short) < TINY && short !== 0 ? short.toExponential() : String(short);
}

/** A value as a file writes it. */
export const withUnit = (value: number, unit = ""): string | number => (unit ? `${value} ${unit}` : value);

type Valued = Pick<Field, "key" | "number" | "unit">;

/** The numbers that differ from those of their values, as a file writes them. */
export const changed = (of: Iterable<Valued>, numbers: Record<string, number>): Record<string, string | number> =>
  Object.fromEntries(
    [...of].flatMap(({ key, number, unit }) => {
      const value = numbers[key];
      return value === undefined || number === undefined || value === number ? [] : [[key, withUnit(value, unit)]];
    }),
  );

/** A number of things in words: `1 impact`, `3 impacts`. */
export const count = (number: number, thing: string): string => `${number} ${thing}${number === 1 ? "" : "s"}`;

/** Whether a finding endangers people, the machine or the order. */
export const isSevere = (finding: string): boolean => SEVERE.some((word) => finding.startsWith(word));

/** A message of the server as a sentence. A name at its beginning stays as it is. */
export const sentence = (words: string): string =>
  `${/^[a-z]+[ ,]/.test(words) ? words.charAt(0).toUpperCase() : words.charAt(0)}${words.slice(1)}${/[.!?]$/.test(words) ? "" : "."}`;

/** A time in words. */
export function duration(seconds: number): string {
  if (seconds < 90) return `${Math.round(seconds)} s`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${digits(seconds / 3600, 3)} h`;
}

const RAISED: Record<string, string> = { 2: "²", 3: "³" };

/** Units as people write them: µm, cm³. In fields they stay as files write them. */
export const pretty = (words: string): string =>
  words
    .replace(/\bu([ms])\b/g, "µ$1")
    .replace(/\b([cdm]?m)\^?([23])\b/g, (_, unit: string, power: string) => unit + RAISED[power]);

/** Return about this many round ticks between two ends. */
export function ticks(low: number, high: number, count = 5): number[] {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough)!;
  const out = [];
  for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * step; value += step)
    out.push(Number(value.toPrecision(8)));
  return out;
}
