/** The drawing during a run: pistons, valves, and lines by their pressure, at a chosen or running time. */
import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect } from "preact/hooks";
import { lazy } from "../lazy";
import { digits, instant } from "../plots/looks";
import { indexAt } from "../plots/plot";
import type { Frame, Numbers } from "../server/frame";
import type { Finding, RunHead } from "../server/generated";
import { Button, Fold, Range } from "../workspace/fields";
import { BOX, type Drawing, type Line, type Motion } from "./circuit";

const BAR = 1e5;
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

function largestOf(values: Numbers): number {
  let found = values[0]!;
  for (const one of values) if (one > found) found = one;
  return found;
}

/** Return the state of the drawing at a row of the run. */
export function motionAt(now: Frame<RunHead>, drawing: Drawing, row: number): Motion {
  const { arrays } = now;
  const time = arrays.get("time_s")!;
  const own = arrays.get("motion/time_s");
  const at = own ? indexAt(own, time[row]!) : 0;
  const columnOf = (name: string) => arrays.get(name) ?? arrays.get(`motion/${name}`)!; // plots leave out the ninth curve
  const momentOf = (name: string) => (arrays.get(`${name}/at`) ?? arrays.get(name))?.[row] ?? columnOf(name)[at]!;
  const first = (names: string[]): Numbers | undefined => names.map((one) => arrays.get(`motion/${one}`)).find(Boolean);
  const pistons: Motion["pistons"] = {};
  for (const one of now.head.cylinders ?? []) {
    const position = momentOf(one.position);
    const values = one.pressures.map(momentOf) as [number, number];
    const most = Math.max(...one.pressures.map((name) => largestOf(columnOf(name))));
    const pressures = values.map((value) => `${digits(value / BAR, 3)} bar`) as [string, string];
    const said = `${one.name}: position ${digits(1000 * position)} mm, chamber a ${pressures[0]}, chamber b ${pressures[1]}, absolute`;
    const tints = values.map((value) => (0.7 * value) / most) as [number, number];
    pistons[one.name] = { share: position / one.stroke_m, position, pressures, tints, said };
  }
  const isDrive = arrays.has("motion/command");
  const shifts: Motion["shifts"] = {};
  for (const name of Object.keys(drawing.ports)) {
    const spool = first([`${name}.position`, `${name}.command`, ...(isDrive && name === "valve" ? ["command"] : [])]);
    if (spool) shifts[name] = BOX * Math.max(-1, Math.min(1, spool[at]!));
  }
  const pressureOf = (name: string, port: string) =>
    first([`${name}.${port}.pressure_pa`, ...(isDrive ? [`pressure_${port}_pa`] : []), `${name}.pressure_pa`]);
  const flowOf = (name: string, port: string) =>
    first([
      ...[`${name}.${port}.mass_flow_kg_s`, `${name}.mass_flow_${port}_kg_s`],
      ...(isDrive ? [`mass_flow_${port}_kg_s`] : []),
      `${name}.mass_flow_kg_s`,
    ]);
  const known = drawing.nets.map((pins) => ({
    pins,
    pressure: pins.map((pin) => pressureOf(...pin)).find(Boolean),
    flow: pins.length === 2 ? pins.map((pin) => flowOf(...pin)).find(Boolean) : undefined,
  }));
  const most = Math.max(1, ...known.flatMap((one) => (one.pressure ? [largestOf(one.pressure)] : [])));
  const lines: Line[] = known.map(({ pins, pressure, flow }) => {
    const absolute = pressure && `${digits(pressure[at]! / BAR, 3)} bar absolute`;
    const moving = flow && `${digits(Math.abs(flow[at]!) / GRAM, 2)} g/s`;
    const said = [endsOf(pins), absolute, moving].filter(Boolean).join(", ");
    return { share: pressure && pressure[at]! / most, said };
  });
  return { pistons, shifts, lines };
}

export const endsOf = (pins: [string, string][]): string => pins.map((pin) => pin.join(".")).join(" – ");

/** Slider of the time at which the drawing is shown. */
export const TimeRange = (props: { label: string; name?: string; end: number; at: number; words: string }) => (
  <Range
    label={props.label}
    name={props.name}
    value={props.at}
    ends={[0, props.end]}
    words={props.words}
    steps={1000}
    put={(time) => ([isPlaying.value, timeAt.value] = [false, time])}
  />
);

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
      <TimeRange label="Time" end={end} at={at} words={`${shown} s`} />
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
  const places = cylinders.map((one) => `, ${one.name} at ${digits(1000 * motion.pistons[one.name]!.position)} mm`);
  const sample = indexAt(now.arrays.get("motion/time_s") ?? [], time[row]!);
  if (platforms.length)
    return (
      <figure class="motion" data-row={row}>
        {platforms.map((one, k) => (
          <PlatformAt key={one.name} now={now} platform={one} remedy={remedy} sample={sample}>
            {k === 0 && <TimeSlider now={now} words={` of ${digits(time[time.length - 1])} s`} />}
          </PlatformAt>
        ))}
        <Fold class="panel" title="Circuit">
          {children(motion)}
        </Fold>
      </figure>
    );
  return (
    <figure class="motion" data-row={row}>
      {children(motion)}
      <TimeSlider now={now} words={`${places.join("")}; pressures absolute`} />
      {!cylinders.length && (
        <p class="note" data-without="motion">
          No piston moves in the drawing: only double-acting cylinders are animated, and this circuit does not contain
          one.
        </p>
      )}
    </figure>
  );
}
