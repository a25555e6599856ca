/**
 * Drawing of a circuit, at rest and at a time of a run. Shapes from the server become SVG elements one by one, never parsed
 * text.
 */

import { signal } from "@preact/signals";
import type { ComponentChildren, JSX } from "preact";
import { useEffect, useState } from "preact/hooks";
import { BAR, digits, instant, MM } from "../plots/looks";
import { indexAt } from "../plots/plot";
import { onZoom, viewKeys } from "../plots/turning";
import type { Frame, Numbers } from "../server/frame";
import type { CircuitDrawing as Drawing, Finding, PistonShapes, RunHead, Shape } from "../server/generated";
import { Button, Fold, lazy, Range } from "../workspace/fields";

export type { Drawing, PistonShapes, Shape };

/** Ports that can be clicked, and the selected one. */
export interface PortChoice {
  port: string;
  onPort: (port: string) => void;
}

/**
 * Return a shape with its moving points at the position of the piston. A fraction beyond 0 to 1 stays in the
 * barrel.
 */
export function movedShape(shape: Shape, number: number, at: PistonShapes, share: number): Shape {
  const moves = at.moves[number];
  if (!moves) return shape;
  const by = pistonAt(at, share) - at.piston[0];
  return { ...shape, points: shape.points.map(([x, y], i) => [moves[i] ? x + by : x, y]) };
}

/** Return the left face of the piston. */
export function pistonAt({ barrel, piston }: PistonShapes, share: number): number {
  const free = barrel[2] - barrel[0] - (piston[1] - piston[0]);
  return barrel[0] + Math.min(Math.max(share, 0), 1) * free;
}

const PT = 1 / 7.2; // modules of 0.1 inch
const ANCHOR: Record<string, "start" | "middle" | "end"> = { left: "start", center: "middle", right: "end" };

const pointsOf = ({ points }: Shape): string => points.map(([x, y]) => `${x},${-y}`).join(" ");

function drawn(shape: Shape): JSX.Element {
  const [x, y] = [shape.points[0]![0], -shape.points[0]![1]];
  const points = pointsOf(shape);
  switch (shape.word) {
    case "triangle":
    case "head":
      return <polygon points={points} class={`stroke ${shape.word}`} />;
    case "dot":
      return <circle cx={x} cy={y} r={shape.size} class="head" />;
    case "text": {
      const [align, top] = shape.align.split(" ");
      return (
        <text
          x={x}
          y={y}
          font-size={shape.size * PT}
          text-anchor={ANCHOR[align ?? "center"]}
          dominant-baseline={top ? "hanging" : "central"}
          class={shape.size === 7 ? "name" : ""}>
          {shape.text}
        </text>
      );
    }
    default:
      return <polyline points={points} class={`stroke ${shape.word}`} />;
  }
}

/** The chambers of a cylinder: a higher pressure has a stronger tint, and its value is written in the chamber. */
function Chambers({ at, moved, name }: { at: PistonShapes; moved: Moved; name: string }) {
  const [left, low, right, high] = at.barrel;
  const face = pistonAt(at, moved.share);
  const behind = face + at.piston[1] - at.piston[0];
  const air = (x: number, end: number, tint: number) => (
    <rect class="air" x={x} y={-high} width={Math.max(end - x, 0)} height={high - low} fill-opacity={tint} />
  );
  return (
    <g role="img" aria-label={moved.said} data-piston={name} data-position={moved.position}>
      {air(left, face, moved.tints[0]!)}
      {air(behind, right, moved.tints[1]!)}
      <text x={left + 1.5} y={-low + 0.8} font-size={6 * PT}>
        a {moved.pressures[0]}
      </text>
      <text x={right - 1.5} y={-low + 0.8} font-size={6 * PT} text-anchor="end">
        b {moved.pressures[1]}
      </text>
    </g>
  );
}

type Box = [left: number, top: number, width: number, height: number];

const EDGE = 2; // modules around everything

const BOX = 4; // modules by which a valve moves to its next box

/** Return the view of the whole drawing, with room at its sides for valves that move. */
export function whole({ box: [left, low, right, high] }: Drawing, motion?: Motion): Box {
  const side = EDGE + (motion && Object.keys(motion.shifts).length ? BOX : 0);
  return [left - side, -high - EDGE, right - left + 2 * side, high - low + 2 * EDGE];
}

const CLOSER = 1.25; // by a step of zoom
const WIDEST = 3; // times the drawing
const PAN = 0.15; // of the view, by a key

/** The circuit with zoom and pan: buttons, keys, dragging, and the wheel with Ctrl. */
export function ZoomedCircuit(props: CircuitProps) {
  const [box, setBox] = useState<Box | null>(null);
  const all = whole(props.drawing, props.motion);
  const now = box ?? all;
  const zoom = (way: number, [px, py] = [0.5, 0.5]) => {
    const width = Math.min(now[2] / CLOSER ** way, WIDEST * all[2]);
    const share = width / now[2];
    setBox([now[0] + px * now[2] * (1 - share), now[1] + py * now[3] * (1 - share), width, now[3] * share]);
  };
  const pan = (x: number, y: number) =>
    setBox((old) => {
      const [left, top, width, height] = old ?? all;
      return [left + x * width, top + y * height, width, height];
    });
  const keys = viewKeys({ zoom, reset: () => setBox(null), step: (x, y) => pan(PAN * x, PAN * y) });
  return (
    <div
      class="canvas"
      onKeyDown={keys}
      onWheel={onZoom((way, event) => {
        const at = event.currentTarget.getBoundingClientRect();
        zoom(way, [(event.clientX - at.left) / at.width, (event.clientY - at.top) / at.height]);
      })}
      onPointerMove={({ buttons, movementX, movementY, currentTarget: { clientWidth, clientHeight } }) =>
        buttons && pan(-movementX / clientWidth, -movementY / clientHeight)
      }>
      <Circuit {...props} box={now} />
      <p class="tools" role="group" aria-label="Zoom of the drawing">
        <Button aria-label="Closer" act={() => zoom(1)} words="+" />
        <Button aria-label="Wider" act={() => zoom(-1)} words="−" />
        <Button aria-label="Fit the drawing" disabled={!box} act={() => setBox(null)} words="Fit" />
      </p>
    </div>
  );
}

interface CircuitProps {
  drawing: Drawing;
  box?: Box;
  chosen?: string;
  onChoose?: (component: string) => void;
  motion?: Motion | undefined;
  ports?: PortChoice | undefined;
  onLine?: (net: number) => void;
}

const tinted = (share: number) => `color-mix(in oklab, var(--accent) ${Math.round(100 * share)}%, var(--edge))`;

export function Circuit(props: CircuitProps) {
  const { drawing, motion } = props;
  const names = [...new Set(drawing.shapes.map((one) => one.component))].filter(Boolean);
  const all = whole(drawing, motion);
  return (
    <svg
      class="circuit"
      viewBox={(props.box ?? all).join(" ")}
      style={{ aspectRatio: `${all[2]} / ${all[3]}` }}
      role="group"
      aria-label="Circuit, symbols after ISO 1219">
      {drawing.nets.map((pins, net) => {
        const { share, said } = motion?.lines[net] ?? { share: undefined, said: endsOf(pins) };
        const own = drawing.shapes.filter((one) => one.net === net);
        return (
          <g
            key={`net ${net}`}
            class="net"
            data-net={said}
            data-share={share}
            style={share === undefined ? undefined : { color: tinted(share) }}
            onPointerEnter={() => props.onLine?.(net)}
            onPointerLeave={() => props.onLine?.(-1)}>
            <title>{said}</title>
            {own.map((one) => one.word !== "dot" && <polyline class="reach" points={pointsOf(one)} />)}
            {own.map(drawn)}
          </g>
        );
      })}
      {drawing.shapes.filter((one) => !one.component && one.net < 0).map(drawn)}
      {names.map((name) => {
        const [at, moved, shift] = [drawing.pistons[name], motion?.pistons[name], motion?.shifts[name]];
        const own = drawing.shapes.flatMap((one, number) =>
          one.component !== name ? [] : [at && moved ? movedShape(one, number, at, moved.share) : one],
        );
        const shapes =
          shift === undefined ? (
            own.map(drawn)
          ) : (
            <Shifted name={name} shapes={own} ports={Object.values(drawing.ports[name]!)} by={shift} />
          );
        const { onChoose } = props;
        const button = onChoose && {
          "data-key": name,
          role: "button" as const,
          tabindex: 0,
          class: "component",
          "aria-pressed": props.chosen === name,
          ...pressed(() => onChoose(name)),
        };
        return (
          <g key={name} {...button}>
            {button && <Area shapes={own} />}
            {at && moved && <Chambers at={at} moved={moved} name={name} />}
            {shapes}
          </g>
        );
      })}
      {props.ports &&
        Object.entries(drawing.ports).flatMap(([name, own]) =>
          Object.entries(own).map(([port, at]) => (
            <PortMark key={`${name}.${port}`} id={`${name}.${port}`} at={at} of={props.ports!} />
          )),
        )}
    </svg>
  );
}

/** A valve whose boxes are moved. Its ports and the marks of its exhausts stay, and its label makes room. */
function Shifted(props: { name: string; shapes: Shape[]; ports: [number, number][]; by: number }) {
  const { name, shapes, ports, by } = props;
  const boxes = shapes.filter((one) => one.word === "line" && one.points.length > 3);
  const ys = boxes.flatMap((one) => one.points.map(([, y]) => -y));
  const [top, bottom] = [Math.min(...ys), Math.max(...ys)];
  const clip = `spool-${name}`;
  return (
    <>
      <clipPath id={clip}>
        <rect x={-1e4} y={top - 0.6} width={2e4} height={bottom - top + 1.2} />
      </clipPath>
      <g clip-path={`url(#${clip})`}>
        <g data-shift={by} transform={`translate(${by} 0)`}>
          {shapes.filter((one) => one.word !== "text" && one.word !== "triangle").map(drawn)}
        </g>
      </g>
      {ports.map(([x, y]) => (
        <polyline class="stroke" points={`${x},${-y} ${x},${-y < top ? top : bottom}`} />
      ))}
      {shapes.filter((one) => one.word === "triangle").map(drawn)}
      <g transform={`translate(${Math.max(by, 0)} 0)`}>{shapes.filter((one) => one.word === "text").map(drawn)}</g>
    </>
  );
}

/** Handlers of a drawn button: a click, Enter and the space bar act. */
const pressed = (act: () => void) => {
  const choose = (event: Event) => {
    event.preventDefault();
    event.stopPropagation();
    act();
  };
  const onKeyDown = (event: KeyboardEvent) => (event.key === "Enter" || event.key === " ") && choose(event);
  return { onClick: choose, onKeyDown };
};

/** Port that can be selected and joined with another one. */
function PortMark({ id, at: [x, y], of }: { id: string; at: [number, number]; of: PortChoice }) {
  return (
    <circle
      class="port"
      cx={x}
      cy={-y}
      r={0.55}
      role="button"
      tabindex={0}
      aria-label={`Port ${id}`}
      aria-pressed={of.port === id}
      {...pressed(() => of.onPort(id))}>
      <title>{id}</title>
    </circle>
  );
}

/** Clickable rectangle around a symbol. */
function Area({ shapes }: { shapes: Shape[] }) {
  const points = shapes.filter((one) => one.word !== "text").flatMap((one) => one.points);
  if (!points.length) return null;
  const xs = points.map(([x]) => x);
  const ys = points.map(([, y]) => -y);
  const [x, y] = [Math.min(...xs) - 0.5, Math.min(...ys) - 0.5];
  return <rect class="area" x={x} y={y} width={Math.max(...xs) - x + 0.5} height={Math.max(...ys) - y + 0.5} />;
}

const GRAM = 1e-3;
const CALM = typeof matchMedia === "undefined" ? null : matchMedia("(prefers-reduced-motion: reduce)");
const FASTEST_MS = 5000; // a longer run is shown in this time, a shorter one as long as it lasts, but at least:
const SHORTEST_MS = 1500;

/** Time at which the drawing is shown: the slider's, or that of the pointer on a plot. */
export const timeAt = signal(0);
export const isPlaying = signal(false);

const PlatformAt = lazy(() => import("./platform"));

export function pointAt(time: number): void {
  if (!isPlaying.value) timeAt.value = time;
}

function largestOf(values: ArrayLike<number>): number {
  let found = values[0] ?? 1;
  for (let i = 1; i < values.length; i++) if (values[i]! > found) found = values[i]!;
  return found;
}

/** Return the index of a row of the run among the samples of the motion. */
const sampleAt = ({ arrays }: Frame<RunHead>, row: number): number =>
  indexAt(arrays.get("motion/time_s") ?? [], arrays.get("time_s")![row]!);

/** Return the pistons at a row of the run. Plots leave out the ninth curve, which the drawing may have. */
export function pistonsAt(now: Frame<RunHead>, row: number) {
  const { head, arrays } = now;
  const at = sampleAt(now, row);
  const columnOf = (name: string): ArrayLike<number> => arrays.get(name) ?? arrays.get(`motion/${name}`) ?? [];
  const momentOf = (name: string) => (arrays.get(`${name}/at`) ?? arrays.get(name))?.[row] ?? columnOf(name)[at];
  const pistons = (head.cylinders ?? []).flatMap(({ name, stroke_m, position: column, pressures: columns }) => {
    const position = momentOf(column);
    if (position === undefined) return [];
    const values = columns.map(momentOf);
    const most = Math.max(...columns.map((each) => largestOf(columnOf(each))));
    const pressures = values.map((value) => `${digits(value && value / BAR, 3)} bar`);
    const words = `position ${digits(position / MM)} mm, chamber a ${pressures[0]}, chamber b ${pressures[1]}`;
    const tints = values.map((value = 0) => (0.7 * value) / most);
    const speed = momentOf(column.replace("position_m", "velocity_m_s"));
    const said = `${name}: ${words}, absolute`;
    return [[name, { share: position / stroke_m, position, speed, pressures, tints, said }] as const];
  });
  return Object.fromEntries(pistons);
}

export type Moved = ReturnType<typeof pistonsAt>[string];

/**
 * Return the state of the drawing at a row of the run: cylinders, the way of each valve in modules, and lines by their
 * number. Pressures are fractions of the largest, and texts.
 */
function motionAt(now: Frame<RunHead>, drawing: Drawing, row: number) {
  const { arrays } = now;
  const at = sampleAt(now, row);
  const first = (...names: (string | false)[]): Numbers | undefined =>
    names.map((one) => arrays.get(`motion/${one}`)).find(Boolean);
  const isDrive = arrays.has("motion/command");
  const shifts = Object.keys(drawing.ports).flatMap((name) => {
    const spool = first(`${name}.position`, `${name}.command`, isDrive && name === "valve" && "command");
    return spool ? [[name, BOX * Math.max(-1, Math.min(1, spool[at]!))] as const] : [];
  });
  const pressureOf = ([name, port]: [string, string]) =>
    first(`${name}.${port}.pressure_pa`, isDrive && `pressure_${port}_pa`, `${name}.pressure_pa`);
  const flowOf = ([name, port]: [string, string]) =>
    first(
      `${name}.${port}.mass_flow_kg_s`,
      `${name}.mass_flow_${port}_kg_s`,
      isDrive && `mass_flow_${port}_kg_s`,
      `${name}.mass_flow_kg_s`,
    );
  const known = drawing.nets.map((pins) => ({
    pins,
    pressure: pins.map(pressureOf).find(Boolean),
    flow: pins.length === 2 ? pins.map(flowOf).find(Boolean) : undefined,
  }));
  const most = Math.max(1, ...known.flatMap((one) => (one.pressure ? [largestOf(one.pressure)] : [])));
  const lines = known.map(({ pins, pressure, flow }) => {
    const absolute = pressure && `${digits(pressure[at]! / BAR, 3)} bar absolute`;
    const moving = flow && `${digits(Math.abs(flow[at]!) / GRAM, 2)} g/s`;
    return {
      share: pressure && pressure[at]! / most,
      said: [endsOf(pins), absolute, moving].filter(Boolean).join(", "),
    };
  });
  return { pistons: pistonsAt(now, row), shifts: Object.fromEntries(shifts), lines };
}

export type Motion = ReturnType<typeof motionAt>;

export const endsOf = (pins: [string, string][]): string => pins.map((pin) => pin.join(".")).join(" – ");

/** Show the drawing at another time. */
export const moveTo = (time: number): void => void ([isPlaying.value, timeAt.value] = [false, time]);

/** Time of a run as a slider, and Play. With "reduced motion", only the slider moves it. */
function TimeSlider({ now, words }: { now: Frame<RunHead>; words: string }) {
  const time = now.arrays.get("time_s")!;
  const end = time[time.length - 1]!;
  const at = Math.min(timeAt.value, end);
  const shown = instant(time[indexAt(time, at)], end / time.length);
  useEffect(() => {
    if (!isPlaying.value) return;
    const lasts = Math.min(Math.max(1000 * end, SHORTEST_MS), FASTEST_MS);
    const began = performance.now() - (timeAt.value >= end ? 0 : (timeAt.value / end) * lasts);
    let request = requestAnimationFrame(function draw(clock: number) {
      const share = Math.max(0, (clock - began) / lasts);
      timeAt.value = Math.min(share, 1) * end;
      if (share >= 1) isPlaying.value = false;
      else request = requestAnimationFrame(draw);
    });
    return () => cancelAnimationFrame(request);
  }, [isPlaying.value, end]);
  return (
    <p class="row time">
      {!CALM?.matches && (
        <Button class="primary" act={() => (isPlaying.value = !isPlaying.value)}>
          {isPlaying.value ? "Stop" : "Play"}
        </Button>
      )}
      <Range label="Time" value={at} ends={[0, end]} words={`${shown} s`} steps={1000} put={moveTo} />
      <output>
        {shown} s{words}
      </output>
    </p>
  );
}

/**
 * A run at a chosen or running time: its platforms, or its circuit. `children` draws the circuit in its state, which
 * is folded below a platform.
 */
export function MovingCircuit(props: {
  now: Frame<RunHead>;
  drawing: Drawing;
  remedy?: (of: Finding) => ComponentChildren; // of a platform
  children: (motion: Motion) => ComponentChildren;
}) {
  const { now, drawing, remedy, children } = props;
  const time = now.arrays.get("time_s")!;
  const row = indexAt(time, Math.min(timeAt.value, time[time.length - 1]!));
  const platforms = now.head.platforms ?? [];
  const motion = motionAt(now, drawing, row);
  const cylinders = now.head.cylinders ?? [];
  const places = cylinders.map((one) => `, ${one.name} at ${digits(motion.pistons[one.name]!.position / MM)} mm`);
  const drawn = children(motion);
  const sample = sampleAt(now, row);
  return (
    <figure class="motion" data-row={row}>
      {platforms.map((one, k) => (
        <PlatformAt key={one.name} now={now} platform={one} remedy={remedy} sample={sample}>
          {k === 0 && <TimeSlider now={now} words={` of ${digits(time[time.length - 1])} s`} />}
        </PlatformAt>
      ))}
      {platforms.length ? <Fold class="panel" title="Circuit" children={drawn} /> : drawn}
      {!platforms.length && <TimeSlider now={now} words={`${places.join("")}; pressures absolute`} />}
      {!platforms.length && !cylinders.length && (
        <p class="note" data-without="motion">
          No piston moves in the drawing: only double-acting cylinders are animated, and this circuit does not contain
          one.
        </p>
      )}
    </figure>
  );
}
