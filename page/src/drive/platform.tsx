/** A platform on legs in a run: its answer, a view that mouse and keys turn, and the state of each leg. */

import type { ComponentChildren } from "preact";
import { useMemo, useRef, useState } from "preact/hooks";
import { BAR, digits } from "../plots/looks";
import { endsOf } from "../plots/scale";
import { onZoom, viewKeys } from "../plots/turning";
import { useWidth } from "../plots/width";
import { kept } from "../routes";
import type { Frame, Numbers } from "../server/frame";
import type { Finding, RunHead, SentLeg, SentPlatform } from "../server/generated";
import { Button, Table } from "../workspace/fields";
import { Answer } from "../workspace/result";

type Point = [x: number, y: number, z: number];
type Flat = [x: number, y: number];
/** Direction of view: turn about z and lift over the floor, degrees, and zoom. */
type Camera = [turn: number, lift: number, zoom: number];

const FREE: Camera = [-35, 22, 1];
const VIEWS = Object.entries<Camera>({ Front: [-90, 0, 1], Top: [-90, 90, 1], Free: FREE });
const STEP = 5; // degrees of a key
const CLOSER = 1.15;
const DRAG = 0.4; // degrees of a pixel
const SHARE = 0.62; // height over width of a view
const MOST_HIGH = 440;

const camera = kept("view3d");

/** Return the camera in the address. */
function cameraOf(words: string): Camera {
  const numbers = words.split(",").map(Number);
  return numbers.length === 3 && numbers.every(Number.isFinite) ? (numbers as Camera) : FREE;
}

const within = (value: number, low: number, high: number): number => Math.min(Math.max(value, low), high);

const limited = ([turn, lift, zoom]: Camera): Camera => [
  Math.round(((turn + 540) % 360) - 180),
  Math.round(within(lift, -90, 90)),
  within(Number(zoom.toFixed(2)), 0.5, 4),
];

/** Return a projection without perspective: `flat` gives pixels, `depth` grows towards the reader. */
function projection([turn, lift, zoom]: Camera, box: Box, width: number, height: number) {
  const [a, e] = [(turn * Math.PI) / 180, (lift * Math.PI) / 180];
  const scale = (zoom * Math.min(width, 1.05 * height)) / (2 * box.radius);
  const [cx, cy, cz] = box.centre;
  const near = ([x, y]: Point) => (x - cx) * Math.cos(a) + (y - cy) * Math.sin(a);
  return {
    flat: ([x, y, z]: Point): Flat => {
      const right = (y - cy) * Math.cos(a) - (x - cx) * Math.sin(a);
      const up = (z - cz) * Math.cos(e) - near([x, y, z]) * Math.sin(e);
      return [width / 2 + scale * right, height / 2 - scale * up];
    },
    depth: (point: Point) => near(point) * Math.cos(e) + point[2] * Math.sin(e),
  };
}

type Box = ReturnType<typeof boxOf>;
type Projected = ReturnType<typeof projection>["flat"];

/** Return the points of a run by sample: those of the moving parts, the origin of the platform, and the traced point. */
function samplesOf(platform: SentPlatform, points: Numbers): Point[][] {
  const count = platform.parts.reduce((sum, part) => sum + part.moving, 2);
  const at = (k: number): Point => [points[3 * k]!, points[3 * k + 1]!, points[3 * k + 2]!];
  return Array.from({ length: points.length / (3 * count) }, (_, sample) =>
    Array.from({ length: count }, (_, k) => at(sample * count + k)),
  );
}

/** Return the box around all points of a run. The radius of its sphere keeps the scale while the view turns. */
function boxOf(platform: SentPlatform, samples: Point[][]) {
  const all = [...samples.flat(), ...platform.parts.flatMap((part) => part.points), ...platform.reach];
  const ends = [0, 1, 2].map((axis) => endsOf(all.map((point) => point[axis]!)));
  const centre = ends.map(([low, high]) => (low + high) / 2) as Point;
  return { centre, ends, radius: Math.hypot(...ends.map(([low, high]) => (high - low) / 2)) || 1 };
}

/** Return the outline of points in the plane: their convex hull. */
function outline(points: Flat[]): Flat[] {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (of: Flat[]) => {
    const out: Flat[] = [];
    for (const c of of) {
      for (let [a, b] = out.slice(-2); b; [a, b] = out.slice(-2)) {
        if ((b[0] - a![0]) * (c[1] - a![1]) - (b[1] - a![1]) * (c[0] - a![0]) > 0) break;
        out.pop();
      }
      out.push(c);
    }
    return out.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

const text = (points: Flat[]): string => points.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join(" ");

const FLOOR = 6; // squares along the floor

function Floor({ box, flat }: { box: Box; flat: Projected }) {
  const [[left, right], [back, front], [low]] = box.ends as [Flat, Flat, Flat];
  const [half, [x, y]] = [0.7 * Math.max(right - left, front - back), box.centre];
  const line = (...ends: Flat[]) => `M${text(ends.map(([u, v]) => flat([x + u, y + v, low])))}`;
  const steps = Array.from({ length: FLOOR + 1 }, (_, k) => half * ((2 * k) / FLOOR - 1));
  const lines = steps.map((d) => line([d, -half], [d, half]) + line([-half, d], [half, d]));
  return <path class="floor" d={lines.join("")} />;
}

const AXIS = 44; // longest axis, pixels

function Axes({ flat, height }: { flat: Projected; height: number }) {
  const [x, y] = flat([0, 0, 0]);
  const along = (...end: Point): Flat => [flat(end)[0] - x, flat(end)[1] - y];
  const long = Math.hypot(...along(1, 1, 1)) || 1;
  const ends = Object.entries({ x: along(1, 0, 0), y: along(0, 1, 0), z: along(0, 0, 1) });
  return (
    <g class="axes" transform={`translate(${AXIS} ${Math.min(60, height / 4)})`}>
      {ends.map(([name, end]) => {
        const [u, v] = end.map((value) => (AXIS * value) / long) as Flat;
        return (
          <g key={name}>
            <path d={`M0 0L${u} ${v}`} />
            <text x={1.3 * u} y={1.3 * v + 4} text-anchor="middle">
              {name}
            </text>
          </g>
        );
      })}
    </g>
  );
}

const signed = (force: number): string => `${force < 0 ? "−" : "+"}${digits(Math.abs(force))} N`;

/** Bar of a force, from the largest pull to the largest push that the supply pressure gives at rest. */
function ForceBar({ force, limits: [low, high], width }: { force: number; limits: SentLeg["limits"]; width: number }) {
  const most = Math.max(Math.abs(low ?? force), Math.abs(high ?? force), 1e-9);
  const end = (value: number) => (width / 2) * (1 + within(value / most, -1, 1));
  const [from, to] = [Math.min(end(0), end(force)), Math.max(end(0), end(force))];
  const isOver = (high !== null && force > high) || (low !== null && force < low);
  return (
    <g class={`force ${force < 0 ? "pull" : "push"} ${isOver ? "over" : ""}`}>
      <rect class="room" x={low === null ? 0 : end(low)} width={end(high ?? most) - (low === null ? 0 : end(low))} />
      <rect class="bar" x={from} width={to - from} />
      <path d={`M${width / 2} -2V8`} />
    </g>
  );
}

interface SceneProps {
  now: Frame<RunHead>;
  platform: SentPlatform;
  sample: number;
  shown: Camera;
  width: number;
}

/** The lines of the platform at a sample, the farthest first. */
function Scene({ now, platform, sample, shown, width }: SceneProps) {
  const points = now.arrays.get(`platform/${platform.name}`)!;
  const samples = useMemo(() => samplesOf(platform, points), [points]);
  const box = useMemo(() => boxOf(platform, samples), [points]);
  const height = Math.min(MOST_HIGH, SHARE * width);
  const { flat, depth } = projection(shown, box, width, height);
  const moving = samples[sample]!;
  const [origin, tip] = moving.slice(-2) as [Point, Point];
  const traced = samples.map((each) => each.at(-1)!);
  let at = 0;
  const parts = platform.parts.map((part) => {
    const own = moving.slice(at, (at += part.moving));
    return { ...part, points: [...part.points, ...own] };
  });
  const line = (look: string, ...of: Point[]) => <polyline class={look} points={text(of.map(flat))} />;
  const linesOf = (of: typeof parts) => of.map((part) => line(part.part, ...part.points));
  const mean = (of: typeof parts) => {
    const all = of.flatMap((part) => part.points.map(depth));
    return all.reduce((sum, value) => sum + value, 0) / all.length;
  };
  const legs = platform.legs.map((leg, k) => {
    const of = parts.filter((part) => part.leg === k + 1);
    return { ...leg, of, now: now.arrays.get(`motion/${leg.force}`)![sample]! };
  });
  const body = parts.filter((part) => part.part === "platform");
  const groups = legs.map((leg) => {
    const barrel = leg.of.find((part) => part.part === "barrel")?.points;
    const piston = leg.of.find((part) => part.part === "piston")?.points;
    const drawn = (
      <g key={leg.name} data-leg={leg.name}>
        {linesOf(leg.of.filter((part) => part.part !== "piston"))}
        {barrel && piston && line("inside", ...barrel)}
        {barrel && piston && line(leg.now < 0 ? "gas pull" : "gas push", barrel[0]!, piston[0]!)}
        {linesOf(leg.of.filter((part) => part.part === "piston"))}
      </g>
    );
    return { depth: mean(leg.of), drawn };
  });
  const plate = (
    <g key="platform">
      {linesOf(body)}
      {line("normal", origin, tip)}
    </g>
  );
  const all = [...groups, { depth: mean(body), drawn: plate }].sort((a, b) => a.depth - b.depth);
  return (
    <svg
      role="img"
      width={width}
      height={height}
      style={{ "--thick": Math.max(0.5, width / 720) * shown[2] }}
      aria-label={`Platform ${platform.name} in three dimensions. The table of legs has its values.`}>
      <Floor box={box} flat={flat} />
      {platform.reach.length > 2 && <polygon class="reach" points={text(outline(platform.reach.map(flat)))} />}
      {linesOf(parts.filter((part) => part.part === "frame"))}
      {all.map((group) => group.drawn)}
      {platform.paths.map((path, k) => {
        const [x, y] = flat(path.points.at(-1)!);
        return (
          <g key={path.label} class={`other other-${k % 3}`} data-path={path.label}>
            {line("", ...path.points)}
            <text x={x + 8} y={y - 8}>
              {path.label}
            </text>
          </g>
        );
      })}
      {line("whole-path", ...traced)}
      {line("path", ...traced.slice(0, sample + 1))}
      <circle class="tip" cx={flat(tip)[0]} cy={flat(tip)[1]} r={5} />
      <Axes flat={flat} height={height} />
      {legs.map((leg) => {
        const { part, points } = leg.of[0]!; // a rod from the frame, or the guide of a carriage
        const [x, y] = flat(points[part === "guide" ? 1 : 0]!);
        const left = within(x, 90, width - 90) + (x < width / 2 ? -82 : 22);
        return (
          <g key={leg.name} transform={`translate(${left} ${Math.min(y, height - 30)})`}>
            <text class="name">{leg.name.replace(/_/g, " ")}</text>
            <text y={16}>{signed(leg.now)}</text>
            <g transform="translate(0 22)">
              <ForceBar force={leg.now} limits={leg.limits} width={60} />
            </g>
          </g>
        );
      })}
    </svg>
  );
}

/** State of each leg: piston in its stroke, force between its limits, and pressures. */
function Legs({ now, platform, sample }: { now: Frame<RunHead>; platform: SentPlatform; sample: number }) {
  const at = (column: string) => now.arrays.get(`motion/${column}`)?.[sample] ?? Number.NaN;
  const rows = platform.legs.map((leg) => {
    const cylinder = now.head.cylinders?.find((one) => one.name === leg.name);
    const across = leg.force.replace(/_force_n$/, "_side_force_n");
    const [force, side, x] = [at(leg.force), at(across), cylinder ? at(cylinder.position) : Number.NaN];
    return [
      leg.name.replace(/_/g, " "),
      cylinder && (
        <>
          <svg class="stroke" viewBox="0 0 100 14" preserveAspectRatio="none" aria-hidden="true">
            <rect y="5" width="100" height="4" />
            <rect class="at" x={96 * within(x / cylinder.stroke_m, 0, 1)} width="4" height="14" />
          </svg>
          {digits(1000 * x, 4)} of {digits(1000 * cylinder.stroke_m, 4)} mm
        </>
      ),
      <>
        <svg class="forces" width="88" height="12" aria-hidden="true">
          <g transform="translate(0 3)">
            <ForceBar force={force} limits={leg.limits} width={88} />
          </g>
        </svg>
        <span data-output={leg.force} data-si={force}>
          {signed(force)}
        </span>
        ,{" "}
        <span data-output={across} data-si={side}>
          {digits(side, 2)} N
        </span>
      </>,
      cylinder?.pressures.map((column) => digits(at(column) / BAR, 3)).join(", "),
    ];
  });
  const heads = ["Leg", "Piston", "Force, across", "a, b, bar abs"];
  return <Table class="legs" label={`Legs of ${platform.name}`} heads={heads} rows={rows} />;
}

/** Pose at a sample, as numbers. */
function Pose({ now, platform, sample }: { now: Frame<RunHead>; platform: SentPlatform; sample: number }) {
  const shown = platform.outputs.filter((one) => !one.column.endsWith("_force_n"));
  return (
    <dl class="leading" aria-label={`Pose of ${platform.name}`}>
      {shown.map(({ column, label, unit, size }) => {
        const value = now.arrays.get(`motion/${column}`)![sample]!;
        return (
          <div key={column}>
            <dt>{label}</dt>
            <dd class="number" data-output={column} data-si={value}>
              {digits(Math.round((1e6 * value) / size) / 1e6, 4)} {unit}
            </dd>
          </div>
        );
      })}
    </dl>
  );
}

/** The view of a platform with what turns it. `children` moves the time. */
export default function PlatformAt(props: {
  now: Frame<RunHead>;
  platform: SentPlatform;
  sample: number;
  remedy?: ((of: Finding) => ComponentChildren) | undefined;
  children: ComponentChildren;
}) {
  const { now, platform, sample, remedy, children } = props;
  const [turning, turnTo] = useState<Camera | null>(null);
  const from = useRef<{ x: number; y: number; camera: Camera } | null>(null);
  const [place, width] = useWidth<HTMLDivElement>();
  const shown = turning ?? cameraOf(camera.value);
  const put = (next: Camera) => (camera.value = limited(next).join());
  const by = (turn: number, lift: number, zoom = 1) => put([shown[0] + turn, shown[1] + lift, shown[2] * zoom]);
  const zoom = (way: 1 | -1) => by(0, 0, CLOSER ** way);
  const keys = viewKeys({ zoom, reset: () => put(FREE), step: (right, down) => by(-STEP * right, -STEP * down) });
  const end = () => {
    if (turning) put(turning);
    turnTo((from.current = null));
  };
  return (
    <section
      class="platform"
      aria-label={`Platform ${platform.name}`}
      data-platform={platform.name}
      data-sample={sample}>
      <Answer view={platform.view} remedy={remedy} />
      <div class="result">
        <div class="panel scene">
          <div class="row">
            <span class="note" id={`keys-${platform.name}`}>
              Drag or press the arrow keys to turn, + and − to zoom.
            </span>
            {VIEWS.map(([name, view]) => (
              <Button key={name} act={() => put(view)} words={name} />
            ))}
          </div>
          <div
            ref={place}
            class="turned"
            tabIndex={0}
            role="group"
            aria-label={`View of ${platform.name}, turned ${Math.round(shown[0])} degrees, lifted ${Math.round(shown[1])} degrees`}
            aria-describedby={`keys-${platform.name}`}
            onKeyDown={keys}
            onWheel={onZoom(zoom)}
            onPointerDown={(event) => {
              from.current = { x: event.clientX, y: event.clientY, camera: shown };
              event.currentTarget.setPointerCapture(event.pointerId);
            }}
            onPointerUp={end}
            onPointerCancel={end}
            onPointerMove={(event) => {
              const start = from.current;
              if (!start) return;
              const [turn, lift, zoom] = start.camera;
              const [right, down] = [event.clientX - start.x, event.clientY - start.y];
              turnTo(limited([turn - DRAG * right, lift + DRAG * down, zoom]));
            }}>
            {width > 0 && <Scene now={now} platform={platform} sample={sample} shown={shown} width={width} />}
          </div>
          {children}
          <p class="note">
            Line: path of the {platform.traced}
            {platform.reach.length > 2 && "; shade: outline of its workspace"}. Bars: force along each leg, between its
            largest pull and push at rest.
          </p>
        </div>
        <aside>
          <div class="panel">
            <Pose now={now} platform={platform} sample={sample} />
          </div>
          <div class="panel">
            <Legs now={now} platform={platform} sample={sample} />
          </div>
        </aside>
      </div>
    </section>
  );
}
