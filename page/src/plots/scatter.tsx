/** Measured points with their bars, and the fitted curve of each group with its band. */
import { useEffect, useRef } from "preact/hooks";
import "../drive/language"; // before uPlot, which reads it
import uPlot from "uplot";
import { digits, isDark, look } from "./looks";
import { axes, Legend, More } from "./plot";

export interface Point {
  x: number;
  y: number;
  spread: number | null;
  run?: string; // runs differ in shape
}

/** Points with their spread, and the curve and band that belong to them. */
export interface Group {
  label: string;
  points: Point[];
  curve?: { x: number[]; y: number[]; low: number[]; high: number[]; measured: [number, number] };
}

const MOST_BARS = 400; // spreads beyond which bars would cover the points
const HEIGHT = 360;
const DECADE = 10; // speeds that span as much are drawn on a logarithmic axis
const NEAR = 14; // pixels between the pointer and the point that is named

/** Whether the points of all groups lie above zero and span a decade. */
export function isWide(groups: Group[]): boolean {
  const all = groups.flatMap((one) => one.points.map((point) => point.x));
  return all.length > 1 && Math.min(...all) > 0 && Math.max(...all) >= DECADE * Math.min(...all);
}

/**
 * Friction over speed, with a marker for each measured point. Beyond the measured speeds, curves are dotted. Axes reach
 * over all groups of `among`, so that plots side by side have equal axes.
 */
export function Scatter(props: {
  title: string;
  x: string;
  y: string;
  groups: Group[];
  log: boolean;
  among?: Group[];
  height?: number;
}) {
  const place = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const near = useRef<HTMLSpanElement>(null);
  const latest = useRef(props);
  latest.current = props;
  useEffect(() => {
    const at = place.current!;
    const { among, height = HEIGHT } = props;
    const shared = among && [spanOf(among, "x"), spanOf(among, "y")];
    const tables: uPlot.AlignedData[] = [];
    const series: uPlot.Series[] = [{}];
    const bands: uPlot.Band[] = [];
    props.groups.forEach((group, index) => {
      const { color, dash } = look(index);
      const quiet = { stroke: "transparent", width: 0, points: { show: false }, spanGaps: true } as const;
      tables.push([
        [...new Set(group.points.map((one) => one.x))].sort((a, b) => a - b),
        [],
      ] as unknown as uPlot.AlignedData); // places of the axis; `points` draws
      series.push({ ...quiet, label: group.label, points: { show: false } });
      if (!group.curve) return;
      const { x, y, low, high, measured } = group.curve;
      const inside = x.map((one) => one >= measured[0] * (1 - 1e-9) && one <= measured[1] * (1 + 1e-9));
      tables.push([x, high, low, y.map((one, i) => (inside[i] ? one : null)), y] as unknown as uPlot.AlignedData);
      series.push({ ...quiet, label: "upper" }, { ...quiet, label: "lower" });
      series.push({ ...quiet, label: "fit", stroke: color, dash, width: 1.6 });
      series.push({ ...quiet, label: "extrapolated", stroke: color, dash: [1, 4], width: 1.2 });
      const last = series.length;
      bands.push({ series: [last - 4, last - 3], fill: `${color}22` });
    });
    const made = new uPlot(
      {
        width: at.clientWidth || 600,
        height,
        padding: [8, 16, 0, 0],
        scales: {
          x: { time: false, distr: props.log ? 3 : 1, ...(shared && { range: () => shared[0]! }) },
          y: {
            range: (_, low, high) =>
              shared ? reached(among, ...shared[1]!) : reached(latest.current.groups, low, high),
          },
        },
        cursor: { drag: { x: true, y: true }, points: { show: false } },
        legend: { show: false },
        axes: axes({ size: 22, label: props.x }, { label: props.y, labelSize: 18 }),
        series,
        bands,
        hooks: {
          draw: [(u) => points(u, latest.current.groups)],
          setCursor: [(u) => near.current && name(u, near.current, latest.current)],
        },
      },
      uPlot.join(tables),
      at,
    );
    plot.current = made;
    const seen = new ResizeObserver(() => made.setSize({ width: at.clientWidth, height }));
    seen.observe(at);
    return () => {
      seen.disconnect();
      made.destroy();
    };
  }, [props.groups, props.log, isDark()]);
  const runs = runsOf(props.groups);
  const saved = () => ({
    title: props.title,
    x: props.x,
    y: props.y,
    u: plot.current!,
    legend: props.groups.map(({ label }, k) => ({ label, look: k })),
    points: props.groups.flatMap((group, k) => group.points.map((one) => ({ ...one, look: k }))),
  });
  return (
    <figure
      class="plot"
      data-plot={props.title}
      data-points={props.groups.reduce((sum, one) => sum + one.points.length, 0)}>
      <figcaption>
        <span class="title">{props.title}</span>
        <Legend labels={props.groups.map(({ label }, index) => [label, index])} />
        {runs.length > 1 && runs.length <= SHAPES.length && (
          <span class="note">{runs.map((run, k) => `${SIGNS[k]} ${run}`).join("  ")}</span>
        )}
        <span class="value" ref={near} />
        <More title={props.title} saved={saved} />
      </figcaption>
      <div ref={place} aria-hidden="true" />
    </figure>
  );
}

/** Lowest and highest value of all points and curves along an axis. */
function spanOf(groups: Group[], axis: "x" | "y"): [number, number] {
  const values = groups
    .flatMap((one) => [...one.points.map((point) => point[axis]), ...(one.curve?.[axis] ?? [])])
    .filter(Number.isFinite);
  return [Math.min(...values), Math.max(...values)];
}

/** The ends of an axis that fits the bars, with some room. */
export function reached(groups: Group[], low: number, high: number): [number, number] {
  let [least, most] = [low ?? Infinity, high ?? -Infinity];
  for (const group of groups)
    for (const { y, spread } of group.points)
      [least, most] = [Math.min(least, y - (spread ?? 0)), Math.max(most, y + (spread ?? 0))];
  if (!(most >= least)) return [0, 1];
  const room = 0.08 * (most - least || Math.abs(most) || 1);
  return [least - room, most + room];
}

/** The runs of all points; each run has a marker shape. */
const runsOf = (groups: Group[]): string[] => [
  ...new Set(groups.flatMap((group) => group.points.flatMap((one) => one.run ?? []))),
];

type Shape = (at: CanvasRenderingContext2D, x: number, y: number, r: number) => void;

const corners =
  (...ends: [number, number][]): Shape =>
  (at, x, y, r) =>
    ends.forEach(([dx, dy], k) => void at[k ? "lineTo" : "moveTo"](x + dx * r, y + dy * r));
const SHAPES: Shape[] = [
  (at, x, y, r) => at.arc(x, y, r, 0, 2 * Math.PI),
  corners([-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]),
  corners([0, -1.2], [1.1, 0.8], [-1.1, 0.8]),
  corners([0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0]),
];
const SIGNS = ["●", "■", "▲", "◆"];

/** Draw each point as a marker with its bar; points of the first run are filled, those of others open. */
function points(u: uPlot, groups: Group[]): void {
  const runs = runsOf(groups);
  const isFew = groups.reduce((sum, one) => sum + one.points.length, 0) <= MOST_BARS;
  const { ctx } = u;
  ctx.save();
  ctx.beginPath();
  ctx.rect(u.bbox.left - 8, u.bbox.top, u.bbox.width + 16, u.bbox.height);
  ctx.clip();
  ctx.setLineDash([]);
  ctx.lineWidth = 1.5 * devicePixelRatio;
  groups.forEach((group, index) => {
    ctx.strokeStyle = ctx.fillStyle = look(index).color;
    for (const { x, y, spread, run } of group.points) {
      const [px, py] = [u.valToPos(x, "x", true), u.valToPos(y, "y", true)];
      if (spread !== null && isFew) {
        const cap = 3 * devicePixelRatio;
        ctx.beginPath();
        for (const end of [y - spread, y + spread].map((one) => u.valToPos(one, "y", true))) {
          ctx.moveTo(px, py);
          ctx.lineTo(px, end);
          ctx.moveTo(px - cap, end);
          ctx.lineTo(px + cap, end);
        }
        ctx.stroke();
      }
      const shape = Math.max(runs.indexOf(run ?? ""), 0) % SHAPES.length;
      ctx.beginPath();
      SHAPES[shape]!(ctx, px, py, (isFew ? 4 : 2) * devicePixelRatio);
      ctx.closePath();
      ctx.globalAlpha = shape ? 0.35 : 0.85;
      ctx.fill();
      ctx.globalAlpha = 1;
      ctx.stroke();
    }
  });
  ctx.restore();
}

/** Show the name of the measured point under the pointer. */
function name(
  u: uPlot,
  place: HTMLElement,
  { groups, x: xName, y: yName }: { groups: Group[]; x: string; y: string },
): void {
  const { left = -1, top = -1 } = u.cursor;
  let [best, words] = [NEAR, ""];
  if (left >= 0)
    for (const { label, points: all } of groups)
      for (const { x, y, spread, run } of all) {
        const far = Math.hypot(u.valToPos(x, "x") - left, u.valToPos(y, "y") - top);
        if (far < best)
          [best, words] = [
            far,
            `${label}${run ? `, ${run}` : ""}: ${digits(x, 3)} ${unitOf(xName)}, ${digits(y, 3)}${spread === null ? "" : ` ± ${digits(spread, 2)}`} ${unitOf(yName)}`,
          ];
      }
  place.textContent = words;
}

const unitOf = (words: string): string => words.slice(words.lastIndexOf(", ") + 2);
