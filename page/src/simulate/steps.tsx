/** The command of a run as steps over time: drawn under the curves, dragged by its handles, and braked before an end. */

import { useState } from "preact/hooks";
import { digits } from "../plots/looks";
import { useWidth } from "../plots/width";

/** Time, s, and command from this time on. */
export type Step = [time: number, value: number];

const STEP = /^([-+.\deE]+) ?s: ?([-+.\deE]+)$/;

/** Return the steps of a command, or null for a command of another form, such as a file. */
export function stepsOf(text: string): Step[] | null {
  const steps = text.split(",").map((part): Step => {
    const [, time, value] = STEP.exec(part.trim()) ?? [];
    return [Number(time ?? Number.NaN), Number(value ?? Number.NaN)];
  });
  return steps.every((step) => step.every(Number.isFinite)) ? steps.sort((a, b) => a[0] - b[0]) : null;
}

export const written = (steps: Step[]): string =>
  steps.map(([time, value]) => `${digits(time, 4)} s: ${digits(value, 3)}`).join(", ");

const [BRAKE_AT, BRAKE_BY, EARLIER] = [0.4, 0.05, 0.8];

/** Return the steps with a brake before each impact. A brake that is there already acts earlier. */
export function braked(steps: Step[], impacts: number[]): Step[] {
  const isBrake = (value: number, before: number) => Math.abs(value) <= 2 * BRAKE_BY && Math.abs(before) > 2 * BRAKE_BY;
  const out = steps.map((step): Step => [...step]);
  for (let k = 0; k < out.length; k++) {
    const [begin, value] = out[k]!;
    const [next, then] = out[k + 1] ?? [Infinity, value];
    if (Math.abs(value) <= 2 * BRAKE_BY) continue;
    const isBraked = k + 1 < out.length && isBrake(then, value);
    const end = isBraked ? (out[k + 2]?.[0] ?? Infinity) : next;
    const impact = impacts.find((time) => time > begin && time <= end);
    if (impact === undefined) continue;
    if (isBraked) out[k + 1]![0] = begin + EARLIER * (next - begin);
    else out.splice(k + 1, 0, [begin + BRAKE_AT * (impact - begin), BRAKE_BY * value]);
  }
  return out;
}

const [HEIGHT, LEFT, RIGHT, EDGE] = [64, 62, 12, 9];
/** Changes of time, s, and command by an arrow key. */
const MOVES: Record<string, [later: number, more: number]> = {
  ArrowLeft: [-0.01, 0],
  ArrowRight: [0.01, 0],
  ArrowUp: [0, 0.05],
  ArrowDown: [0, -0.05],
};

interface StepsProps {
  name: string;
  steps: Step[];
  span: [number, number]; // of the shown time
  low: number; // lowest command
  put: (steps: Step[]) => void;
}

/** The command over the time of the curves. A handle is dragged, or moved by arrow keys; a double click adds one. */
export function StepsPane({ name, steps, span: [from, to], low, put }: StepsProps) {
  const [place, width] = useWidth<SVGSVGElement>(600);
  const [held, hold] = useState(-1);
  const px = (time: number) => LEFT + ((time - from) / (to - from)) * (width - LEFT - RIGHT);
  const py = (value: number) => EDGE + ((1 - value) / (1 - low)) * (HEIGHT - 2 * EDGE);
  const moved = (k: number, time: number, value: number): Step[] => {
    const next = steps.map((step): Step => [...step]);
    const [before, after] = [steps[k - 1]?.[0] ?? 0, steps[k + 1]?.[0] ?? Infinity];
    next[k] = [k ? Math.min(Math.max(time, before), after) : steps[0]![0], Math.min(Math.max(value, low), 1)];
    return next;
  };
  const pointed = (event: MouseEvent): Step => {
    const box = place.current!.getBoundingClientRect();
    const time = from + ((event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT)) * (to - from);
    const value = 1 - ((event.clientY - box.top - EDGE) / (HEIGHT - 2 * EDGE)) * (1 - low);
    return [Number(Math.max(time, 0).toFixed(3)), Number(value.toFixed(2))];
  };
  const keys = (event: KeyboardEvent, k: number) => {
    const [time, value] = steps[k]!;
    const [later, more] = MOVES[event.key] ?? [0, 0];
    if (later || more) put(moved(k, time + later, Number((value + more).toFixed(3))));
    else if (event.key === "Delete" && k > 0) put(steps.filter((_, other) => other !== k));
    else return;
    event.preventDefault();
  };
  const line = steps.map(([time, value], k) => `${k ? `H${px(time)}V` : `M${px(time)} `}${py(value)}`).join("");
  return (
    <figure class="steps" data-steps={name}>
      <figcaption>
        <span class="title">{name}</span> opening; drag a handle, double click adds one
      </figcaption>
      <svg
        ref={place}
        height={HEIGHT}
        role="group"
        aria-label={`${name}: ${written(steps)}`}
        onPointerMove={(event) => held >= 0 && event.buttons && put(moved(held, ...pointed(event)))}
        onPointerUp={() => hold(-1)}
        onDblClick={(event) => put([...steps, pointed(event)].sort((a, b) => a[0] - b[0]))}>
        {[...new Set([1, 0, low])].map((value) => (
          <g key={value}>
            <path class="grid" d={`M${LEFT} ${py(value)}H${width - RIGHT}`} />
            <text x={LEFT - 8} y={py(value) + 4} text-anchor="end">
              {value}
            </text>
          </g>
        ))}
        <path class="command" d={`${line}H${width - RIGHT}`} />
        {steps.map(([time, value], k) =>
          time < from || time > to ? null : (
            <circle
              key={k}
              cx={px(time)}
              cy={py(value)}
              r={6}
              role="slider"
              tabindex={0}
              aria-label={`Step ${k + 1} of ${name}`}
              aria-valuemin={low}
              aria-valuemax={1}
              aria-valuenow={value}
              aria-valuetext={`${digits(value)} from ${digits(time)} s`}
              onPointerDown={(event) => (hold(k), place.current!.setPointerCapture(event.pointerId))}
              onKeyDown={(event) => keys(event, k)}
            />
          ),
        )}
      </svg>
    </figure>
  );
}
