/** Figures of measured points with their bars, the curves of fits with their bands, and plain lines. */
import type { Axis, Mark, Markers, ShownFigure } from "../server/generated";
import { digits } from "./looks";
import type { Numbers } from "./scale";

export interface Point {
  x: number;
  y: number;
  spread: number | null;
  run?: unknown; // points of later runs are open
}

/** Points, and the curve that belongs to them. */
export interface Group {
  label: string;
  points: Point[];
  curve?: { x: number[]; y: Numbers; low?: Numbers; high?: Numbers; measured?: Numbers };
}

type Look = [color: string, dash: string, marker: string];

export const MOST_SERIES = 4; // of a panel; the points of others are grey
const LOOKS: Look[] = [
  ["blue", "-", "o"],
  ["orange", "--", "s"],
  ["green", "-.", "^"],
  ["path", ":", "D"],
];
const GREY: Look = ["grey", "-", "."];
const DECADE = 10; // values that span as much lie on a logarithmic axis

/** Label of an axis with its unit, and the size of this unit in that of the values; absent: 1. */
type Quantity = string | [label: string, size: number];

/** Return an axis that follows its values. */
export const axis = (quantity: Quantity, scale = "linear", low: number | null = null): Axis => ({
  label: typeof quantity === "string" ? quantity : quantity[0],
  scale,
  low,
  high: null,
  below: 0,
  above: 0,
  names: [],
  is_named: true,
  unit: "",
  size: typeof quantity === "string" ? 1 : quantity[1],
});

/** Return whether the points of all groups lie above zero and span a decade. */
export function isWide(groups: Group[]): boolean {
  const all = groups.flatMap((group) => group.points.map((point) => point.x));
  return all.length > 1 && Math.min(...all) > 0 && Math.max(...all) >= DECADE * Math.min(...all);
}

/** Return evenly spread indices of the groups that have a look of their own. */
function shownOf(count: number): number[] {
  const most = Math.min(count, MOST_SERIES);
  return Array.from({ length: most }, (_, k) => Math.round((k * (count - 1)) / Math.max(most - 1, 1)));
}

/** Return the marks of a group: its band, its curve, dotted beyond the measured range, and its points by run. */
function marksOf({ label, points, curve }: Group, look: Look): Mark[] {
  const marks: Mark[] = [];
  const line = { width: null, steps: false, kind: "line" } as const;
  if (curve) {
    const { x, y, low, high, measured: [from, to] = [-Infinity, Infinity] } = curve;
    const isInside = x.map((at) => at >= from! * (1 - 1e-9) && at <= to! * (1 + 1e-9));
    if (low && high) marks.push({ x, low, high, label: "", look, kind: "band" });
    if (isInside.includes(false)) marks.push({ ...line, x, y, label: "", look: [look[0], ":", look[2]], width: 0.9 });
    marks.push({ ...line, x, y: y.map((value, k) => (isInside[k] ? value : null)), label, look });
  }
  const runs = [...new Set(points.map((point) => point.run))];
  for (const run of runs) {
    const own = points.filter((point) => point.run === run);
    const end = (sign: number) => own.map(({ y, spread }) => (spread === null ? null : y + sign * spread));
    marks.push({
      x: own.map((point) => point.x),
      y: own.map((point) => point.y),
      label,
      look,
      low: end(-1),
      high: end(1),
      size: points.length > 60 ? 2.2 : 4,
      filled: run === runs[0],
      joined: false,
      names: [],
      kind: "markers",
    });
  }
  return marks;
}

/** Return a figure with a panel for each part, on equal axes; `isLog` holds for x. */
export function pointsFigure(about: {
  name: string;
  caption?: string;
  x: Quantity;
  y: Quantity;
  panels: { title: string; groups: Group[] }[];
  isLog?: boolean;
  isFromZero?: boolean;
}): ShownFigure {
  const { name, caption = "", x, y, panels, isLog = false, isFromZero = false } = about;
  const values = panels.flatMap((panel) => panel.groups.flatMap((group) => group.points.map((point) => point.y)));
  const low = isFromZero && values.every((value) => value >= 0) ? 0 : null;
  const drawn = panels.map(({ title, groups }) => {
    const shown = shownOf(groups.length);
    const marks = groups.flatMap((group, k) => {
      const place = shown.indexOf(k);
      return place < 0 ? marksOf({ label: "", points: group.points }, GREY) : marksOf(group, LOOKS[place]!);
    });
    return { marks, title, x: axis(""), y: axis("") };
  });
  return {
    name,
    caption,
    figure: {
      panels: drawn,
      x: axis(x, isLog ? "log" : "linear"),
      y: axis(y, "linear", low),
      columns: 3,
      title: "",
      row_in: panels.length > 1 ? 1.4 : 2.2,
      share_x: "all",
      share_y: "all",
      heights: [],
      tall: null,
      tall_first: false,
    },
  };
}

/** A row of a strip: its name, and its values in the unit of the axis, each with the run that it is of. */
export interface StripRow {
  name: string;
  values: { value: number; of: string }[];
}

/** Return a figure of the values of each row on a logarithmic axis. Values over a limit have the colour of a miss. */
export function stripFigure(name: string, x: string, rows: StripRow[], limit = Infinity): ShownFigure {
  const figure = pointsFigure({ name, x, y: "", isLog: true, panels: [] });
  const hasLimit = limit < Infinity;
  const unit = x.split(", ")[1];
  const marks = rows.flatMap(({ values }, row) => {
    const known = values.filter(({ value }) => value > 0);
    return [false, true].flatMap((isOver): (Markers & { titles: string[] })[] => {
      const some = known.filter(({ value }) => value > limit === isOver);
      if (!some.length) return [];
      const largest = Math.max(...some.map(({ value }) => value));
      const verdict = isOver ? "misses" : "keeps";
      const ofMany = (value: number) => (isOver && value === largest ? `${some.length} of ${known.length} miss` : "");
      const alone = `${digits(largest)}${hasLimit ? `, ${verdict}` : ""}`;
      return [
        {
          x: some.map(({ value }) => value),
          y: some.map(() => row),
          titles: some.map(({ value, of }) => `${of}: ${digits(value)} ${unit}${isOver ? ", over the goal" : ""}`),
          names: some.map(({ value }) => (known.length === 1 ? alone : ofMany(value))),
          look: [isOver ? "red" : `look-${(row % 8) + 1}`, "-", "|"],
          label: "",
          low: null,
          high: null,
          size: 6,
          filled: true,
          joined: false,
          kind: "markers",
        },
      ];
    });
  });
  const goal: Mark[] = hasLimit
    ? [{ x: limit, y: null, label: `goal ${digits(limit)}`, look: ["black", "--", ""], width: 1, kind: "rule" }]
    : [];
  const names = { ...axis(""), names: rows.map((row) => row.name), low: rows.length - 0.5, high: -0.5 };
  const own = { title: "", x: axis(""), y: names };
  const sizes = { row_in: 0.2 + 0.19 * rows.length, x: { ...figure.figure.x, above: 0.15 } };
  return { ...figure, figure: { ...figure.figure, ...sizes, panels: [{ ...own, marks: [...marks, ...goal] }] } };
}
