/** A friction map as a surface over speed and pressure, with its points; turned by the mouse, or by sliders. */
import { signal } from "@preact/signals";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { colour } from "./heat";
import { digits, isDark } from "./looks";
import { byCell, draw, TALL, type Axis, type Scene } from "./space";
import { ticks } from "./strip";

export interface Level {
  label: string;
  groups: number[];
  at: number[];
  friction: number[][] | null;
  inside: boolean[][] | null;
  expected: number[][] | null;
}

export interface Surfaces {
  chamber: "a" | "b";
  fit: string;
  speeds: number[];
  gauges: number[];
  levels: Level[];
}

interface Measured {
  recording: string;
  speed: number;
  friction: number;
}

const MM = 1000;
const BAR = 1e5;
const NEAR = 12; // pixels from a point to the mouse
const DEGREES = 0.4; // per pixel
const VIEWS: [string, number, number][] = [
  ["Slanted", -35, 25],
  ["Over speed", 0, 0],
  ["Over pressure", -90, 0],
  ["From above", 0, 90],
];

const turn = signal(-35);
const tilt = signal(25);
const round = (degrees: number) => ((((degrees + 180) % 360) + 360) % 360) - 180;

/** The decades between two values, and their parts where there are few. */
export function logTicks(low: number, high: number): number[] {
  const out: number[] = [];
  const parts = high / low > 1000 ? [1] : [1, 2, 5];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++)
    for (const part of parts) out.push(Number((part * 10 ** power).toPrecision(3)));
  return out.filter((one) => one >= low * (1 - 1e-9) && one <= high * (1 + 1e-9));
}

/** A level in the box that is drawn, and what is to be said of it in words. */
export function sceneOf(of: Surfaces, level: Level, groups: { points: Measured[] }[]) {
  const measured = level.groups.flatMap((group, k) =>
    groups[group]!.points.map((one, n) => ({ ...one, gauge: level.at[k]!, expected: level.expected?.[k]?.[n] ?? null })),
  );
  const heights = [...measured.map((one) => one.friction), ...(level.friction?.flat() ?? [])];
  const [least, most] = heights.reduce(([a, b], one) => [Math.min(a, one), Math.max(b, one)], [Infinity, -Infinity]);
  const [slow, fast] = [of.speeds[0]!, of.speeds.at(-1)!];
  const [low, high] = [of.gauges[0]!, of.gauges.at(-1)!];
  const bottom = Math.min(0, least);
  const x = (speed: number) => Math.log(speed / slow) / Math.log(fast / slow) - 0.5;
  const y = (gauge: number) => (gauge - low) / (high - low) - 0.5;
  const z = (friction: number) => (TALL * (friction - bottom)) / (1.05 * most - bottom);
  const axis = (title: string, at: number[], place: (value: number) => number, size: number): Axis => ({ title, ticks: at.map((one) => ({ at: place(one / size), text: digits(one, 4) })) });
  const scene: Scene = {
    x: of.speeds.map(x),
    y: of.gauges.map(y),
    z: level.friction?.map((row) => row.map(z)) ?? null,
    inside: level.inside,
    points: measured.map((one) => ({ x: x(one.speed), y: y(one.gauge), z: z(one.friction), foot: z(one.expected ?? bottom) })),
    axes: [
      axis("speed, mm/s", logTicks(MM * slow, MM * fast), x, MM),
      axis(`chamber ${of.chamber}, bar gauge`, ticks(low / BAR, high / BAR, 4), y, 1 / BAR),
      axis("friction, N", ticks(bottom, most, 5), z, 1),
    ],
  };
  const share = (height: number) => ((height / TALL) * (1.05 * most - bottom) + bottom - least) / (most - least || 1);
  return { scene, measured, share, words: wordsOf(of, level, measured, [least, most]) };
}

type Placed = Measured & { gauge: number; expected: number | null };

function wordsOf(of: Surfaces, level: Level, measured: Placed[], [least, most]: [number, number]): string {
  const over = `friction from ${digits(least, 3)} to ${digits(most, 3)} N over speed, ${digits(MM * of.speeds[0]!, 3)} to ${digits(MM * of.speeds.at(-1)!, 3)} mm/s, and chamber ${of.chamber}, ${digits(of.gauges[0]! / BAR, 3)} to ${digits(of.gauges.at(-1)! / BAR, 3)} bar gauge; ${level.label}; ${measured.length} points`;
  if (!level.inside) return over;
  const every = level.inside.flat();
  const beyond = Math.round((100 * every.filter((one) => !one).length) / every.length);
  const off = (one: Placed) => Math.abs(one.friction - one.expected!);
  const worst = measured.reduce((a, b) => (off(b) > off(a) ? b : a));
  return `${over}, the one farthest from the fit by ${digits(off(worst), 3)} N at ${digits(MM * worst.speed, 3)} mm/s and ${digits(worst.gauge / BAR, 3)} bar; ${beyond} % of the surface is extrapolated`;
}

export function SurfaceFigure({ of, groups }: { of: Surfaces; groups: { points: Measured[] }[] }) {
  const [chosen, choose] = useState(0);
  const level = of.levels[chosen] ?? of.levels[0];
  if (!level) return <p class="note" data-surface="none">There is no surface: it takes two speeds, and two pressures of one chamber at one pressure of the other.</p>;
  return (
    <figure class="plot surface" data-surface={level.groups.length}>
      <figcaption>Friction as a surface over speed and pressure, {level.label}</figcaption>
      <div class="row">
        {of.levels.length > 1 && (
          <label>
            Surface at <select value={chosen} onChange={(event) => choose(Number(event.currentTarget.value))}>{of.levels.map((one, k) => <option key={one.label} value={k}>{one.label}</option>)}</select>
          </label>
        )}
        <label>
          Turn <input type="range" min={-180} max={180} value={turn.value} aria-valuetext={`${turn.value} degrees`} onInput={(event) => (turn.value = event.currentTarget.valueAsNumber)} />
        </label>
        <label>
          Tilt <input type="range" min={0} max={90} value={tilt.value} aria-valuetext={`${tilt.value} degrees`} onInput={(event) => (tilt.value = event.currentTarget.valueAsNumber)} />
        </label>
        {VIEWS.map(([name, a, e]) => <button key={name} type="button" onClick={() => ([turn.value, tilt.value] = [a, e])}>{name}</button>)}
      </div>
      <Drawn of={of} level={level} groups={groups} />
      <p class="note">
        Squares: measured points, each with a line to {level.friction ? "the fit, hollow below it" : "the floor"}. {level.friction ? "Solid: the fit between measured speeds and pressures. Hatched and translucent: the fit beyond them. " : of.fit} Speed is logarithmic; dragging turns and tilts.
      </p>
    </figure>
  );
}

function Drawn({ of, level, groups }: { of: Surfaces; level: Level; groups: { points: Measured[] }[] }) {
  const place = useRef<HTMLCanvasElement>(null);
  const spots = useRef<Float64Array>(new Float64Array());
  const drag = useRef<[number, number] | null>(null);
  const [width, widen] = useState(0);
  const [near, point] = useState(-1);
  const [isBlank, leave] = useState(false);
  const found = useMemo(() => sceneOf(of, level, groups), [of, level, groups]);
  const cells = useMemo(() => byCell(found.scene), [found]);
  useEffect(() => {
    const canvas = place.current!;
    const resized = new ResizeObserver(() => widen(canvas.clientWidth));
    resized.observe(canvas);
    return () => resized.disconnect();
  }, []);
  const height = Math.round(Math.min(Math.max(0.62 * width, 280), 520));
  useEffect(() => {
    const canvas = place.current!;
    if (!width) return;
    const frame = requestAnimationFrame(() => {
      const ink = canvas.getContext("2d");
      if (!ink) return leave(true);
      const fine = devicePixelRatio || 1;
      [canvas.width, canvas.height] = [Math.round(width * fine), Math.round(height * fine)];
      ink.setTransform(fine, 0, 0, fine, 0, 0);
      const began = performance.now();
      const style = getComputedStyle(canvas);
      const colours = { text: style.getPropertyValue("color"), paper: style.getPropertyValue("--paper") || "Canvas", grid: isDark() ? "#3a3f46" : "#d9dde3", of: (z: number) => colour(found.share(z)) };
      spots.current = draw(ink, found.scene, cells, { turn: turn.value, tilt: tilt.value, width, height }, colours);
      if (near >= 0) {
        ink.strokeStyle = style.getPropertyValue("color");
        ink.lineWidth = 2;
        ink.strokeRect(spots.current[2 * near]! - 6, spots.current[2 * near + 1]! - 6, 12, 12);
      }
      canvas.dataset["drawn"] = `${turn.value} ${tilt.value}`;
      canvas.dataset["ms"] = String(performance.now() - began);
    });
    return () => cancelAnimationFrame(frame);
  }, [width, height, found, cells, turn.value, tilt.value, near, isDark()]);
  const move = (event: PointerEvent) => {
    const { offsetX: x, offsetY: y } = event;
    if (drag.current) {
      const [fromX, fromY] = drag.current;
      turn.value = round(Math.round(turn.value + DEGREES * (x - fromX)));
      tilt.value = Math.min(Math.max(Math.round(tilt.value + DEGREES * (y - fromY)), 0), 90);
      drag.current = [x, y];
      return;
    }
    let [best, least] = [-1, NEAR];
    for (let k = 0; k < found.measured.length; k++) {
      const apart = Math.hypot(spots.current[2 * k]! - x, spots.current[2 * k + 1]! - y);
      if (apart < least) [best, least] = [k, apart];
    }
    point(best);
  };
  const one = found.measured[near];
  if (isBlank) return <p class="problem" role="status">This browser draws no canvas: the cells above and the table below have the same numbers. {found.words}.</p>;
  return (
    <>
      <canvas
        ref={place}
        role="img"
        aria-label={`Surface: ${found.words}. The table below has the points, the cells above the fit.`}
        style={{ height: `${height}px` }}
        data-points={found.measured.length}
        onPointerDown={(event) => {
          drag.current = [event.offsetX, event.offsetY];
          event.currentTarget.setPointerCapture(event.pointerId);
        }}
        onPointerMove={move}
        onPointerUp={() => (drag.current = null)}
        onPointerCancel={() => (drag.current = null)}
        onPointerLeave={() => point(-1)}
      />
      <p class="note" data-near={near}>
        {one
          ? `${one.recording}: ${digits(one.friction)} N at ${digits(MM * one.speed, 3)} mm/s and ${digits(one.gauge / BAR, 3)} bar gauge${one.expected === null ? "" : `; the fit says ${digits(one.expected)} N`}`
          : `${found.words[0]!.toUpperCase()}${found.words.slice(1)}.`}
      </p>
    </>
  );
}
