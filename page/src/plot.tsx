/** One plot over time. Only this file uses uPlot. */
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import "./language"; // before uPlot, which reads it
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import type { Numbers } from "./frame";
import { digits, instant, isDark, look } from "./looks";

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

/** Shaded time span: a stroke. */
export interface Shade {
  from: number;
  to: number;
  strong: boolean;
}

/** Marked place below the curves: a fault of a recording. */
export interface Mark {
  from: number;
  to: number;
}

export interface PlotProps {
  title: string;
  unit: string;
  xUnit?: string;
  size: number; // of the unit, in SI
  curves: Curve[];
  height?: number;
  onZoom?: (from: number, to: number) => void;
  range?: [number, number];
  shades?: Shade[];
  bands?: Band[];
  gaps?: boolean; // values that are no number are gaps, also beside another curve
  marks?: Mark[];
  cursors?: number[]; // times of upright lines, the first one solid, the second one dashed
  onHover?: (time: number) => void; // of the value that is pointed at
  onPick?: (time: number) => void; // a click that is no drag
  log?: boolean; // both axes logarithmic: a spectrum
  extreme?: boolean; // values are the lowest and the highest of each pixel, in turn
}

/** Band of many runs, shaded behind the curves. */
export interface Band {
  x: ArrayLike<number>;
  low: ArrayLike<number>;
  high: ArrayLike<number>;
  look: number;
}

const ROWS = 11;

function scaled(values: ArrayLike<number>, size: number): ArrayLike<number> {
  if (size === 1) return values;
  const out = new Float64Array(values.length);
  for (let i = 0; i < values.length; i++) out[i] = (values[i] as number) / size;
  return out;
}

/** Return numbers of an axis as the page writes all others, independent of the browser's language. */
const written = (_: uPlot, splits: (number | null)[]): string[] => splits.map((one) => (one === null ? "" : digits(one, 12)));

/** Return the room for numbers of an axis, pixels. Numbers of a short span far from zero are long. */
function space(_: uPlot, _axis: number, low: number, high: number): number {
  const decimals = Math.max(0, Math.ceil(-Math.log10((high - low) / 10)));
  return Math.max(70, 20 + 7 * Math.max(Math.abs(low), Math.abs(high)).toFixed(Math.min(decimals, 12)).length);
}

/** Return the values with null instead of NaN, because uPlot draws a line across NaN. */
function withGaps(values: ArrayLike<number>): ArrayLike<number | null> {
  for (let i = 0; i < values.length; i++) if (Number.isNaN(values[i])) return Array.from(values, (one) => (Number.isNaN(one) ? null : one));
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

/** Return the line of a look as the background of its mark in the legend. */
function marker(index: number): string {
  const { color, dash } = look(index);
  let at = 0;
  const stops = dash.map((one, k) => `${k % 2 ? "transparent" : color} ${at}px ${(at += one)}px`);
  return `repeating-linear-gradient(90deg, ${stops.join(", ") || `${color}, ${color}`})`;
}

/** Return whether the curves have the same numbers and names. Then nothing is drawn again. */
function alike(some: Curve[], others: Curve[]): boolean {
  return some.length === others.length && some.every((one, i) => one.x === others[i]!.x && one.y === others[i]!.y && one.label === others[i]!.label);
}

export function Plot(props: PlotProps) {
  const place = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const latest = useRef(props);
  latest.current = props;
  const [open, setOpen] = useState(false);
  const shape = props.curves.map((one) => one.label).join("|") + props.unit + (isDark() ? "d" : "l");
  const held = useRef({ curves: props.curves, size: 0, data: [[]] as uPlot.AlignedData });
  if (held.current.size !== props.size || !alike(held.current.curves, props.curves))
    held.current = { curves: props.curves, size: props.size, data: aligned(props.curves, props.size) };
  const { data } = held.current;

  /* Layout effects: an effect would run after the next frame, and the curves would come one frame late. */
  useLayoutEffect(() => {
    const at = place.current!;
    const ink = isDark() ? "#d8d8d8" : "#333333";
    const axis = { values: written, stroke: ink, grid: { stroke: isDark() ? "#3a3a3a" : "#e2e2e2", width: 1 }, ticks: { show: false }, font: "12px system-ui" };
    const made = new uPlot(
      {
        width: at.clientWidth || 400,
        height: props.height ?? 210,
        cursor: { ...(!props.log && { sync: { key: "time" } }), drag: { x: true, y: false, setScale: !props.onZoom } },
        scales: {
          x: { time: false, ...(props.log && { distr: 3 }), ...(props.range && { range: () => latest.current.range! }) },
          y: props.log ? { distr: 3 } : { range: (_, low, high) => (low === null ? [low, high] : uPlot.rangeNum(...within(latest.current, low, high), 0.1, true)) },
        },
        legend: { live: true, markers: { width: 0, fill: (_, index) => marker(latest.current.curves[index - 1]?.look ?? index - 1) } },
        axes: [
          { ...axis, size: 34, space, label: props.xUnit ?? "s", labelSize: 16, labelFont: "12px system-ui" },
          { ...axis, size: 64, label: props.unit, labelSize: 16, labelFont: "12px system-ui" },
        ],
        series: [
          { label: `${props.log ? "frequency" : "time"}, ${props.xUnit ?? "s"}`, value: (_, v) => instant(v ?? undefined, stepOf(latest.current.curves[0]?.x)) },
          ...props.curves.map((one, index) => {
            const { color, dash } = look(one.look ?? index);
            return { label: one.label, stroke: color, dash, width: 1.4, spanGaps: !props.gaps && props.curves.length > 1, points: { show: false }, paths: path, value: (u: uPlot, v: number | null, _: number, row: number | null) => digits(read(latest.current, u, index, row) ?? v) };
          }),
        ],
        hooks: {
          drawSeries: [curve],
          draw: [(u) => mark(u, latest.current.marks ?? []), (u) => upright(u, latest.current.cursors ?? [])],
          setCursor: [(u) => typeof u.cursor.idx === "number" && latest.current.onHover?.(u.data[0][u.cursor.idx]!)],
          drawClear: [(u) => shade(u, latest.current.shades ?? []), (u) => fill(u, latest.current.bands ?? [], latest.current.size)],
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
    made.over.addEventListener("click", (event) => Math.abs(event.clientX - pressed) < 3 && latest.current.onPick?.(made.posToVal(event.offsetX, "x")));
    const seen = new ResizeObserver(() => at.clientWidth !== made.width && made.setSize({ width: at.clientWidth, height: props.height ?? 210 }));
    seen.observe(at);
    return () => {
      seen.disconnect();
      made.destroy();
      plot.current = null;
    };
  }, [shape]);

  useLayoutEffect(() => {
    plot.current?.setData(data);
  }, [data, props.shades, props.bands, props.marks]);
  useLayoutEffect(() => plot.current?.redraw(false, false), [props.cursors?.join()]);

  const label = props.unit ? `${props.title}, ${props.unit}` : props.title;
  return (
    <figure class="plot" data-plot={props.title}>
      <figcaption>{label}</figcaption>
      <div ref={place} aria-hidden="true" />
      <details onToggle={(event) => setOpen((event.currentTarget as HTMLDetailsElement).open)}>
        <summary>{props.title}: values as a table</summary>
        {open && <Values {...props} />}
      </details>
    </figure>
  );
}

/** Return the value at the pointer. The drawn value is the lowest or highest of its pixel column. */
function read({ curves, size }: PlotProps, u: uPlot, index: number, row: number | null): number | undefined {
  const one = curves[index];
  return one?.at && row !== null ? valueAt(one, u.data[0][row]!) / size : undefined;
}

/**
 * Return whether a curve reverses more often than every fourth pixel. Such a curve is drawn as `columns`: a stroke
 * is smoother but slow.
 */
function isDense(u: uPlot, series: number): boolean {
  const [from, to] = [u.valToIdx(u.scales["x"]!.min!), u.valToIdx(u.scales["x"]!.max!)];
  if (to - from < u.bbox.width) return false;
  const y = u.data[series] as ArrayLike<number | null | undefined>;
  let [turns, before, last] = [0, 0, y[from]];
  for (let i = from + 1; i <= to; i++) {
    const now = y[i];
    if (now === undefined || now === null) continue; // a time of another curve, or a gap
    const step = now - (last ?? now);
    if (step * before < 0) turns += 1;
    if (step) before = step;
    last = now;
  }
  return turns > u.bbox.width / 4;
}

/** Return whether a pixel column is on a stroke of a dash, not in a gap. */
export function isInDash(column: number, dash: number[]): boolean {
  let at = column % dash.reduce((sum, one) => sum + one, 0);
  return !dash.length || dash.findIndex((one) => (at -= one) < 0) % 2 === 0;
}

/**
 * Paths of uPlot, only for logarithmic axes. Paths kept after each drawing would cost some ms of garbage collection
 * while a slider moves.
 */
const path: uPlot.Series.PathBuilder = (u, series, from, to) => (u.scales["x"]!.distr === 3 ? uPlot.paths.linear!()(u, series, from, to) : null);

/** Return the values of a curve and its scale in pixels of linear axes. */
function placed(u: uPlot, series: number) {
  const { min: first, max: last } = u.scales["x"]!;
  const { min: least, max: most } = u.scales["y"]!;
  const [perX, perY] = [u.bbox.width / (last! - first!), u.bbox.height / (most! - least!)];
  return { x: u.data[0], y: u.data[series] as ArrayLike<number | null | undefined>, ...u.bbox, first: first!, most: most!, perX, perY };
}

function curve(u: uPlot, series: number): void {
  if (u.scales["x"]!.distr === 3) return;
  if (isDense(u, series)) columns(u, series);
  else lines(u, series);
}

const DOT = 1.5; // radius of a value between two gaps, pixels

/** Draw straight lines between values. A column of pixels keeps only its first, lowest, highest and last value. */
export function lines(u: uPlot, series: number): void {
  const { x, y, left, top, width, height, first, most, perX, perY } = placed(u, series);
  const { ctx } = u;
  const own = u.series[series]!;
  const within = u.series[0]!.idxs;
  if (!within || perX !== perX || perY !== perY) return;
  let [from, to] = within;
  do from -= 1;
  while (from > 0 && y[from] === undefined); // to the value before the view, so that its line comes in
  do to += 1;
  while (to < x.length - 1 && y[to] === undefined);
  ctx.save();
  ctx.beginPath();
  ctx.rect(left, top, width, height);
  ctx.clip();
  ctx.beginPath();
  let [column, low, high, begun, endX, endY, isOne] = [Number.NaN, 0, 0, 0, 0, 0, true];
  const leave = () => {
    if (low < Math.min(begun, endY)) ctx.lineTo(endX, low);
    if (high > Math.max(begun, endY)) ctx.lineTo(endX, high);
    if (!isOne) ctx.lineTo(endX, endY);
    [column, isOne] = [Number.NaN, true];
  };
  let [isDown, isAlone] = [false, false];
  /** End a line before a gap. A single value between two gaps becomes a dot, because it has no line. */
  const end = () => {
    leave();
    if (isDown && isAlone && low === high) ctx.arc(endX, endY, DOT * devicePixelRatio, 0, 2 * Math.PI);
    isDown = false;
  };
  for (let i = Math.max(from, 0); i <= Math.min(to, x.length - 1); i++) {
    const value = y[i];
    if (value === undefined || (value === null && own.spanGaps)) continue;
    if (value === null) {
      end();
      continue;
    }
    const [atX, atY] = [left + (x[i]! - first) * perX, top + (most - value) * perY];
    if (Math.floor(atX) === column) {
      isOne = false;
      if (atY < low) low = atY;
      if (atY > high) high = atY;
    } else {
      leave();
      isAlone = !isDown;
      if (isDown) ctx.lineTo(atX, atY);
      else ctx.moveTo(atX, atY);
      isDown = true;
      column = Math.floor(atX);
      low = high = begun = atY;
    }
    [endX, endY] = [atX, atY];
  }
  end();
  ctx.strokeStyle = (own.stroke as () => string)();
  ctx.lineWidth = own.width! * devicePixelRatio;
  ctx.lineJoin = "round";
  ctx.setLineDash((own.dash ?? []).map((one) => one * devicePixelRatio));
  ctx.stroke();
  ctx.restore();
}

/**
 * Draw a curve of many values as one bar in each column of pixels, from the lowest to the highest point of its line.
 * This looks like a stroke and takes 1/50 of its time. NaN is a gap.
 */
function columns(u: uPlot, series: number): void {
  const { x, y, left, top, width, height, first, most, perX, perY } = placed(u, series);
  const half = (u.series[series]!.width! * devicePixelRatio) / 2;
  const low = new Float64Array(width).fill(Infinity);
  const high = new Float64Array(width).fill(-Infinity);
  const put = (column: number, at: number) => {
    if (column < 0 || column >= width) return;
    if (at < low[column]!) low[column] = at;
    if (at > high[column]!) high[column] = at;
  };
  let [column, at] = [Number.NaN, Number.NaN];
  for (let i = 0; i < x.length; i++) {
    if (y[i] === undefined) continue; // a time of another curve
    const [next, to] = [Math.floor((x[i]! - first) * perX), (most - (y[i] ?? Number.NaN)) * perY];
    if (to === to) put(next, to);
    /* Half of the line from the previous value belongs to the previous column, half to this column. */
    if (to === to && at === at && next !== column) {
      const step = (to - at) / (next - column);
      for (let k = Math.max(column, -1); k < Math.min(next, width); k++) {
        const middle = at + step * (k + 0.5 - column);
        put(k, middle);
        put(k + 1, middle);
      }
    }
    [column, at] = [next, to];
  }
  u.ctx.save();
  u.ctx.fillStyle = (u.series[series]!.stroke as () => string)();
  const dash = (u.series[series]!.dash ?? []).map((one) => one * devicePixelRatio);
  for (let k = 0; k < width; k++) {
    const [from, to] = [Math.max(low[k]! - half, 0), Math.min(high[k]! + half, height)];
    u.ctx.globalAlpha = isInDash(k, dash) ? 1 : 0.4; // a gap of the dash is pale: no value is left out
    if (to > from) u.ctx.fillRect(left + k, top + from, 1, to - from);
  }
  u.ctx.restore();
}

/** Shade the time spans below the curves. If they are many and too thin to see, draw no shading. */
function shade(u: uPlot, parts: Shade[]): void {
  const { left, top, width, height } = u.bbox;
  const [low, high] = [u.scales["x"]!.min!, u.scales["x"]!.max!];
  const seen = parts.filter((one) => one.to >= low && one.from <= high);
  if (seen.length > width / 4) return;
  u.ctx.save();
  for (const one of seen) {
    const from = Math.max(u.valToPos(one.from, "x", true), left);
    const to = Math.min(u.valToPos(one.to, "x", true), left + width);
    u.ctx.fillStyle = isDark() ? (one.strong ? "#39424d" : "#262c34") : one.strong ? "#d8e0ea" : "#eef2f6";
    u.ctx.fillRect(from, top, to - from, height);
  }
  u.ctx.restore();
}

/** Mark places by a bar at the foot of the plot, at least three pixels wide. */
function mark(u: uPlot, places: Mark[]): void {
  const { left, top, width, height } = u.bbox;
  const [low, high] = [u.scales["x"]!.min!, u.scales["x"]!.max!];
  const [tall, thin] = [7 * devicePixelRatio, 3 * devicePixelRatio];
  u.ctx.save();
  u.ctx.fillStyle = isDark() ? "#ffc27a" : "#a34a00";
  for (const one of places) {
    if (one.to < low || one.from > high) continue;
    const from = Math.max(u.valToPos(one.from, "x", true), left);
    const to = Math.min(u.valToPos(one.to, "x", true), left + width);
    u.ctx.fillRect(Math.min(from, left + width - thin), top + height - tall, Math.max(to - from, thin), tall);
  }
  u.ctx.restore();
}

/** Draw vertical lines with their numbers. */
function upright(u: uPlot, times: number[]): void {
  const { left, top, width, height } = u.bbox;
  u.ctx.save();
  u.ctx.strokeStyle = u.ctx.fillStyle = isDark() ? "#ff9d9d" : "#9b1c1c";
  u.ctx.lineWidth = devicePixelRatio;
  u.ctx.font = `${12 * devicePixelRatio}px system-ui`;
  times.forEach((time, index) => {
    const at = u.valToPos(time, "x", true);
    if (at < left || at > left + width) return;
    u.ctx.setLineDash(index ? [5 * devicePixelRatio, 4 * devicePixelRatio] : []);
    u.ctx.beginPath();
    u.ctx.moveTo(at, top);
    u.ctx.lineTo(at, top + height);
    u.ctx.stroke();
    if (times.length > 1) u.ctx.fillText(String(index + 1), at + 4 * devicePixelRatio, top + 12 * devicePixelRatio);
  });
  u.ctx.restore();
}

/** Return the limits of the values and bands. */
function within({ bands, size }: PlotProps, low: number, high: number): [number, number] {
  let [least, most] = [low, high];
  for (const one of bands ?? [])
    for (let i = 0; i < one.x.length; i++) {
      least = Math.min(least, one.low[i]! / size);
      most = Math.max(most, one.high[i]! / size);
    }
  return [least, most];
}

function fill(u: uPlot, bands: Band[], size: number): void {
  u.ctx.save();
  u.ctx.beginPath();
  u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
  u.ctx.clip();
  for (const one of bands) {
    u.ctx.beginPath();
    const at = (i: number, values: ArrayLike<number>) => u.ctx.lineTo(u.valToPos(one.x[i]!, "x", true), u.valToPos(values[i]! / size, "y", true));
    for (let i = 0; i < one.x.length; i++) at(i, one.high);
    for (let i = one.x.length - 1; i >= 0; i--) at(i, one.low);
    u.ctx.fillStyle = `${look(one.look).color}33`;
    u.ctx.fill();
  }
  u.ctx.restore();
}

function Values({ curves, size, unit, xUnit, title, extreme }: PlotProps) {
  const first = curves[0];
  if (!first) return <p>No curve.</p>;
  const at = Array.from({ length: ROWS }, (_, row) => Math.round(((first.x.length - 1) * row) / (ROWS - 1)));
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={`Table of ${title}`}>
      {extreme && <p class="note">Each value is the lowest or the highest of a pixel; a closer view has the samples.</p>}
      <table>
        <thead>
          <tr>
            <th scope="col">{xUnit === "samples" ? "sample" : `${xUnit === "Hz" ? "frequency" : "time"}, ${xUnit ?? "s"}`}</th>
            {curves.map((one) => (
              <th scope="col" key={one.label}>
                {one.label}, {unit}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {at.map((index) => (
            <tr key={index}>
              <th scope="row">{instant(first.x[index], stepOf(first.x))}</th>
              {curves.map((one) => (
                <td key={one.label}>{digits((one.x === first.x ? (one.at ?? one.y)[index]! : valueAt(one, first.x[index]!)) / size, 6)}</td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

/** Points with their spread, and the curve and band that belong to them. */
export interface Group {
  label: string;
  points: { x: number; y: number; spread: number | null }[];
  curve?: { x: number[]; y: number[]; low: number[]; high: number[]; measured: [number, number] };
}

const MOST_BARS = 400; // spreads beyond which bars would cover the points

/** Plot of friction over speed: points, and curves with bands. A curve is dotted beyond the measured speeds. */
export function Scatter(props: { title: string; x: string; y: string; groups: Group[]; log: boolean }) {
  const place = useRef<HTMLDivElement>(null);
  const latest = useRef(props);
  latest.current = props;
  useEffect(() => {
    const at = place.current!;
    const ink = isDark() ? "#d8d8d8" : "#333333";
    const axis = { values: written, stroke: ink, grid: { stroke: isDark() ? "#3a3a3a" : "#e2e2e2", width: 1 }, ticks: { show: false }, font: "12px system-ui" };
    const tables: uPlot.AlignedData[] = [];
    const series: uPlot.Series[] = [{ label: props.x, value: (_, v) => digits(v) }];
    const bands: uPlot.Band[] = [];
    props.groups.forEach((group, index) => {
      const { color, dash } = look(index);
      const ordered = [...group.points].sort((a, b) => a.x - b.x);
      tables.push([ordered.map((one) => one.x), ordered.map((one) => one.y)]);
      series.push({ label: group.label, stroke: color, paths: () => null, points: { show: true, size: 7, fill: color }, value: (_, v) => digits(v) });
      if (!group.curve) return;
      const { x, y, low, high, measured } = group.curve;
      const inside = x.map((one) => one >= measured[0] * (1 - 1e-9) && one <= measured[1] * (1 + 1e-9));
      const quiet = { stroke: "transparent", width: 0, points: { show: false }, spanGaps: true } as const;
      tables.push([x, high, low, y.map((one, i) => (inside[i] ? one : null)), y] as unknown as uPlot.AlignedData);
      series.push({ ...quiet, label: `${group.label}, upper` }, { ...quiet, label: `${group.label}, lower` });
      series.push({ ...quiet, label: `${group.label}, fit`, stroke: color, dash, width: 1.6, spanGaps: true });
      series.push({ ...quiet, label: `${group.label}, extrapolated`, stroke: color, dash: [1, 4], width: 1.2 });
      const last = series.length;
      bands.push({ series: [last - 4, last - 3], fill: `${color}22` });
    });
    const made = new uPlot(
      {
        width: at.clientWidth || 600,
        height: 380,
        scales: { x: { time: false, distr: props.log ? 3 : 1 }, y: { range: (_, low, high) => reached(latest.current.groups, low, high) } },
        cursor: { drag: { x: true, y: true } },
        legend: { show: false },
        axes: [
          { ...axis, size: 40, label: props.x, labelSize: 18, labelFont: "12px system-ui" },
          { ...axis, size: 64, label: props.y, labelSize: 18, labelFont: "12px system-ui" },
        ],
        series,
        bands,
        hooks: { draw: [(u) => bars(u, latest.current.groups)] },
      },
      uPlot.join(tables),
      at,
    );
    const seen = new ResizeObserver(() => made.setSize({ width: at.clientWidth, height: 380 }));
    seen.observe(at);
    return () => {
      seen.disconnect();
      made.destroy();
    };
  }, [props.groups, props.log, isDark()]);
  return (
    <figure class="plot" data-plot={props.title}>
      <figcaption>{props.title}</figcaption>
      <div ref={place} aria-hidden="true" />
      <ul class="legend">
        {props.groups.map((group, index) => (
          <li key={group.label}>
            <svg viewBox="0 0 40 10" width="40" height="10" aria-hidden="true">
              <line x1="0" y1="5" x2="40" y2="5" stroke={look(index).color} stroke-width="2" stroke-dasharray={look(index).dash.join(" ")} />
              <circle cx="20" cy="5" r="3.5" fill={look(index).color} />
            </svg>{" "}
            {group.label}
          </li>
        ))}
      </ul>
    </figure>
  );
}

/** Return the limits of the axis: from zero, or from below the lowest bar, to above the highest bar. */
export function reached(groups: Group[], low: number, high: number): [number, number] {
  const ends = groups.flatMap((group) => group.points.flatMap((one) => [one.y - (one.spread ?? 0), one.y + (one.spread ?? 0)]));
  const [least, most] = [Math.min(low, 0, ...ends), Math.max(high, 0, ...ends)];
  const room = 0.08 * (most - least || 1);
  return [least < 0 ? least - room : 0, most > 0 ? most + room : 0];
}

function bars(u: uPlot, groups: Group[]): void {
  const points = groups.flatMap((group, index) => group.points.map((one) => ({ ...one, color: look(index).color })));
  if (points.length > MOST_BARS) return;
  u.ctx.save();
  u.ctx.lineWidth = devicePixelRatio;
  u.ctx.setLineDash([]);
  for (const { x, y, spread, color } of points) {
    if (spread === null) continue;
    const at = u.valToPos(x, "x", true);
    u.ctx.strokeStyle = color;
    u.ctx.beginPath();
    u.ctx.moveTo(at, u.valToPos(y - spread, "y", true));
    u.ctx.lineTo(at, u.valToPos(y + spread, "y", true));
    u.ctx.stroke();
  }
  u.ctx.restore();
}
