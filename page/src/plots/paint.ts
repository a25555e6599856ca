/** Drawing of curves, bands, shades and marks on a plot. */
import "../drive/language"; // before uPlot, which reads it
import type uPlot from "uplot";
import { look, token } from "./looks";

/** Marked place below the curves: a fault of a recording. */
export interface Mark {
  from: number;
  to: number;
}

/** Shaded time span: a stroke, stronger towards +x. */
export interface Shade extends Mark {
  direction: number;
}

/** Band of many runs, shaded behind the curves. */
export interface Band {
  x: ArrayLike<number>;
  low: ArrayLike<number>;
  high: ArrayLike<number>;
  look: number;
}

/**
 * Return whether a curve reverses more often than every fourth pixel. Such a curve is drawn as `columns`: a stroke
 * is smoother but slow.
 */
function isDense(u: uPlot, series: number): boolean {
  const [from, to] = [u.valToIdx(u.scales.x!.min!), u.valToIdx(u.scales.x!.max!)];
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

/** Return the values of a curve and its scale in pixels of linear axes. */
function placed(u: uPlot, series: number) {
  const { min: first, max: last } = u.scales.x!;
  const { min: least, max: most } = u.scales.y!;
  const [perX, perY] = [u.bbox.width / (last! - first!), u.bbox.height / (most! - least!)];
  return {
    x: u.data[0],
    y: u.data[series] as ArrayLike<number | null | undefined>,
    ...u.bbox,
    first: first!,
    most: most!,
    perX,
    perY,
  };
}

/** Hooks of uPlot, called before and after this drawing. */
export const save = (u: uPlot): void => u.ctx.save();
export const restore = (u: uPlot): void => u.ctx.restore();

/** Draw only within the area of the curves. */
function clip({ ctx, bbox }: uPlot): void {
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
}

/**
 * Draw a curve on linear axes. Paths of uPlot, which are kept after each drawing, would cost some ms of garbage
 * collection while a slider moves.
 */
export function curve(u: uPlot, series: number): void {
  if (isDense(u, series)) columns(u, series);
  else lines(u, series);
}

const DOT = 1.5; // radius of a value between two gaps, pixels

/** Draw straight lines between values. A value that is alone in its column of pixels, between two gaps, becomes a dot. */
export function lines(u: uPlot, series: number): void {
  const { x, y, left, top, first, most, perX, perY } = placed(u, series);
  const { ctx } = u;
  const own = u.series[series]!;
  const within = u.series[0]!.idxs;
  if (!within || Number.isNaN(perX) || Number.isNaN(perY)) return;
  let [from, to] = within;
  do from -= 1;
  while (from > 0 && y[from] === undefined); // to the value before the view, so that its line comes in
  do to += 1;
  while (to < x.length - 1 && y[to] === undefined);
  clip(u);
  ctx.beginPath();
  let [isDown, isAlone, endX, endY] = [false, false, 0, 0];
  const end = () => {
    if (isDown && isAlone) ctx.arc(endX, endY, DOT * devicePixelRatio, 0, 2 * Math.PI);
    isDown = false;
  };
  for (let i = Math.max(from, 0); i <= Math.min(to, x.length - 1); i++) {
    const value = y[i];
    if (value === null) end();
    if (value === undefined || value === null) continue; // a time of another curve, or a gap
    const [atX, atY] = [left + (x[i]! - first) * perX, top + (most - value) * perY];
    if (isDown) ctx.lineTo(atX, atY);
    else ctx.moveTo(atX, atY);
    isAlone = !isDown || (isAlone && atY === endY && Math.floor(atX) === Math.floor(endX));
    [isDown, endX, endY] = [true, atX, atY];
  }
  end();
  ctx.strokeStyle = (own.stroke as () => string)();
  ctx.lineWidth = own.width! * devicePixelRatio;
  ctx.lineJoin = "round";
  ctx.setLineDash((own.dash ?? []).map((one) => one * devicePixelRatio));
  ctx.stroke();
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
    if (!Number.isNaN(to)) put(next, to);
    /* Half of the line from the previous value belongs to the previous column, half to this column. */
    if (!Number.isNaN(to) && !Number.isNaN(at) && next !== column) {
      const step = (to - at) / (next - column);
      for (let k = Math.max(column, -1); k < Math.min(next, width); k++) {
        const middle = at + step * (k + 0.5 - column);
        put(k, middle);
        put(k + 1, middle);
      }
    }
    [column, at] = [next, to];
  }
  u.ctx.fillStyle = (u.series[series]!.stroke as () => string)();
  const dash = (u.series[series]!.dash ?? []).map((one) => one * devicePixelRatio);
  for (let k = 0; k < width; k++) {
    const [from, to] = [Math.max(low[k]! - half, 0), Math.min(high[k]! + half, height)];
    u.ctx.globalAlpha = isInDash(k, dash) ? 1 : 0.4; // a gap of the dash is pale: no value is left out
    if (to > from) u.ctx.fillRect(left + k, top + from, 1, to - from);
  }
}

/** Return the spans of time that the plot shows, each with its ends in pixels. */
function seen<Span extends Mark>(u: uPlot, spans: Span[]): { one: Span; from: number; to: number }[] {
  const { left, width } = u.bbox;
  const [low, high] = [u.scales.x!.min!, u.scales.x!.max!];
  const pixel = (time: number) => Math.min(Math.max(u.valToPos(time, "x", true), left), left + width);
  const shown = spans.filter((one) => one.to >= low && one.from <= high);
  return shown.map((one) => ({ one, from: pixel(one.from), to: pixel(one.to) }));
}

/** Shade the time spans below the curves. If they are many and too thin to see, draw no shading. */
export function shade(u: uPlot, parts: Shade[]): void {
  const { top, width, height } = u.bbox;
  const shown = seen(u, parts);
  if (shown.length > width / 4) return;
  for (const { one, from, to } of shown) {
    u.ctx.fillStyle = token(one.direction > 0 ? "stroke-strong" : "stroke");
    u.ctx.fillRect(from, top, to - from, height);
  }
}

/** Mark places by a bar at the foot of the plot, at least three pixels wide. */
export function mark(u: uPlot, places: Mark[]): void {
  const { left, top, width, height } = u.bbox;
  const [tall, thin] = [7 * devicePixelRatio, 3 * devicePixelRatio];
  u.ctx.fillStyle = token("mark");
  for (const { from, to } of seen(u, places)) {
    u.ctx.fillRect(Math.min(from, left + width - thin), top + height - tall, Math.max(to - from, thin), tall);
  }
}

/** Draw vertical lines with their numbers. */
export function upright(u: uPlot, times: number[]): void {
  const { left, top, width, height } = u.bbox;
  u.ctx.strokeStyle = u.ctx.fillStyle = token("upright");
  u.ctx.lineWidth = devicePixelRatio;
  u.ctx.font = `${12 * devicePixelRatio}px system-ui`;
  times.forEach((time, index) => {
    const at = u.valToPos(time, "x", true);
    if (at < left || at > left + width) return;
    u.ctx.setLineDash(index ? [5 * devicePixelRatio, 4 * devicePixelRatio] : []);
    u.ctx.stroke(new Path2D(`M${at} ${top}v${height}`));
    if (times.length > 1) u.ctx.fillText(String(index + 1), at + 4 * devicePixelRatio, top + 12 * devicePixelRatio);
  });
}

/** Mark times by a triangle at the top and a pale line below it. */
export function flag(u: uPlot, times: number[]): void {
  const { left, top, width, height } = u.bbox;
  const size = 5 * devicePixelRatio;
  u.ctx.fillStyle = u.ctx.strokeStyle = token("mark");
  u.ctx.lineWidth = devicePixelRatio;
  let last = -Infinity;
  for (const time of times) {
    const at = u.valToPos(time, "x", true);
    if (at < left || at > left + width || at - last < size) continue; // it would cover the one before
    last = at;
    u.ctx.globalAlpha = 1;
    u.ctx.fill(new Path2D(`M${at - size} ${top}h${2 * size}L${at} ${top + 1.6 * size}`));
    u.ctx.globalAlpha = 0.45;
    u.ctx.setLineDash([2 * devicePixelRatio, 3 * devicePixelRatio]);
    u.ctx.stroke(new Path2D(`M${at} ${top}v${height}`));
  }
}

export function fill(u: uPlot, bands: Band[], size: number): void {
  clip(u);
  for (const one of bands) {
    u.ctx.beginPath();
    const at = (i: number, values: ArrayLike<number>) =>
      u.ctx.lineTo(u.valToPos(one.x[i]!, "x", true), u.valToPos(values[i]! / size, "y", true));
    for (let i = 0; i < one.x.length; i++) at(i, one.high);
    for (let i = one.x.length - 1; i >= 0; i--) at(i, one.low);
    u.ctx.fillStyle = `${look(one.look).color}33`;
    u.ctx.fill();
  }
}
