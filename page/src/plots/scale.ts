/** Scales of the axes of a figure. Values of marks are SI, positions on an axis lie from 0 to 1. */
import type { Axis, Mark } from "../server/generated";
import { digits, ticks } from "./looks";

export type Numbers = (number | null)[];

const ROOM = 0.05; // between data and frame, as a part of the axis
const WIDE = 3; // ratio of values beyond which an axis of scale "wide" is logarithmic
const FAR = 20; // ratio of the largest values of two lines beyond which an axis of scale "far" is logarithmic

/** Position of values on an axis, from 0 to 1, and its ticks. Values are in the unit of the axis. */
export interface Scale {
  at: (value: number) => number;
  ticks: (count: number) => [number, string][];
}

export const isNumber = (value: number | null | undefined): value is number => value !== null && value !== undefined;
export const asList = (value: number | Numbers | null): Numbers => (Array.isArray(value) ? value : [value]);

/** Return the least and the largest of some values. */
export const endsOf = (values: number[]): [low: number, high: number] => [
  values.reduce((a, b) => Math.min(a, b), Infinity),
  values.reduce((a, b) => Math.max(a, b), -Infinity),
];

/** Return the values of a mark along an axis, SI. */
function along(mark: Mark, side: "x" | "y"): Numbers {
  if (mark.kind === "drawing") return [];
  if (mark.kind === "bars" && (side === "x") === mark.across) return [0, ...mark.values];
  if (mark.kind === "bars")
    return mark.at.filter(isNumber).flatMap((at) => [at - mark.thickness / 2, at + mark.thickness / 2]);
  if (side === "x") return asList(mark.x);
  const ends = "low" in mark ? [...(mark.low ?? []), ...(mark.high ?? [])] : [];
  return "y" in mark ? [...asList(mark.y), ...ends] : ends;
}

/** Return the scale of an axis for the marks of all panels that share its ends. */
export function scaleOf(axis: Axis, side: "x" | "y", marks: Mark[]): Scale {
  const each = marks.map((mark) => along(mark, side).flatMap((value) => (isNumber(value) ? value / axis.size : [])));
  let [low, high] = endsOf(each.flat());
  if (axis.names.length) [low, high] = [Math.min(low, -0.5), Math.max(high, axis.names.length - 0.5)];
  if (!(high >= low)) [low, high] = [0, 1];
  const isLog = low > 0 && (axis.scale === "log" || (axis.scale === "wide" && high > WIDE * low));
  const largest = each
    .filter((_, k) => marks[k]!.kind === "line" || marks[k]!.kind === "markers")
    .map((some) => some.reduce((a, b) => Math.max(a, Math.abs(b)), 0))
    .filter((one) => one > 0);
  const [least, most] = endsOf(largest);
  const isFar = axis.scale === "far" && largest.length > 1 && most > FAR * least;
  const linear = isFar ? 10 ** Math.floor(Math.log10(least)) : 0;
  const placed = (value: number) => {
    if (isLog) return Math.log10(Math.max(value, 1e-300));
    return linear ? Math.sign(value) * Math.log10(1 + Math.abs(value) / linear) : value;
  };
  let [from, to] = [placed(low), placed(high)];
  const isTight = side === "x" && marks.every((mark) => ["line", "band", "rule"].includes(mark.kind));
  const room = isTight || axis.names.length ? 0 : ROOM * (to - from);
  const isGrounded = marks.some((mark) => mark.kind === "bars" && (side === "x") === mark.across) && !isLog;
  [from, to] = [
    from - (isGrounded && low === 0 ? 0 : room) - axis.below * (to - from),
    to + (isGrounded && high === 0 ? 0 : room) + axis.above * (to - from),
  ];
  if (axis.low !== null) from = placed(axis.low / axis.size);
  if (axis.high !== null) to = placed(axis.high / axis.size);
  if (to === from) [from, to] = [from - (Math.abs(from) * ROOM || 0.5), to + (Math.abs(to) * ROOM || 0.5)];
  const at = (value: number) => (placed(value) - from) / (to - from);
  const shown = (many: number[]): [number, string][] =>
    many.filter((one) => at(one) > -1e-6 && at(one) < 1 + 1e-6).map((one) => [one, digits(one, 6)]);
  const decades = (first: number, last: number, steps: number[]) =>
    Array.from({ length: Math.max(last - first + 1, 0) }, (_, k) =>
      steps.map((one) => Number((one * 10 ** (first + k)).toPrecision(6))),
    ).flat();
  return {
    at,
    ticks: (count) => {
      if (axis.names.length) return axis.names.map((name, k) => [k, name]);
      const steps = to - from < 1 ? [1, 2, 3, 5, 7] : to - from < 2.5 ? [1, 2, 5] : [1];
      if (isLog) return shown(decades(Math.floor(from), Math.ceil(to), steps));
      if (!linear) return shown(ticks(Math.min(from, to), Math.max(from, to), count));
      const ends = decades(Math.log10(linear), Math.ceil(Math.log10(Math.max(Math.abs(low), Math.abs(high)))), [1]);
      return shown([...ends.map((one) => -one).reverse(), 0, ...ends]);
    },
  };
}
