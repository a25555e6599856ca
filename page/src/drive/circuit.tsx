/** Drawing of a circuit: shapes from the server become SVG elements one by one, never parsed text. */
import type { JSX } from "preact";
import { useRef, useState } from "preact/hooks";

export interface Shape {
  word: string;
  points: [number, number][];
  component: string;
  size: number;
  text: string;
  align: string;
  angles: [number, number];
}

export interface Drawing {
  paper: [number, number, number, number];
  shapes: Shape[];
  pistons: Record<string, PistonShapes>;
}

/**
 * Places of a cylinder in the drawing: corners of the barrel, faces of the piston, and points that move with the
 * piston.
 */
export interface PistonShapes {
  barrel: [number, number, number, number];
  piston: [number, number];
  moves: Record<number, boolean[]>;
}

/**
 * State of a cylinder at a moment: fraction of its stroke, and for each chamber the pressure as text and relative
 * to the largest.
 */
export interface Moved {
  share: number;
  pressures: [string, string];
  tints: [number, number];
  said: string;
  position: number;
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

function drawn(shape: Shape): JSX.Element {
  const [x, y] = [shape.points[0]![0], -shape.points[0]![1]];
  const points = shape.points.map(([px, py]) => `${px},${-py}`).join(" ");
  switch (shape.word) {
    case "line":
    case "thick":
    case "dashed":
      return <polyline points={points} class={`stroke ${shape.word}`} />;
    case "triangle":
    case "head":
      return <polygon points={points} class={`stroke ${shape.word}`} />;
    case "dot":
      return <circle cx={x} cy={y} r={shape.size} class="head" />;
    case "arc":
      return <path d={arc(x, y, shape.size, shape.angles)} class="stroke" />;
    default: {
      const [align, top] = shape.align.split(" ");
      return (
        <text
          x={x}
          y={y}
          font-size={shape.size * PT}
          text-anchor={ANCHOR[align ?? "center"]}
          dominant-baseline={top ? "hanging" : "central"}
          class={shape.size === 7 ? "name" : ""}
        >
          {shape.text}
        </text>
      );
    }
  }
}

function arc(x: number, y: number, r: number, [low, high]: [number, number]): string {
  const at = (angle: number) => {
    const radians = (angle * Math.PI) / 180;
    return `${x + r * Math.cos(radians)} ${y - r * Math.sin(radians)}`;
  };
  const middle = 0.5 * (low + high);
  return `M ${at(low)} A ${r} ${r} 0 0 0 ${at(middle)} A ${r} ${r} 0 0 0 ${at(high)}`;
}

/** The chambers of a cylinder: a higher pressure has a stronger tint, and its value is written in the chamber. */
function Chambers({ at, moved, name }: { at: PistonShapes; moved: Moved; name: string }) {
  const [left, low, right, high] = at.barrel;
  const face = pistonAt(at, moved.share);
  const wide = at.piston[1] - at.piston[0];
  return (
    <g role="img" aria-label={moved.said} data-piston={name} data-position={moved.position}>
      <rect class="air" x={left} y={-high} width={face - left} height={high - low} fill-opacity={moved.tints[0]} />
      <rect class="air" x={face + wide} y={-high} width={right - face - wide} height={high - low} fill-opacity={moved.tints[1]} />
      <text x={left + 1.5} y={-low + 0.8} font-size={6 * PT}>a {moved.pressures[0]}</text>
      <text x={right - 1.5} y={-low + 0.8} font-size={6 * PT} text-anchor="end">b {moved.pressures[1]}</text>
    </g>
  );
}

type Box = [left: number, top: number, width: number, height: number];

const whole = ({ paper: [left, bottom, right, top] }: Drawing): Box => [left, -top, right - left, top - bottom];
const CLOSER = 1.25; // by a step of zoom
const WIDEST = 3; // times the drawing
const PAN = 0.15; // of the view, by a key

/** The circuit with zoom and pan: buttons, keys, dragging, and the wheel with Ctrl. */
export function ZoomedCircuit(props: { drawing: Drawing; chosen: string; onChoose: (component: string) => void }) {
  const [box, setBox] = useState<Box | null>(null);
  const from = useRef<{ x: number; y: number; box: Box } | null>(null);
  const now = box ?? whole(props.drawing);
  const zoom = (by: number, [px, py] = [0.5, 0.5]) => {
    const width = Math.min(now[2] / by, WIDEST * whole(props.drawing)[2]);
    const share = width / now[2];
    setBox([now[0] + px * now[2] * (1 - share), now[1] + py * now[3] * (1 - share), width, now[3] * share]);
  };
  const pan = (x: number, y: number, of = now) => setBox([of[0] + x * of[2], of[1] + y * of[3], of[2], of[3]]);
  const keys: Record<string, () => void> = {
    "+": () => zoom(CLOSER), "=": () => zoom(CLOSER), "-": () => zoom(1 / CLOSER), "0": () => setBox(null),
    ArrowLeft: () => pan(-PAN, 0), ArrowRight: () => pan(PAN, 0), ArrowUp: () => pan(0, -PAN), ArrowDown: () => pan(0, PAN),
  };
  return (
    <div
      class="canvas"
      onKeyDown={(event) => keys[event.key] && (event.preventDefault(), keys[event.key]!())}
      onWheel={(event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        const at = event.currentTarget.getBoundingClientRect();
        zoom(event.deltaY < 0 ? CLOSER : 1 / CLOSER, [(event.clientX - at.left) / at.width, (event.clientY - at.top) / at.height]);
      }}
      onPointerDown={(event) => (from.current = { x: event.clientX, y: event.clientY, box: now })}
      onPointerUp={() => (from.current = null)}
      onPointerLeave={() => (from.current = null)}
      onPointerMove={(event) => {
        const start = from.current;
        const at = event.currentTarget.getBoundingClientRect();
        if (start && event.buttons) pan((start.x - event.clientX) / at.width, (start.y - event.clientY) / at.height, start.box);
      }}
    >
      <Circuit {...props} box={now} />
      <p class="tools" role="group" aria-label="Zoom of the drawing">
        <button type="button" aria-label="Closer" onClick={() => zoom(CLOSER)}>+</button>
        <button type="button" aria-label="Wider" onClick={() => zoom(1 / CLOSER)}>−</button>
        <button type="button" aria-label="Fit the drawing" disabled={!box} onClick={() => setBox(null)}>Fit</button>
      </p>
    </div>
  );
}

export function Circuit(props: { drawing: Drawing; box?: Box; chosen?: string; onChoose?: (component: string) => void; moved?: Record<string, Moved> }) {
  const names = [...new Set(props.drawing.shapes.map((one) => one.component))];
  return (
    <svg class="circuit" viewBox={(props.box ?? whole(props.drawing)).join(" ")} role="group" aria-label="Circuit, symbols after ISO 1219">
      {names.map((name) => {
        const [at, moved] = [props.drawing.pistons[name], props.moved?.[name]];
        const own = props.drawing.shapes.flatMap((one, number) => (one.component !== name ? [] : [at && moved ? movedShape(one, number, at, moved.share) : one]));
        if (!name || !props.onChoose)
          return (
            <g key={name}>
              {at && moved && <Chambers at={at} moved={moved} name={name} />}
              {own.map(drawn)}
            </g>
          );
        const choose = () => props.onChoose?.(name);
        return (
          <g
            key={name}
            data-key={name}
            role="button"
            tabindex={0}
            aria-pressed={props.chosen === name}
            class="component"
            onClick={choose}
            onKeyDown={(event) => {
              if (event.key === "Enter" || event.key === " ") {
                event.preventDefault();
                choose();
              }
            }}
          >
            <Area shapes={own} />
            {own.map(drawn)}
          </g>
        );
      })}
    </svg>
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
