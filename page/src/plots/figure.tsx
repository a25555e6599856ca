/** Drawing of the figures of a view: marks in panels on axes with units. Lengths are pixels, colours are tokens. */

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import type { Axis, Bars, Drawing, Mark, Markers, Panel, ShownFigure } from "../server/generated";
import { Button, Table } from "../workspace/fields";
import { digits, pretty } from "./looks";
import { saveDrawing, saveRows } from "./saving";
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

/** Return the path of a closed line around a point, from its corners as pairs of numbers in radii. */
function around(corners: string): (x: number, y: number, r: number) => string {
  const pairs = corners.split(", ").map((pair) => pair.split(" ").map(Number));
  return (x, y, r) =>
    `M${pairs.map(([dx, dy]) => `${(x + dx! * r).toFixed(1)} ${(y + dy! * r).toFixed(1)}`).join("L")}Z`;
}
const SHAPES: Record<string, (x: number, y: number, r: number) => string> = {
  s: around("-0.9 -0.9, 0.9 -0.9, 0.9 0.9, -0.9 0.9"),
  "^": around("0 -1.2, 1.1 0.8, -1.1 0.8"),
  v: around("0 1.2, 1.1 -0.8, -1.1 -0.8"),
  D: around("0 -1.2, 1.2 0, 0 1.2, -1.2 0"),
  P: around(
    "-0.4 -1.1, 0.4 -1.1, 0.4 -0.4, 1.1 -0.4, 1.1 0.4, 0.4 0.4, 0.4 1.1, -0.4 1.1, -0.4 0.4, -1.1 0.4, -1.1 -0.4, -0.4 -0.4",
  ),
  "|": around("0 -1.4, 0 1.4"),
};
const round = (x: number, y: number, r: number) =>
  `M${(x - r).toFixed(1)} ${y.toFixed(1)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`;
const radius = (mark: Markers): number => (mark.look[2] === "." ? 1.8 : Math.max(mark.size, 3) * 0.9);

/** A panel in pixels: where values lie. */
interface Place {
  px: (value: number) => number; // of an SI value
  py: (value: number) => number;
  left: number;
  right: number;
  top: number;
  bottom: number;
  hasEnds?: boolean; // names stand in the panel
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
  const shape = SHAPES[mark.look[2]] ?? round;
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
            <path d={shape(px, py, radius(mark))}>
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

type Ends = [number, number];

/** Return the rectangle between two values of each axis. */
function boxOf({ px, py }: Place, [x0, x1]: Ends, [y0, y1]: Ends) {
  const side = (a: number, b: number) => ({ at: Math.min(a, b), size: Math.abs(b - a) });
  const [x, y] = [side(px(x0), px(x1)), side(py(y0), py(y1))];
  return { x: x.at, y: y.at, width: x.size, height: y.size };
}

function BarsOf({ mark, at }: { mark: Bars; at: Place }) {
  return (
    <g fill={colour(mark.look[0])} stroke="var(--fig-black)" stroke-width="0.8">
      {mark.at.map((place, k) => {
        const value = mark.values[k];
        if (!isNumber(place) || !isNumber(value)) return null;
        const sides: Ends = [place - mark.thickness / 2, place + mark.thickness / 2];
        return <rect {...(mark.across ? boxOf(at, [0, value], sides) : boxOf(at, sides, [0, value]))} />;
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
      const [xs, ys] = [asList(mark.x).map((one) => at.px(one!)), asList(mark.y).map((one) => at.py(one!))];
      const [x0 = at.left, x1 = xs.length ? undefined : at.right] = [...xs].sort((a, b) => a - b);
      const [y0 = at.top, y1 = ys.length ? undefined : at.bottom] = [...ys].sort((a, b) => a - b);
      const isShade = ["band", "shade", "shade two"].includes(String(mark.look[0]));
      if (x1 !== undefined && y1 !== undefined) {
        const tint = isShade ? colour(mark.look[0]) : "var(--fig-shade)";
        return <rect x={x0} width={x1 - x0} y={y0} height={y1 - y0} fill={tint} />;
      }
      return (
        <>
          <path
            d={xs.length ? `M${x0} ${at.top}V${at.bottom}` : `M${at.left} ${y0}H${at.right}`}
            stroke={colour(mark.look[0])}
            stroke-width={1.2 * mark.width}
            stroke-dasharray={dashOf(mark.look[1])}
          />
          {xs.length === 1 && at.hasEnds && <Words x={x0 + 4} y={at.top + 12} words={mark.label} />}
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

interface PanelProps {
  panel: Panel;
  x: Axis;
  y: Axis;
  scales: [Scale, Scale];
  width: number;
  height: number;
  isBare: boolean; // the panel below has the axis
  hasEnds: boolean;
  longest: number; // characters of a number of the axis, and of a name at the end of a line
  ends: number;
  name: string;
}

/** Return the unit of an axis, from its label. */
const unitOf = ({ unit, label }: Axis): string => unit || label.slice(label.lastIndexOf(", ") + 2);

/** Return the ticks of the vertical axis of a panel. */
const ticksOf = (scale: Scale, height: number) => scale.ticks(Math.max(Math.round(height / 48), 2));

export function PanelDrawing(props: PanelProps) {
  const { panel, x, y, scales, width, height, isBare, hasEnds, longest, ends, name } = props;
  const [sx, sy] = scales;
  const yTicks = ticksOf(sy, height);
  const left = Math.min(14 + CHARACTER * longest, width * 0.4);
  const right = width - 12 - (ends ? CHARACTER * ends + 4 : 0);
  const head = [panel.title, y.is_named ? y.label : ""].filter(Boolean);
  const [top, bottom] = [
    head.length ? 26 : 10,
    height - (isBare ? 8 : 22) - (isBare || !x.label || !x.is_named ? 0 : 18),
  ];
  const at: Place = {
    left,
    right,
    top,
    bottom,
    hasEnds,
    words: (one, other) => `${digits(one / x.size, 4)} ${unitOf(x)}, ${digits(other / y.size, 4)} ${unitOf(y)}`,
    px: (value) => left + sx.at(value / x.size) * (right - left),
    py: (value) => bottom - sy.at(value / y.size) * (bottom - top),
  };
  const xTicks = sx.ticks(Math.max(Math.round((right - left) / (right - left < 240 ? 48 : 84)), 2));
  const widest = Math.max(...xTicks.map(([, words]) => words.length), 1) * CHARACTER + 8;
  const every = Math.ceil((xTicks.length * widest) / Math.max(right - left, 1));
  const clip = `clip-${name}`.replace(/[^\w-]/g, "-");
  return (
    <svg
      class="panel-drawing"
      width={width}
      height={height}
      role="img"
      aria-label={[...head, x.label].join(", ")}
      font-size="12"
      font-family="system-ui, sans-serif">
      {head.length > 0 && (
        <text x={panel.title ? 0 : Math.max(left - CHARACTER * longest - 6, 0)} y={14} fill="var(--soft)">
          <tspan font-weight="650" fill="var(--ink)">
            {panel.title}
          </tspan>
          {panel.title && head.length > 1 ? "  " : ""}
          {pretty(head.length > 1 || !panel.title ? y.label.replace("\n", " ") : "")}
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
      {!isBare && x.is_named && x.label && (
        <Words x={(left + right) / 2} y={height - 5} side="middle" words={pretty(x.label)} />
      )}
      <clipPath id={clip}>
        <rect x={left - 6} y={top - 6} width={Math.max(right - left + 12, 0)} height={Math.max(bottom - top + 12, 0)} />
      </clipPath>
      <g clip-path={`url(#${clip})`}>
        {panel.marks.map((mark) => (
          <Drawn mark={mark} at={at} />
        ))}
      </g>
      {hasEnds &&
        lineEnds(panel, at).map((one) => (
          <text x={right + 8} y={one.y + 4} font-weight="650" fill={one.ink}>
            {one.label}
          </text>
        ))}
    </svg>
  );
}

/** A drawing without axes, such as a mechanism, in its own lengths. */
function Paper({ drawing, width, height }: { drawing: Drawing; width: number; height: number }) {
  const [[x0, x1], [y0, y1]] = [drawing.x, drawing.y];
  const [fx, fy] = [width / (x1 - x0), height / (y1 - y0)];
  const [kx, ky] = drawing.equal ? [Math.min(fx, fy), Math.min(fx, fy)] : [fx, fy];
  const point = ([x, y]: Numbers): string => `${((x! - x0) * kx).toFixed(1)} ${((y1 - y!) * ky).toFixed(1)}`;
  return (
    <svg
      class="panel-drawing"
      width={(x1 - x0) * kx}
      height={(y1 - y0) * ky}
      role="img"
      aria-label="Drawing"
      font-family="system-ui, sans-serif">
      {drawing.strokes.map((stroke) => {
        const [across, up] = stroke.align.split(" ");
        const anchor = across === "left" ? "start" : across === "right" ? "end" : "middle";
        const [px, py] = point(stroke.points[0]!).split(" ");
        if (stroke.text)
          return (
            <text
              x={px}
              y={Number(py) + (up === "top" ? 10 : up === "bottom" ? -2 : 4)}
              text-anchor={anchor}
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
    </svg>
  );
}

/** Labels above the panels, each with its line or marker. */
function Labels({ marks }: { marks: Labelled[] }) {
  if (!marks.length) return null;
  const at: Place = { px: (value) => value, py: (value) => value, left: 0, right: 28, top: 0, bottom: 12 };
  const sample = (mark: Labelled): ComponentChildren => {
    if (mark.kind === "line") return <Drawn mark={{ ...mark, x: [0, 28], y: [6, 6] }} at={at} />;
    const alone = { x: [14], y: [6, 6, 6], low: null, high: null, names: [] };
    if (mark.kind === "markers")
      return <Points mark={{ ...mark, ...alone, ...(mark.joined && { x: [2, 14, 26] }) }} at={at} />;
    if (mark.kind === "rule")
      return <path d="M0 6H28" stroke={colour(mark.look[0])} stroke-dasharray={dashOf(mark.look[1])} />;
    const fill = mark.look ? colour(mark.look[0]) : "var(--fig-band)";
    return <rect width="28" height="12" fill={fill} opacity={mark.kind === "band" && mark.look ? 0.3 : 1} />;
  };
  return (
    <ul class="figure-labels">
      {marks.map((mark) => (
        <li key={mark.label}>
          <svg width="28" height="12" aria-hidden="true">
            {sample(mark)}
          </svg>{" "}
          {mark.label}
        </li>
      ))}
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

/** A figure with its caption. */
export function FigureView({ shown }: { shown: ShownFigure }) {
  const [place, width] = useWidth<HTMLDivElement>();
  const { figure } = shown;
  const total = Math.max(Math.min(figure.columns, figure.panels.length), 1);
  const least = figure.panels.length > MOST_LARGE ? LEAST_OF_MANY : LEAST_WIDTH;
  const columns = Math.max(Math.min(total, Math.floor(width / least)), 1);
  const numbered = figure.panels.map((panel, index) => ({ panel, index }));
  const tall = { panel: figure.tall, index: -1 };
  const drawnPanels = (figure.tall_first ? [tall, ...numbered] : [...numbered, tall]).flatMap(({ panel, index }) =>
    panel ? [{ panel, index, x: axisOf(panel.x, figure.x), y: axisOf(panel.y, figure.y) }] : [],
  );
  /** Panels of one group have equal ends of an axis. */
  const groupOf = (index: number, how: string): number => {
    if (index < 0 || how === "all") return Math.min(index, 0);
    return how === "row" ? Math.floor(index / total) : how === "col" ? index % total : index;
  };
  const together = (index: number, how: string) =>
    drawnPanels.filter((one) => groupOf(one.index, how) === groupOf(index, how)).flatMap(({ panel }) => panel.marks);
  const rows = Math.ceil(figure.panels.length / total);
  const ratios = figure.heights.length ? figure.heights : Array<number>(rows).fill(1);
  const whole = ratios.reduce((sum, one) => sum + one, 0);
  const heightOf = (index: number) => {
    const row = index < 0 ? 1 : ((ratios[Math.floor(index / total)] ?? 1) * rows) / whole;
    const height = figure.row_in * INCH * row * (rows === 1 || index < 0 ? HERO : 1) + 40;
    return Math.min(Math.max(height, LEAST_HEIGHT), MOST_HEIGHT);
  };
  const panelWidth = Math.floor((width - 16 * (columns - 1)) / columns);
  const hasEnds = (panel: Panel) => {
    const marks = labelled(panel);
    return (
      panelWidth > 440 &&
      drawnPanels.length <= 3 &&
      marks.length <= MOST_ENDS &&
      marks.every((mark) => mark.label.length <= LONGEST_END && ["line", "markers", "rule"].includes(mark.kind))
    );
  };
  const above = labelled(...drawnPanels.map(({ panel }) => panel).filter((panel) => !hasEnds(panel)));
  const isStacked = columns === total && (figure.share_x === "all" || figure.share_x === "col");
  const placed = drawnPanels.map((one) => {
    const scales: [Scale, Scale] = [
      scaleOf(one.x, "x", together(one.index, figure.share_x)),
      scaleOf(one.y, "y", together(one.index, figure.share_y)),
    ];
    const height = heightOf(one.index);
    const longest = Math.max(...ticksOf(scales[1], height).map(([, words]) => words.length), 1);
    const ends = hasEnds(one.panel) ? Math.max(...labelled(one.panel).map((mark) => mark.label.length), 0) : 0;
    return { ...one, scales, height, longest, ends };
  });
  /* Panels below each other have one left and one right. */
  const longest = Math.max(...placed.map((one) => one.longest), 1);
  const ends = Math.max(...placed.map((one) => one.ends), 0);
  const marks = drawnPanels.flatMap(({ panel }) => panel.marks);
  const points = marks.flatMap((mark) => (mark.kind === "markers" ? mark.x : []));
  return (
    <figure class="figure" data-figure={shown.name} data-points={points.length}>
      {figure.title && <p class="title">{figure.title}</p>}
      <Labels marks={above} />
      <div ref={place} class="figure-panels" style={{ gridTemplateColumns: `repeat(${columns}, minmax(0, 1fr))` }}>
        {width > 0 &&
          placed.map((one) => {
            const { panel, index, height } = one;
            const [first] = panel.marks;
            const isTall = index < 0;
            const gridColumn = isTall ? "1 / -1" : columns === total ? (index % total) + 1 : undefined;
            const wide = isTall || (columns < total && columns === 1) ? width : panelWidth;
            return (
              <div key={index} style={{ gridColumn }}>
                {first?.kind === "drawing" ? (
                  <Paper drawing={first} width={wide} height={height} />
                ) : (
                  <PanelDrawing
                    {...one}
                    {...(columns === 1 && { longest, ends })}
                    width={wide}
                    isBare={isStacked && !isTall && Boolean(figure.panels[index + total])}
                    hasEnds={hasEnds(panel)}
                    name={`${shown.name}-${index}`}
                  />
                )}
              </div>
            );
          })}
      </div>
      <figcaption>
        {shown.caption}{" "}
        <span class="saves">
          <Button class="link" act={() => saveDrawing(shown.name, place.current!)} words="Save figure" />{" "}
          <Button class="link" act={() => saveRows(shown.name, rowsOf(drawnPanels))} words="Save numbers" />
        </span>
      </figcaption>
      <NumbersTable name={shown.name} rows={() => rowsOf(drawnPanels)} />
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
