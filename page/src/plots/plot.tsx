/** One plot over time: with `paint.ts` and the two that save it the only files that touch uPlot. */

import { type Signal, useSignal } from "@preact/signals";
import { useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import "../drive/language"; // before uPlot, which reads it
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import "./plot.css";
import type { Frame, Numbers } from "../server/frame";
import type { RunPanel } from "../server/generated";
import { Button, Table } from "../workspace/fields";
import { digits, instant, isDark, look, pretty, token } from "./looks";
import * as paint from "./paint";
import { type Saved, saveCsv, saveSamples } from "./saving";
import { endsOf } from "./scale";
import { useWidth } from "./width";

export interface Curve {
  label: string;
  x: ArrayLike<number>;
  y: ArrayLike<number>;
  at?: ArrayLike<number>; // values at the times, where those of y are the lowest and the highest of each pixel
  look?: number; // its look; absent: its place
}

type Arrays = Pick<Frame<unknown>, "arrays">;

/** Return a column of an answer as a curve. */
export function curveOf(arrays: Map<string, Numbers>, x: Numbers, column: string, label: string): Curve {
  return { label, x, y: arrays.get(column)!, at: arrays.get(`${column}/at`) };
}

/** Return the curves of a panel, as far as a run has them. Another run has a name, and a prefix of its columns. */
export function curvesOf({ arrays }: Arrays, { curves }: RunPanel, name = "", prefix = ""): Curve[] {
  const time = arrays.get(`${prefix}time_s`)!;
  const own = curves.filter(({ column }) => arrays.has(prefix + column));
  return own.map(({ column, label }) => curveOf(arrays, time, prefix + column, name ? `${label} (${name})` : label));
}

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
const stepOf = (x: ArrayLike<number> = []): number => (x[x.length - 1]! - x[0]!) / (x.length - 1);

export interface PlotProps {
  title: string;
  unit: string;
  xUnit?: "s" | "samples" | "Hz"; // over frequency both axes are logarithmic: a spectrum
  size: number; // of the unit, in SI
  curves: Curve[];
  height?: number; // of the area of the curves
  bare?: boolean; // without the axis of time: a plot below has it
  onZoom?: (from: number, to: number) => void;
  onReset?: () => void; // present while a part of the time is shown
  range?: [number, number];
  shades?: paint.Shade[];
  bands?: paint.Band[];
  marks?: paint.Mark[];
  events?: number[]; // times with a mark above the curves
  cursors?: number[]; // times of upright lines, the first one solid, the second one dashed
  onHover?: (time: number) => void; // of the value that is pointed at
  onPick?: (time: number) => void; // a click that is no drag
  extreme?: boolean; // values are the lowest and the highest of each pixel, in turn
  samples?: (save: (all: Map<string, Numbers>) => void) => unknown; // all values of the shown part, "time" first
}

const ROWS = 11;

/** Return values in a unit, with null instead of NaN, because uPlot draws a line across NaN. */
function inUnit(values: ArrayLike<number>, size: number): ArrayLike<number | null> {
  const out = new Float64Array(values.length);
  let hasGap = false;
  for (let i = 0; i < values.length; i++) {
    out[i] = values[i]! / size;
    hasGap ||= Number.isNaN(out[i]);
  }
  return hasGap ? Array.from(out, (one) => (Number.isNaN(one) ? null : one)) : out;
}

/** Return numbers of an axis as the page writes all others, independent of the browser's language. */
const written = (_: uPlot, splits: (number | null)[]): string[] =>
  splits.map((one) => (one === null ? "" : digits(one, 12)));

/** Return the room for numbers of an axis, pixels. Numbers of a short span far from zero are long. */
function space(_: uPlot, _axis: number, low: number, high: number): number {
  const decimals = Math.max(0, Math.ceil(-Math.log10((high - low) / 10)));
  return Math.max(70, 20 + 7 * Math.max(Math.abs(low), Math.abs(high)).toFixed(Math.min(decimals, 12)).length);
}

function aligned(curves: Curve[], size: number): uPlot.AlignedData {
  const same = curves.every((one) => one.x === curves[0]?.x);
  const tables = curves.map((one) => [one.x, inUnit(one.y, size)] as unknown as uPlot.AlignedData);
  if (!curves.length) return [[]] as unknown as uPlot.AlignedData;
  if (same) return [curves[0]!.x, ...tables.map((one) => one[1])] as unknown as uPlot.AlignedData;
  return uPlot.join(tables);
}

/**
 * Return the number of pixel columns of the page's plots. Each column receives its own lowest and highest value.
 * Without a plot, `otherwise` is its width.
 */
export function pixelsOfPlots(otherwise = 1000): number {
  const width = document.querySelector("main .u-over")?.clientWidth || otherwise;
  return Math.min(Math.max(Math.round(width * devicePixelRatio), 200), 4000);
}

/** Plots that show the same part of the time. */
export const zooming = (shown: Signal<[number, number] | null>): Pick<PlotProps, "range" | "onZoom" | "onReset"> => ({
  onZoom: (from, to) => (shown.value = [from, to]),
  ...(shown.value && { range: shown.value, onReset: () => (shown.value = null) }),
});

/** The line of a look, for a legend. */
export function LineSample({ index }: { index: number }) {
  const { color, dash } = look(index);
  return (
    <svg width="32" height="8" aria-hidden="true">
      <path d="M0 4H32" stroke={color} stroke-width="2" stroke-dasharray={dash.join(" ")} />
    </svg>
  );
}

const BARE = { size: 0, values: () => [] }; // an axis of time that a plot below has
const AXIS = 34; // height of the axis of time with its label
const HEIGHT = 200; // of the area of the curves
const EDGE = 8; // above and below it
const LOW_SPACE = 16; // between numbers of a low plot

/** Look of both axes of a plot, in the colours of the paper. */
const axisLook = (font = "12px system-ui"): uPlot.Axis => ({
  values: written,
  stroke: token("axis"),
  grid: { stroke: token("grid"), width: 1 },
  ticks: { show: false },
  font,
  labelFont: font,
  labelSize: 16,
});

const FLAT = 1e-9; // of a unit: a curve that varies less is drawn as a straight line

/** The ends of an axis of values, with some room. */
const reach = (low: number, high: number): [number, number] =>
  high - low < FLAT && Math.abs(high) < FLAT ? [-1, 1] : (uPlot.rangeNum(low, high, 0.1, true) as [number, number]);

/** The label of the axis below a plot. */
const abscissaOf = ({ xUnit = "s" }: PlotProps): string =>
  xUnit === "samples" ? "sample" : `${xUnit === "Hz" ? "frequency" : "time"}, ${xUnit}`;

export function Plot(props: PlotProps) {
  const [place, width] = useWidth<HTMLDivElement>();
  const pointed = useSignal<number | undefined>(undefined); // time or frequency under the pointer
  const plot = useRef<uPlot | null>(null);
  const latest = useRef(props);
  latest.current = props;
  const shape =
    props.curves.map((one) => one.label).join("|") + props.unit + Boolean(props.bare) + (isDark() ? "d" : "l");
  /* Nothing is drawn again while the curves have the same numbers and names. */
  const numbers = props.curves.flatMap(({ x, y, label }) => [x, y, label]);
  const data = useMemo(() => aligned(props.curves, props.size), [props.size, ...numbers]);
  const height = (props.height ?? HEIGHT) + (props.bare ? EDGE : AXIS) + EDGE;
  const isLog = props.xUnit === "Hz";

  /* Layout effects: an effect would run after the next frame, and the curves would come one frame late. */
  useLayoutEffect(() => {
    const at = place.current!;
    const rangeX: uPlot.Range.Function = (_, low, high) => latest.current.range ?? [low, high];
    const rangeY: uPlot.Range.Function = (_, low, high) => {
      const { bands = [], size } = latest.current;
      const ends = bands.flatMap((band) => [...Array.from(band.low), ...Array.from(band.high)]);
      return low === null ? [low, high] : reach(...endsOf([low, high, ...ends.map((end) => end / size)]));
    };
    const made = new uPlot(
      {
        width: at.clientWidth || 400,
        height,
        padding: [EDGE, 12, props.bare ? EDGE : 0, 0],
        cursor: { ...(!isLog && { sync: { key: "time" } }), drag: { x: true, y: false, setScale: !props.onZoom } },
        scales: {
          x: { time: false, ...(isLog ? { distr: 3 } : { range: rangeX }) },
          y: isLog ? { distr: 3 } : { range: rangeY },
        },
        legend: { show: false },
        axes: [
          { ...axisLook(), space, ...(props.bare ? BARE : { size: AXIS - 16, label: abscissaOf(props) }) },
          { ...axisLook(), size: 62, ...(props.height && { space: LOW_SPACE }) },
        ],
        series: [
          {},
          ...props.curves.map((one, index) => {
            const { color, dash } = look(one.look ?? index);
            return {
              label: one.label,
              stroke: color,
              dash,
              width: 1.5,
              points: { show: false },
              ...(!isLog && { paths: () => null }), // `paint.curve` draws it
            };
          }),
        ],
        hooks: {
          drawSeries: isLog ? [] : [paint.save, paint.curve, paint.restore],
          draw: [
            paint.save,
            (u) => paint.mark(u, latest.current.marks ?? []),
            (u) => paint.upright(u, latest.current.cursors ?? []),
            (u) => paint.flag(u, latest.current.events ?? []),
            paint.restore,
          ],
          setCursor: [
            ({ cursor: { idx, left = -1 }, data: [x] }) => {
              const time = (pointed.value = typeof idx === "number" && left >= 0 ? x[idx] : undefined);
              if (time !== undefined) latest.current.onHover?.(time);
            },
          ],
          drawClear: [
            paint.save,
            (u) => paint.shade(u, latest.current.shades ?? []),
            (u) => paint.fill(u, latest.current.bands ?? [], latest.current.size),
            paint.restore,
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
    made.over.addEventListener("click", (event) => latest.current.onPick?.(made.posToVal(event.offsetX, "x")));
    made.over.addEventListener("dblclick", () => latest.current.onReset?.());
    return () => {
      made.destroy();
      plot.current = null;
    };
  }, [shape]);

  useLayoutEffect(() => {
    if (width && width !== plot.current?.width) plot.current?.setSize({ width, height });
  }, [width]);
  useLayoutEffect(() => {
    plot.current?.setData(data);
  }, [data, props.shades, props.bands, props.marks, props.range?.join()]);
  useLayoutEffect(() => plot.current?.redraw(false, false), [props.cursors?.join(), props.events]);

  return (
    <figure class="plot" data-plot={props.title}>
      <figcaption>
        <span class="title">{props.unit ? `${props.title}, ${pretty(props.unit)}` : props.title}</span>
        <Legend of={props} pointed={pointed} />
        {props.onReset && <Button class="link" act={props.onReset} words="Reset zoom" />}
        <More of={props} saved={() => ({ ...props, over: abscissaOf(props), u: plot.current! })} />
      </figcaption>
      <div ref={place} aria-hidden="true" />
    </figure>
  );
}

/** The time under the pointer, and name, line and value of each curve. A single curve is named by the title. */
function Legend({ of: { curves, size }, pointed }: { of: PlotProps; pointed: Signal<number | undefined> }) {
  const isOne = curves.length === 1;
  const time = pointed.value;
  return (
    <>
      <span class="value">{time !== undefined && instant(time, stepOf(curves[0]?.x))}</span>
      <ul class="legend">
        {curves.map((one, index) => (
          <li key={one.label}>
            {!isOne && <LineSample index={one.look ?? index} />}
            <span class={isOne ? "hidden" : "name"}>{one.label}</span>{" "}
            <span class="value">{time !== undefined && digits(valueAt(one, time) / size)}</span>
          </li>
        ))}
      </ul>
    </>
  );
}

/** Menu of a plot: save it, or read its values. */
function More({ of, saved }: { of: PlotProps; saved: () => Saved }) {
  const [open, setOpen] = useState(false);
  const { title, extreme, samples } = of;
  const drawn = (ending: "svg" | "png") => import("./figure").then(({ savePlot }) => savePlot(ending, saved()));
  return (
    <details class="more" onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary aria-label={`${title}: save, values as a table`}>⋯</summary>
      {open && (
        <div class="menu">
          <p class="row">
            Save as <Button act={() => drawn("png")}>PNG</Button>
            <Button act={() => drawn("svg")}>SVG</Button>
            <Button act={() => saveCsv(saved())}>{extreme ? "CSV of lowest and highest" : "CSV"}</Button>
            {extreme && samples && (
              <Button act={() => samples((all) => saveSamples(saved(), all))}>CSV of all samples</Button>
            )}
          </p>
          <Values {...of} />
        </div>
      )}
    </details>
  );
}

/** Values at some times from the first to the last one. */
function Values(props: PlotProps) {
  const { curves, size, unit, title, extreme } = props;
  const times = curves[0]?.x ?? [];
  const shown = Array.from({ length: ROWS }, (_, row) => times[Math.round(((times.length - 1) * row) / (ROWS - 1))]!);
  return (
    <>
      {extreme && (
        <p class="note">Each value is the lowest or the highest of a pixel. The CSV of all samples has every value.</p>
      )}
      <Table
        label={`Table of ${title}`}
        heads={[abscissaOf(props), ...curves.map(({ label }) => `${label}, ${unit}`)]}
        rows={shown.map((time) => [
          instant(time, stepOf(times)),
          ...curves.map((curve) => digits(valueAt(curve, time) / size, 6)),
        ])}
      />
    </>
  );
}
