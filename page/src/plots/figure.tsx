/** Drawing of the figures of a view: marks in panels on axes with units. Lengths are pixels, colours are tokens. */

import { type ComponentChildren, render } from "preact";
import { useState } from "preact/hooks";
import type { Axis, Bars, Drawing, Line, Mark, Markers, Panel, ShownFigure } from "../server/generated";
import { Button, Table } from "../workspace/fields";
import { digits, look, pretty } from "./looks";
import { axis } from "./points";
import { type Saved, saveDrawing, saveRows } from "./saving";
import { asList, isNumber, type Numbers, type Scale, scaleOf } from "./scale";
import { useWidth } from "./width";

const [LEAST_WIDTH, LEAST_OF_MANY] = [230, 150]; // of a panel beside another one, and of many small ones
const INCH = 100; // height of an inch of a printed figure
const HERO = 1.4; // a single row is taller than in print
const [LEAST_HEIGHT, MOST_HEIGHT] = [110, 460];
const MOST_LARGE = 3; // panels beyond which they are small multiples
const MOST_ENDS = 5; // labels at the ends of lines; more stand above
const LONGEST_END = 24; // characters of such a label
const CHARACTER = 6.7; // width of a character of an axis

const colour = (name: string | number): string =>
  typeof name === "number"
    ? `color-mix(in srgb, var(--fig-deep) ${Math.round(100 * name)}%, var(--fig-light))`
    : `var(--${name.startsWith("look-") ? name : `fig-${name.replace(" ", "-")}`})`;

/** Return the dash of a look for a line of usual width. */
function dashOf(dash: unknown): string | undefined {
  if (Array.isArray(dash)) return (dash[1] as number[]).map((one) => 1.6 * one).join(" ");
  return ({ "--": "6 4", "-.": "7 3 2 3", ":": "2 3" } as Record<string, string>)[String(dash)];
}

/** Markers around the origin, of radius 1. */
const ROUND = "M-1 0a1 1 0 1 0 2 0a1 1 0 1 0-2 0Z";
const SHAPES: Record<string, string> = {
  s: "M-.9-.9H.9V.9H-.9Z",
  "^": "M0-1.2L1.1.8H-1.1Z",
  v: "M0 1.2L1.1-.8H-1.1Z",
  D: "M0-1.2L1.2 0L0 1.2L-1.2 0Z",
  P: "M-.4-1.1H.4V-.4H1.1V.4H.4V1.1H-.4V.4H-1.1V-.4H-.4Z",
  "|": "M0-1.4V1.4",
};
const radius = (mark: Markers): number => (mark.look[2] === "." ? 1.8 : Math.max(mark.size, 3) * 0.9);

/** A panel in pixels: where values lie. */
interface Place {
  px: (value: number) => number; // of an SI value
  py: (value: number) => number;
  left: number;
  right: number;
  top: number;
  bottom: number;
  isNamed?: boolean; // a name stands beside its mark
  words?: (x: number, y: number) => string; // of a point under the pointer
}

/** Return the path of a line; a missing value is a gap. */
function pathOf(x: Numbers, y: Numbers, { px, py }: Place, steps = false): string {
  let [path, isDown, before] = ["", false, ""];
  x.forEach((value, k) => {
    const other = y[k];
    isDown &&= isNumber(value) && isNumber(other);
    if (!isNumber(value) || !isNumber(other)) return;
    const [ax, ay] = [px(value).toFixed(1), py(other).toFixed(1)];
    path += isDown ? `${steps ? `L${ax} ${before}` : ""}L${ax} ${ay}` : `M${ax} ${ay}`;
    [isDown, before] = [true, ay];
  });
  return path;
}

/** Place of a text to the right of a point, or to its left if it would leave the panel. */
const besideOf = (x: number, right: number, text: string) =>
  x + 6 + CHARACTER * text.length > right ? { x: x - 6, "text-anchor": "end" as const } : { x: x + 6 };

/** Points with their bars and names. A tooltip has the title of a point, or its values. */
function Points({ mark, at }: { mark: Markers & { titles?: string[] }; at: Place }) {
  const ink = colour(mark.look[0]);
  return (
    <g stroke={ink} fill={mark.filled || mark.look[2] === "." ? ink : "var(--surface)"} stroke-width="1.3">
      {mark.joined && <path d={pathOf(mark.x, mark.y, at)} fill="none" stroke-dasharray={dashOf(mark.look[1])} />}
      {mark.x.map((value, k) => {
        const other = mark.y[k];
        if (!isNumber(value) || !isNumber(other)) return null;
        const [px, py, low, high] = [at.px(value), at.py(other), mark.low?.[k], mark.high?.[k]];
        return (
          <>
            {isNumber(low) && isNumber(high) && (
              <path d={`M${px} ${at.py(low)}V${at.py(high)}m-3 0h6M${px - 3} ${at.py(low)}h6`} fill="none" />
            )}
            <path
              d={SHAPES[mark.look[2]] ?? ROUND}
              transform={`translate(${px} ${py}) scale(${radius(mark)})`}
              vector-effect="non-scaling-stroke">
              {at.words && <title>{mark.titles?.[k] ?? `${mark.label} ${at.words(value, other)}`.trim()}</title>}
            </path>
            {mark.names[k] && (
              <text {...besideOf(px, at.right, mark.names[k]!)} y={py - 5} stroke="none" fill="var(--soft)">
                {mark.names[k]}
              </text>
            )}
          </>
        );
      })}
    </g>
  );
}

/** Return the path of a rectangle. */
const boxOf = (x0: number, x1: number, y0: number, y1: number): string => `M${x0} ${y0}H${x1}V${y1}H${x0}Z`;

function BarsOf({ mark, at: { px, py } }: { mark: Bars; at: Place }) {
  return (
    <g fill={colour(mark.look[0])} stroke="var(--fig-black)" stroke-width="0.8">
      {mark.at.map((place, k) => {
        const value = mark.values[k];
        if (!isNumber(place) || !isNumber(value)) return null;
        const [low, high] = [place - mark.thickness / 2, place + mark.thickness / 2];
        const across = boxOf(px(0), px(value), py(low), py(high));
        return <path d={mark.across ? across : boxOf(px(low), px(high), py(0), py(value))} />;
      })}
    </g>
  );
}

/** Draw one mark. */
function Drawn({ mark, at }: { mark: Mark; at: Place }) {
  switch (mark.kind) {
    case "line":
      return (
        <path
          d={pathOf(mark.x, mark.y, at, mark.steps)}
          fill="none"
          stroke={colour(mark.look[0])}
          stroke-width={mark.width ? 1.3 * mark.width : 1.75}
          stroke-linejoin="round"
          stroke-dasharray={dashOf(mark.look[1])}
        />
      );
    case "band": {
      const back = pathOf([...mark.x].reverse(), [...mark.low].reverse(), at).replace(/^M/, "L");
      return (
        <path
          d={`${pathOf(mark.x, mark.high, at)}${back}Z`}
          fill={mark.look ? colour(mark.look[0]) : "var(--fig-band)"}
          opacity={mark.look ? 0.16 : 1}
        />
      );
    }
    case "markers":
      return <Points mark={mark} at={at} />;
    case "bars":
      return <BarsOf mark={mark} at={at} />;
    case "rule": {
      const [x0 = 0, x1 = x0] = mark.x === null ? [at.left, at.right] : asList(mark.x).map((one) => at.px(one!));
      const [y0 = 0, y1 = y0] = mark.y === null ? [at.top, at.bottom] : asList(mark.y).map((one) => at.py(one!));
      const ink = colour(mark.look[0]);
      if (x0 !== x1 && y0 !== y1) {
        const isShade = /^(band|shade)/.test(String(mark.look[0]));
        return <path d={boxOf(x0, x1, y0, y1)} fill={isShade ? ink : "var(--fig-shade)"} />;
      }
      return (
        <>
          <path
            d={`M${x0} ${y0}L${x1} ${y1}`}
            stroke={ink}
            stroke-width={1.2 * mark.width}
            stroke-dasharray={dashOf(mark.look[1])}
          />
          {x0 === x1 && at.isNamed && <Words x={x0 + 4} y={at.top + 12} words={mark.label} />}
        </>
      );
    }
    case "drawing":
      return null;
  }
}

/** Labels of a panel that stand at the ends of its lines, apart from each other. */
function lineEnds(panel: Panel, at: Place): { label: string; y: number; ink: string }[] {
  const found = labelled(panel).flatMap((mark) => {
    if (mark.kind === "rule" && typeof mark.y === "number")
      return [{ label: mark.label, y: at.py(mark.y), ink: "var(--soft)" }];
    if (mark.kind !== "line" && mark.kind !== "markers") return [];
    const last = mark.y.reduce<number>((best, value, k) => (isNumber(value) && isNumber(mark.x[k]) ? k : best), -1);
    return last < 0 ? [] : [{ label: mark.label, y: at.py(mark.y[last]!), ink: colour(mark.look[0]) }];
  });
  found.sort((a, b) => a.y - b.y);
  let before = -Infinity;
  for (const one of found) one.y = before = Math.max(one.y, before + 15, at.top + 6);
  let after = Infinity;
  for (const one of [...found].reverse()) one.y = after = Math.min(one.y, after - 15, at.bottom);
  return found;
}

type Labelled = Exclude<Mark, Drawing>;

/** Marks of some panels with a label, one of each label. */
const labelled = (...panels: Panel[]): Labelled[] => {
  const seen = new Set<string>();
  return panels
    .flatMap((panel) => panel.marks)
    .filter((mark): mark is Labelled => mark.kind !== "drawing" && !!mark.label)
    .filter(({ label }) => !seen.has(label) && seen.add(label));
};

/** A text of a drawing that stands right of a point, around it or left of it. */
const Words = (props: { x: number; y: number; side?: "end" | "middle"; ink?: "caption" | "soft"; words: string }) => (
  <text x={props.x} y={props.y} text-anchor={props.side} fill={`var(--${props.ink ?? "soft"})`}>
    {props.words}
  </text>
);

/** A drawing that is saved with its figure. */
const Sheet = (props: { width: number; height: number; label: string; children: ComponentChildren }) => (
  <svg class="panel-drawing" width={props.width} height={props.height} role="img" aria-label={props.label}>
    <g font-size="12" font-family="system-ui, sans-serif">
      {props.children}
    </g>
  </svg>
);

interface PanelProps {
  panel: Panel;
  x: Axis;
  y: Axis;
  scales: Scale[];
  width: number;
  height: number;
  isBare?: boolean; // the panel below has the axis
  longest: number; // characters of a number of the axis
  ends: number; // and of a name at the end of a line; 0: the names stand elsewhere
  name: string;
}

/** Return the unit of an axis, from its label. */
const unitOf = ({ unit, label }: Axis): string => unit || label.slice(label.lastIndexOf(", ") + 2);

/** Return the ticks of the vertical axis of a panel. */
const ticksOf = (scale: Scale, height: number) => scale.ticks(Math.max(Math.round(height / 48), 2));

export function PanelDrawing({ panel, x, y, scales, width, height, isBare = false, longest, ends, name }: PanelProps) {
  const [sx, sy] = scales as [Scale, Scale];
  const yTicks = ticksOf(sy, height);
  const left = Math.min(14 + CHARACTER * longest, width * 0.4);
  const right = width - 12 - (ends ? CHARACTER * ends + 4 : 0);
  const quantity = y.is_named ? y.label.replace("\n", " ") : "";
  const head = [panel.title, quantity].filter(Boolean);
  const hasLabel = !isBare && x.is_named && x.label !== "";
  const [top, bottom] = [head.length ? 26 : 10, height - (isBare ? 8 : 22) - (hasLabel ? 18 : 0)];
  const at: Place = {
    left,
    right,
    top,
    bottom,
    isNamed: ends > 0,
    words: (one, other) => `${digits(one / x.size, 4)} ${unitOf(x)}, ${digits(other / y.size, 4)} ${unitOf(y)}`,
    px: (value) => left + sx.at(value / x.size) * (right - left),
    py: (value) => bottom - sy.at(value / y.size) * (bottom - top),
  };
  const xTicks = sx.ticks(Math.max(Math.round((right - left) / (right - left < 240 ? 48 : 84)), 2));
  const widest = Math.max(...xTicks.map(([, words]) => words.length), 1) * CHARACTER + 8;
  const every = Math.ceil((xTicks.length * widest) / Math.max(right - left, 1));
  const clip = `clip-${name}`.replace(/[^\w-]/g, "-");
  return (
    <Sheet width={width} height={height} label={[...head, x.label].join(", ")}>
      {head.length > 0 && (
        <text x={panel.title ? 0 : Math.max(left - CHARACTER * longest - 6, 0)} y={14} fill="var(--soft)">
          <tspan font-weight="650" fill="var(--ink)">
            {panel.title}
          </tspan>
          {head.length > 1 && "  "}
          {pretty(quantity)}
        </text>
      )}
      {yTicks.map(([value, words]) => (
        <>
          {!y.names.length && <path d={`M${left} ${at.py(value * y.size)}H${right}`} stroke="var(--grid)" />}
          <Words x={left - 8} y={at.py(value * y.size) + 4} side="end" ink="caption" words={words} />
        </>
      ))}
      {xTicks.map(([value, words], k) => (
        <>
          <path d={`M${at.px(value * x.size)} ${bottom}v4`} stroke="var(--edge)" />
          {!isBare && k % every === 0 && (
            <Words x={at.px(value * x.size)} y={bottom + 17} side="middle" ink="caption" words={words} />
          )}
        </>
      ))}
      <path d={`M${left} ${bottom}H${right}`} stroke="var(--edge)" />
      {hasLabel && <Words x={(left + right) / 2} y={height - 5} side="middle" words={pretty(x.label)} />}
      <clipPath id={clip}>
        <rect x={left - 6} y={top - 6} width={Math.max(right - left + 12, 0)} height={Math.max(bottom - top + 12, 0)} />
      </clipPath>
      <g clip-path={`url(#${clip})`}>
        {panel.marks.map((mark) => (
          <Drawn mark={mark} at={at} />
        ))}
      </g>
      {ends > 0 &&
        lineEnds(panel, at).map((one) => (
          <text x={right + 8} y={one.y + 4} font-weight="650" fill={one.ink}>
            {one.label}
          </text>
        ))}
    </Sheet>
  );
}

/** Anchors of texts of a drawing by their alignment, and their baselines below the point, pixels. */
const ANCHORS: Record<string, "start" | "end"> = { left: "start", right: "end" };
const DROPS: Record<string, number> = { top: 10, bottom: -2 };

/** A drawing without axes, such as a mechanism, in its own lengths. */
function Paper({ drawing, width, height }: { drawing: Drawing; width: number; height: number }) {
  const [[x0, x1], [y0, y1]] = [drawing.x, drawing.y];
  const [fx, fy] = [width / (x1 - x0), height / (y1 - y0)];
  const [kx, ky] = drawing.equal ? [Math.min(fx, fy), Math.min(fx, fy)] : [fx, fy];
  const point = ([x, y]: Numbers): string => `${((x! - x0) * kx).toFixed(1)} ${((y1 - y!) * ky).toFixed(1)}`;
  return (
    <Sheet width={(x1 - x0) * kx} height={(y1 - y0) * ky} label="Drawing">
      {drawing.strokes.map((stroke) => {
        const [across = "", up = ""] = stroke.align.split(" ");
        const [px, py] = point(stroke.points[0]!).split(" ");
        if (stroke.text)
          return (
            <text
              x={px}
              y={Number(py) + (DROPS[up] ?? 4)}
              text-anchor={ANCHORS[across] ?? "middle"}
              font-size={Math.max(1.35 * stroke.size, 11)}
              font-weight={stroke.bold ? 650 : 400}
              fill={colour(stroke.color)}>
              {stroke.text}
            </text>
          );
        return (
          <path
            d={`M${stroke.points.map(point).join("L")}`}
            fill={stroke.fill ? colour(stroke.fill) : "none"}
            fill-opacity={stroke.tint}
            stroke={colour(stroke.color)}
            stroke-width={1.3 * stroke.width}
            stroke-opacity={stroke.opacity}
            stroke-dasharray={stroke.dash.map((one) => one * 1.3 * stroke.width).join(" ") || undefined}
            stroke-linecap={stroke.cap === "butt" ? "butt" : "round"}
          />
        );
      })}
    </Sheet>
  );
}

/** Values with which a mark is its own sample, in a box of 28 x 12 pixels. */
const SAMPLES: { [Kind in Labelled["kind"]]: Partial<Extract<Labelled, { kind: Kind }>> } = {
  line: { x: [0, 28], y: [6, 6] },
  markers: { x: [14], y: [6, 6, 6], low: null, high: null, names: [] },
  rule: { x: null, y: 6 },
  band: { x: [0, 28], low: [12, 12], high: [0, 0] },
  bars: { at: [6], values: [28], thickness: 12, across: true },
};
const SAMPLE: Place = { px: (value) => value, py: (value) => value, left: 0, right: 28, top: 0, bottom: 12 };

/** Labels above the panels, each with its line or marker. */
function Labels({ marks }: { marks: Labelled[] }) {
  if (!marks.length) return null;
  return (
    <ul class="figure-labels">
      {marks.map((mark) => {
        const joined = "joined" in mark && mark.joined && { x: [2, 14, 26] };
        return (
          <li key={mark.label}>
            <svg width="28" height="12" aria-hidden="true">
              <Drawn mark={{ ...mark, ...SAMPLES[mark.kind], ...joined } as Mark} at={SAMPLE} />
            </svg>{" "}
            {mark.label}
          </li>
        );
      })}
    </ul>
  );
}

/** Return the axis of a panel, or that of the figure if the panel has none. */
const axisOf = (own: Axis, shared: Axis): Axis =>
  own.label || own.names.length || own.scale !== "linear" || own.low !== null || own.high !== null ? own : shared;

/** Numbers of a figure: a row for each point, in the units of its axes. */
function rowsOf(panels: { panel: Panel; x: Axis; y: Axis }[]): string[][] {
  const text = (value: number | null | undefined, axis: Axis) =>
    isNumber(value) ? String(Number((value / axis.size).toPrecision(10))) : "";
  const rows = panels.flatMap(({ panel, x, y }) =>
    panel.marks.flatMap((mark) => {
      const label = mark.kind === "drawing" ? "" : mark.label;
      const place = (at: number | null, axis: Axis) => axis.names[at ?? -1] ?? text(at, axis);
      const row = (at: string, values: string[]) => [panel.title, label, at, ...values];
      if (mark.kind === "bars") {
        const [along, across] = mark.across ? [y, x] : [x, y];
        return mark.at.map((at, k) => row(place(at, along), [text(mark.values[k], across), "", ""]));
      }
      if (mark.kind !== "line" && mark.kind !== "markers" && mark.kind !== "band") return [];
      const [low, high] = mark.kind === "line" ? [null, null] : [mark.low, mark.high];
      const middle = mark.kind === "band" ? [] : mark.y;
      const valuesAt = (k: number) => [middle, low, high].map((values) => text(values?.[k], y));
      return mark.x.map((at, k) => row(place(at, x), valuesAt(k)));
    }),
  );
  const [first] = panels;
  return [["panel", "label", first?.x.label || "x", first?.y.label || "y", "low", "high"], ...rows];
}

/** Whether the labels of a panel stand at the ends of its lines. */
function isShort(panel: Panel): boolean {
  const marks = labelled(panel);
  const isFitting = ({ label, kind }: Labelled) =>
    label.length <= LONGEST_END && ["line", "markers", "rule"].includes(kind);
  return marks.length <= MOST_ENDS && marks.every(isFitting);
}

/** A figure with its caption. */
export function FigureView({ shown }: { shown: ShownFigure }) {
  const [place, width] = useWidth<HTMLDivElement>();
  const { figure, name } = shown;
  const total = Math.max(Math.min(figure.columns, figure.panels.length), 1);
  const least = figure.panels.length > MOST_LARGE ? LEAST_OF_MANY : LEAST_WIDTH;
  const columns = Math.max(Math.min(total, Math.floor(width / least)), 1);
  const panelWidth = Math.floor((width - 16 * (columns - 1)) / columns);
  const drawn = [...figure.panels, figure.tall].flatMap((panel, index) =>
    panel ? [{ panel, index, x: axisOf(panel.x, figure.x), y: axisOf(panel.y, figure.y) }] : [],
  );
  const panels = drawn.map(({ panel }) => panel);
  /** Panels of one group have equal ends of an axis. */
  const groupOf = (index: number, how: string): number =>
    ({ all: 0, row: Math.floor(index / total), col: index % total })[how] ?? index;
  const together = (index: number, how: string) =>
    drawn.filter((one) => groupOf(one.index, how) === groupOf(index, how)).flatMap(({ panel }) => panel.marks);
  const rows = Math.ceil(figure.panels.length / total);
  const whole = figure.heights.reduce((sum, one) => sum + one, 0);
  const heightOf = (index: number) => {
    const ratio = ((figure.heights[Math.floor(index / total)] ?? 1) * rows) / (whole || rows);
    const height = figure.row_in * INCH * ratio * (rows === 1 ? HERO : 1) + 40;
    return Math.min(Math.max(height, LEAST_HEIGHT), MOST_HEIGHT);
  };
  const placed = drawn.map((one) => {
    const y = scaleOf(one.y, "y", together(one.index, figure.share_y));
    const height = heightOf(one.index);
    const scales = [scaleOf(one.x, "x", together(one.index, figure.share_x)), y];
    return { ...one, scales, height, longest: Math.max(...ticksOf(y, height).map(([, words]) => words.length), 1) };
  });
  const labels = labelled(...panels);
  const hasEnds = panelWidth > 440 && panels.length <= 3 && panels.every(isShort);
  /* Panels below each other have one left and one right. */
  const ends = hasEnds ? Math.max(...labels.map(({ label }) => label.length), 0) : 0;
  const longest = columns === 1 && { longest: Math.max(...placed.map((one) => one.longest)) };
  const isStacked = columns === total && (figure.share_x === "all" || figure.share_x === "col");
  const points = panels.flatMap(({ marks }) => marks.flatMap((mark) => (mark.kind === "markers" ? mark.x : [])));
  return (
    <figure class="figure" data-figure={name} data-points={points.length}>
      {figure.title && <p class="title">{figure.title}</p>}
      <Labels marks={hasEnds ? [] : labels} />
      <div ref={place} class="figure-panels" style={{ gridTemplateColumns: `repeat(${columns}, minmax(0, 1fr))` }}>
        {width > 0 &&
          placed.map((one) => {
            const { panel, index, height } = one;
            const [first] = panel.marks;
            const gridColumn = columns === total ? (index % total) + 1 : undefined;
            return (
              <div key={index} style={{ gridColumn }}>
                {first?.kind === "drawing" ? (
                  <Paper drawing={first} width={panelWidth} height={height} />
                ) : (
                  <PanelDrawing
                    {...one}
                    {...longest}
                    ends={ends}
                    width={panelWidth}
                    isBare={isStacked && Boolean(figure.panels[index + total])}
                    name={`${name}-${index}`}
                  />
                )}
              </div>
            );
          })}
      </div>
      <figcaption>
        {shown.caption}{" "}
        <span class="saves">
          <Button class="link" act={() => saveDrawing(name, place.current!)} words="Save figure" />{" "}
          <Button class="link" act={() => saveRows(name, rowsOf(drawn))} words="Save numbers" />
        </span>
      </figcaption>
      <NumbersTable name={name} rows={() => rowsOf(drawn)} />
    </figure>
  );
}

/** A figure as a part of a view. */
export const FigurePanel = ({ shown, ...data }: { shown: ShownFigure; [data: `data-${string}`]: unknown }) => (
  <div class="panel" {...data}>
    <FigureView shown={shown} />
  </div>
);

const MOST_ROWS = 400; // of the table; the saved numbers have all

/** Numbers of a figure as a table. */
function NumbersTable({ name, rows }: { name: string; rows: () => string[][] }) {
  const [open, setOpen] = useState(false);
  const [heads = [], ...others] = open ? rows() : [];
  return (
    <details onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary aria-label={`${name}: values as a table`}>Values as a table</summary>
      {open && <Table label={`Table of ${name}`} heads={heads} rows={others.slice(0, MOST_ROWS)} />}
    </details>
  );
}

const DASH = 1.6; // pixels of a unit of a dash

/** Return the visible curves of a plot as lines. A value of another curve's time is left out; null is a gap. */
const linesOf = ({ u, curves }: Saved): Line[] =>
  curves.map(({ label, look: own }, k): Line => {
    const { min = 0, max = 1 } = u.scales.x!;
    const [index, values] = [own ?? k, u.data[k + 1]!];
    const rows = Array.from(u.data[0], (x, row) => [x, values[row]] as const).filter(
      ([x, y]) => x >= min! && x <= max! && y !== undefined,
    );
    return {
      x: rows.map(([x]) => x),
      y: rows.map(([, y]) => y ?? null),
      label,
      width: 1.1,
      steps: false,
      kind: "line",
      look: [`look-${(index % 8) + 1}`, [0, look(index).dash.map((length) => length / DASH)], ""],
    };
  });

/** Save a plot as a drawing or a picture; texts of a drawing stay texts. */
export async function savePlot(ending: "svg" | "png", plot: Saved): Promise<void> {
  const { u, title, unit, over } = plot;
  const marks = linesOf(plot);
  const axisOf = (label: string, { min, max, distr }: uPlot.Scale): Axis => ({
    ...axis(label, distr === 3 ? "log" : "linear", min),
    high: max ?? null,
  });
  const [x, y] = [axisOf(over, u.scales.x!), axisOf(`${title}, ${unit || "1"}`, u.scales.y!)];
  const host = document.querySelector(".pneudrive")!.appendChild(document.createElement("div"));
  host.style.width = `${u.width}px`;
  const ends = marks.length > 1 ? Math.max(...marks.map(({ label }) => label.length)) : 0;
  const drawing = { panel: { marks, title: "", x, y }, x, y, scales: [scaleOf(x, "x", marks), scaleOf(y, "y", marks)] };
  render(
    <PanelDrawing {...drawing} ends={ends} width={u.width} height={u.height + 60} longest={8} name="saved" />,
    host,
  );
  await saveDrawing(title, host, ending);
  render(null, host);
  host.remove();
}
