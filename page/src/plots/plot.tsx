/** One plot over time: with `paint.ts` and the two that save it the only files that touch uPlot. */

import type { Signal } from "@preact/signals";
import { useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import { Table } from "../workspace/fields";
import "../drive/language"; // before uPlot, which reads it
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import "./plot.css";
import type { Frame, Numbers } from "../server/frame";
import type { RunPanel } from "../server/generated";
import { Button } from "../workspace/fields";
import { digits, instant, isDark, look, pretty, token } from "./looks";
import * as paint from "./paint";
import { type Saved, saveCsv, savePng, saveSamples } from "./saving";

export interface Curve {
  label: string;
  x: ArrayLike<number>;
  y: ArrayLike<number>;
  at?: ArrayLike<number>; // values at the times, where those of y are the lowest and the highest of each pixel
  look?: number; // its look; absent: its place
}

/** Return a column of an answer as a curve. */
export function curveOf(arrays: Map<string, Numbers>, x: Numbers, column: string, label: string): Curve {
  return { label, x, y: arrays.get(column)!, at: arrays.get(`${column}/at`) };
}

/** Return the curves of a panel of a run, as far as the run has them. `of` is the name of another run. */
export const curvesOf = ({ arrays }: Pick<Frame<unknown>, "arrays">, { curves }: RunPanel, of = ""): Curve[] =>
  curves
    .filter(({ column }) => arrays.has(column))
    .map(({ column, label }) => curveOf(arrays, arrays.get("time_s")!, column, of ? `${label} (${of})` : label));

/** Return the last index at or before a time, or the first index if the time is before it. */
export function indexAt(times: ArrayLike<number>, at: number): number {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle]! <= at) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** Return the value of a curve at a time by linear interpolation, and NaN beyond its ends. */
export function valueAt({ x, y, at = y }: Curve, time: number): number {
  const below = indexAt(x, time);
  if (x[below] === time) return at[below]!;
  const share = (time - x[below]!) / (x[below + 1]! - x[below]!);
  return share > 0 ? at[below]! + share * (at[below + 1]! - at[below]!) : Number.NaN;
}

/** Return the mean time between two samples of a curve. */
const stepOf = (x: ArrayLike<number> | undefined): number => (x ? (x[x.length - 1]! - x[0]!) / (x.length - 1) : 0);

export interface PlotProps {
  title: string;
  unit: string;
  xUnit?: string;
  size: number; // of the unit, in SI
  curves: Curve[];
  height?: number; // of the area of the curves
  bare?: boolean; // without the axis of time: a plot below has it
  onZoom?: (from: number, to: number) => void;
  onReset?: () => void; // present while a part of the time is shown
  range?: [number, number];
  shades?: paint.Shade[];
  bands?: paint.Band[];
  gaps?: boolean; // values that are no number are gaps, also beside another curve
  marks?: paint.Mark[];
  events?: paint.Event[];
  cursors?: number[]; // times of upright lines, the first one solid, the second one dashed
  onHover?: (time: number) => void; // of the value that is pointed at
  onPick?: (time: number) => void; // a click that is no drag
  log?: boolean; // both axes logarithmic: a spectrum
  extreme?: boolean; // values are the lowest and the highest of each pixel, in turn
  samples?: () => Promise<Map<string, Numbers>>; // all values of the shown part, "time" first
}

const ROWS = 11;

function scaled(values: ArrayLike<number>, size: number): ArrayLike<number> {
  if (size === 1) return values;
  const out = new Float64Array(values.length);
  for (let i = 0; i < values.length; i++) out[i] = (values[i] as number) / size;
  return out;
}

/** Return numbers of an axis as the page writes all others, independent of the browser's language. */
const written = (_: uPlot, splits: (number | null)[]): string[] =>
  splits.map((one) => (one === null ? "" : digits(one, 12)));

/** Return the room for numbers of an axis, pixels. Numbers of a short span far from zero are long. */
function space(_: uPlot, _axis: number, low: number, high: number): number {
  const decimals = Math.max(0, Math.ceil(-Math.log10((high - low) / 10)));
  return Math.max(70, 20 + 7 * Math.max(Math.abs(low), Math.abs(high)).toFixed(Math.min(decimals, 12)).length);
}

/** Return the values with null instead of NaN, because uPlot draws a line across NaN. */
function withGaps(values: ArrayLike<number>): ArrayLike<number | null> {
  for (let i = 0; i < values.length; i++)
    if (Number.isNaN(values[i])) return Array.from(values, (one) => (Number.isNaN(one) ? null : one));
  return values;
}

function aligned(curves: Curve[], size: number): uPlot.AlignedData {
  const same = curves.every((one) => one.x === curves[0]?.x);
  const tables = curves.map((one) => [one.x, withGaps(scaled(one.y, size))] as unknown as uPlot.AlignedData);
  if (!curves.length) return [[]] as unknown as uPlot.AlignedData;
  if (same) return [curves[0]!.x, ...tables.map((one) => one[1])] as unknown as uPlot.AlignedData;
  return uPlot.join(tables);
}

/**
 * Return the number of pixel columns of the page's plots. Each column receives its own lowest and highest value.
 * Without a plot, return `otherwise`.
 */
export function pixelsOfPlots(otherwise = 1000): number {
  const width = document.querySelector("main .u-over")?.clientWidth;
  return width ? Math.min(Math.max(Math.round(width * devicePixelRatio), 200), 4000) : otherwise;
}

/** Plots that show the same part of the time. */
export const zooming = (shown: Signal<[number, number] | null>): Pick<PlotProps, "range" | "onZoom" | "onReset"> => ({
  onZoom: (from, to) => (shown.value = [from, to]),
  ...(shown.value && { range: shown.value, onReset: () => (shown.value = null) }),
});

/** The line of a look as a background, for the legend. */
export function swatch(index: number): string {
  const { color, dash } = look(index);
  let at = 0;
  const stops = dash.map((one, k) => `${k % 2 ? "transparent" : color} ${at}px ${(at += one)}px`);
  return `repeating-linear-gradient(90deg, ${stops.join(", ") || `${color}, ${color}`})`;
}

const AXIS = 34; // height of the axis of time with its label
const HEIGHT = 200; // of the area of the curves
const EDGE = 8; // above and below it
const LOW_SPACE = 16; // between numbers of a low plot

/** Axes of a plot, in the colours of the paper. */
const axes = (x: Partial<uPlot.Axis>, y: Partial<uPlot.Axis> = {}): uPlot.Axis[] => {
  const font = "12px system-ui";
  const axis = {
    values: written,
    stroke: token("axis"),
    grid: { stroke: token("grid"), width: 1 },
    ticks: { show: false },
    font,
    labelFont: font,
    labelSize: 16,
  };
  return [
    { ...axis, space, ...x },
    { ...axis, size: 62, ...y },
  ];
};

const FLAT = 1e-9; // of a unit: a curve that varies less is drawn as a straight line

/** The ends of an axis of values, with some room. */
const reach = (low: number, high: number): [number, number] =>
  high - low < FLAT && Math.abs(high) < FLAT ? [-1, 1] : (uPlot.rangeNum(low, high, 0.1, true) as [number, number]);

export function Plot(props: PlotProps) {
  const place = useRef<HTMLDivElement>(null);
  const title = useRef<HTMLElement>(null);
  const plot = useRef<uPlot | null>(null);
  const latest = useRef(props);
  latest.current = props;
  const shape =
    props.curves.map((one) => one.label).join("|") + props.unit + Boolean(props.bare) + (isDark() ? "d" : "l");
  /* Nothing is drawn again while the curves have the same numbers and names. */
  const numbers = props.curves.flatMap(({ x, y, label }) => [x, y, label]);
  const data = useMemo(() => aligned(props.curves, props.size), [props.size, ...numbers]);
  const height = (props.height ?? HEIGHT) + (props.bare ? EDGE : AXIS) + EDGE;
  const over = props.log ? "frequency" : "time";
  const xUnit = props.xUnit ?? "s";

  /* Layout effects: an effect would run after the next frame, and the curves would come one frame late. */
  useLayoutEffect(() => {
    const at = place.current!;
    const rangeX: uPlot.Range.Function = (_, low, high) => latest.current.range ?? [low, high];
    const rangeY: uPlot.Range.Function = (_, low, high) =>
      low === null ? [low, high] : reach(...paint.within(latest.current, low, high));
    const made = new uPlot(
      {
        width: at.clientWidth || 400,
        height,
        padding: [EDGE, 12, props.bare ? EDGE : 0, 0],
        cursor: { ...(!props.log && { sync: { key: "time" } }), drag: { x: true, y: false, setScale: !props.onZoom } },
        scales: {
          x: { time: false, ...(props.log ? { distr: 3 } : { range: rangeX }) },
          y: props.log ? { distr: 3 } : { range: rangeY },
        },
        legend: { show: false },
        axes: axes(
          props.bare ? { size: 0, values: () => [] } : { size: AXIS - 16, label: `${over}, ${xUnit}` },
          props.height ? { space: LOW_SPACE } : {},
        ),
        series: [
          {},
          ...props.curves.map((one, index) => {
            const { color, dash } = look(one.look ?? index);
            return {
              label: one.label,
              stroke: color,
              dash,
              width: 1.5,
              spanGaps: !props.gaps && props.curves.length > 1,
              points: { show: false },
              paths: paint.path,
            };
          }),
        ],
        hooks: {
          drawSeries: [paint.curve],
          draw: [
            (u) => paint.mark(u, latest.current.marks ?? []),
            (u) => paint.flag(u, latest.current.events ?? []),
            (u) => paint.upright(u, latest.current.cursors ?? []),
          ],
          setCursor: [
            (u) => title.current && tell(u, title.current, latest.current),
            (u) => typeof u.cursor.idx === "number" && latest.current.onHover?.(u.data[0][u.cursor.idx]!),
          ],
          drawClear: [
            (u) => paint.shade(u, latest.current.shades ?? []),
            (u) => paint.fill(u, latest.current.bands ?? [], latest.current.size),
          ],
          setSelect: [
            (u) => {
              if (!latest.current.onZoom || u.select.width <= 2) return;
              const [from, to] = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
              u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
              latest.current.onZoom(from, to);
            },
          ],
        },
      },
      data,
      at,
    );
    plot.current = made;
    let pressed = 0;
    made.over.addEventListener("mousedown", (event) => (pressed = event.clientX));
    made.over.addEventListener(
      "click",
      (event) => Math.abs(event.clientX - pressed) < 3 && latest.current.onPick?.(made.posToVal(event.offsetX, "x")),
    );
    made.over.addEventListener("dblclick", () => latest.current.onReset?.());
    const seen = new ResizeObserver(
      () => at.clientWidth !== made.width && made.setSize({ width: at.clientWidth, height }),
    );
    seen.observe(at);
    return () => {
      seen.disconnect();
      made.destroy();
      plot.current = null;
    };
  }, [shape]);

  useLayoutEffect(() => {
    plot.current?.setData(data);
  }, [data, props.shades, props.bands, props.marks, props.range?.join()]);
  useLayoutEffect(() => plot.current?.redraw(false, false), [props.cursors?.join(), props.events]);

  const saved = (): Saved => ({
    title: props.title,
    x: `${over}, ${xUnit}`,
    y: props.unit || "1",
    legend: props.curves.map(({ label, look: own }, k) => ({ label, look: own ?? k })),
    u: plot.current!,
    extreme: props.extreme,
  });
  return (
    <figure class="plot" data-plot={props.title}>
      <figcaption ref={title}>
        <span class="title">{props.unit ? `${props.title}, ${pretty(props.unit)}` : props.title}</span>
        <span class="value" data-value="time" />
        <Legend curves={props.curves} />
        {props.onReset && <Button class="link" act={props.onReset} words="Reset zoom" />}
        <More of={props} saved={saved} />
      </figcaption>
      <div ref={place} aria-hidden="true" />
    </figure>
  );
}

/** Name and line of each curve, and its value under the pointer. A single curve is named by the title. */
function Legend({ curves }: { curves: Curve[] }) {
  const isOne = curves.length === 1;
  return (
    <ul class="legend">
      {curves.map(({ label, look: own }, index) => (
        <li key={label}>
          <span class={isOne ? "hidden swatch" : "swatch"} style={{ background: swatch(own ?? index) }} />{" "}
          <span class={isOne ? "hidden" : "name"}>{label}</span> <span class="value" />
        </li>
      ))}
    </ul>
  );
}

/** Menu of a plot: save it, or read its values. */
function More({ of, saved }: { of: PlotProps; saved: () => Saved }) {
  const [open, setOpen] = useState(false);
  const { title, extreme, samples } = of;
  return (
    <details class="more" onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary aria-label={`${title}: save, values as a table`}>⋯</summary>
      {open && (
        <div class="menu">
          <p class="row">
            Save as <Button act={() => savePng(saved())}>PNG</Button>
            <Button act={() => import("./plotsvg").then(({ saveSvg }) => saveSvg(saved()))}>SVG</Button>
            <Button act={() => saveCsv(saved())}>{extreme ? "CSV of lowest and highest" : "CSV"}</Button>
            {extreme && samples && (
              <Button act={() => samples().then((all) => saveSamples(saved(), all))}>CSV of all samples</Button>
            )}
          </p>
          <Values {...of} />
        </div>
      )}
    </details>
  );
}

/** Show the time under the pointer, and the value of each curve there, in the title line. */
function tell(u: uPlot, title: HTMLElement, { curves, size }: PlotProps): void {
  const row = u.cursor.idx;
  const time = typeof row === "number" && (u.cursor.left ?? -1) >= 0 ? u.data[0][row] : undefined;
  title.querySelectorAll(".value").forEach((place, k) => {
    const one = curves[k - 1];
    if (time === undefined) place.textContent = "";
    else place.textContent = one ? digits(valueAt(one, time) / size) : `${instant(time, stepOf(curves[0]?.x))} `;
  });
}

function Values({ curves, size, unit, xUnit, title, extreme }: PlotProps) {
  const first = curves[0];
  if (!first) return <p>No curve.</p>;
  const at = Array.from({ length: ROWS }, (_, row) => Math.round(((first.x.length - 1) * row) / (ROWS - 1)));
  const over = xUnit === "samples" ? "sample" : `${xUnit === "Hz" ? "frequency" : "time"}, ${xUnit ?? "s"}`;
  const value = (curve: Curve, index: number) =>
    curve.x === first.x ? (curve.at ?? curve.y)[index]! : valueAt(curve, first.x[index]!);
  return (
    <>
      {extreme && (
        <p class="note">Each value is the lowest or the highest of a pixel. The CSV of all samples has every value.</p>
      )}
      <Table
        label={`Table of ${title}`}
        heads={[over, ...curves.map(({ label }) => `${label}, ${unit}`)]}
        rows={at.map((index) => [
          instant(first.x[index], stepOf(first.x)),
          ...curves.map((curve) => digits(value(curve, index) / size, 6)),
        ])}
      />
    </>
  );
}
