/** The drawing of a circuit: shapes of the server as SVG, made element by element, never from text. */
import type { JSX } from "preact";

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

export function Circuit(props: { drawing: Drawing; chosen?: string; onChoose?: (component: string) => void }) {
  const [left, bottom, right, top] = props.drawing.paper;
  const names = [...new Set(props.drawing.shapes.map((one) => one.component))];
  return (
    <svg class="circuit" viewBox={`${left} ${-top} ${right - left} ${top - bottom}`} role="group" aria-label="Circuit, symbols after ISO 1219">
      {names.map((name) => {
        const own = props.drawing.shapes.filter((one) => one.component === name);
        if (!name || !props.onChoose) return <g key={name}>{own.map(drawn)}</g>;
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

/** The rectangle about a symbol: where a click counts. */
function Area({ shapes }: { shapes: Shape[] }) {
  const points = shapes.filter((one) => one.word !== "text").flatMap((one) => one.points);
  if (!points.length) return null;
  const xs = points.map(([x]) => x);
  const ys = points.map(([, y]) => -y);
  const [x, y] = [Math.min(...xs) - 0.5, Math.min(...ys) - 0.5];
  return <rect class="area" x={x} y={y} width={Math.max(...xs) - x + 0.5} height={Math.max(...ys) - y + 0.5} />;
}
