/** Figure of curves of any shape, such as loops. Both axes are free, and a curve may run back. */
import { useState } from "preact/hooks";
import { digits, look } from "./looks";

export interface Strand {
  label: string;
  x: number[];
  y: number[];
}

const SIZE = { width: 520, height: 300, left: 58, bottom: 40, top: 8, right: 10 };

/** Return about this many round ticks between two ends. */
export function ticks(low: number, high: number, count = 5): number[] {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough)!;
  const out = [];
  for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * step; value += step)
    out.push(Number(value.toPrecision(8)));
  return out;
}

/** Return the range of all numbers. A single number gets a range around it. */
function span(each: number[][]): [number, number] {
  let [low, high] = [Infinity, -Infinity];
  for (const some of each)
    for (const one of some) if (Number.isFinite(one)) [low, high] = [Math.min(low, one), Math.max(high, one)];
  return high > low ? [low, high] : [low - 1, high + 1];
}

/** Figure of curves. `x` and `y` name the axes with their units. */
export function Strip({ title, x, y, curves }: { title: string; x: string; y: string; curves: Strand[] }) {
  const [x0, x1] = span(curves.map((one) => one.x));
  const [y0, y1] = span(curves.map((one) => one.y));
  const px = (at: number) => SIZE.left + ((at - x0) / (x1 - x0)) * (SIZE.width - SIZE.left - SIZE.right);
  const py = (at: number) =>
    SIZE.height - SIZE.bottom - ((at - y0) / (y1 - y0)) * (SIZE.height - SIZE.bottom - SIZE.top);
  const names = curves.map((one) => one.label).join(", ");
  return (
    <figure class="loops strip" data-loops={curves.length}>
      <figcaption>{title}</figcaption>
      <svg
        viewBox={`0 0 ${SIZE.width} ${SIZE.height}`}
        role="img"
        aria-label={`${names}: ${x} from ${digits(x0)} to ${digits(x1)}, ${y} from ${digits(y0)} to ${digits(y1)}`}>
        {ticks(x0, x1).map((one) => (
          <g key={one}>
            <line class="grid" x1={px(one)} x2={px(one)} y1={SIZE.top} y2={SIZE.height - SIZE.bottom} />
            <text x={px(one)} y={SIZE.height - SIZE.bottom + 16} text-anchor="middle">
              {one}
            </text>
          </g>
        ))}
        {ticks(y0, y1).map((one) => (
          <g key={one}>
            <line class="grid" y1={py(one)} y2={py(one)} x1={SIZE.left} x2={SIZE.width - SIZE.right} />
            <text x={SIZE.left - 6} y={py(one) + 4} text-anchor="end">
              {one}
            </text>
          </g>
        ))}
        <text x={(SIZE.left + SIZE.width) / 2} y={SIZE.height - 6} text-anchor="middle">
          {x}
        </text>
        <text transform={`translate(14 ${SIZE.height / 2 - 10}) rotate(-90)`} text-anchor="middle">
          {y}
        </text>
        {curves.map((one, index) => (
          <polyline
            key={one.label}
            data-loop={one.label}
            fill="none"
            stroke={look(index).color}
            stroke-width="1.4"
            stroke-dasharray={look(index).dash.join(" ")}
            points={one.x.map((at, i) => `${px(at).toFixed(2)},${py(one.y[i]!).toFixed(2)}`).join(" ")}
          />
        ))}
      </svg>
      {curves.length > 1 && (
        <ul class="legend">
          {curves.map((one, index) => (
            <li key={one.label}>
              <svg viewBox="0 0 34 8" width="34" height="8" aria-hidden="true">
                <line
                  x1="0"
                  y1="4"
                  x2="34"
                  y2="4"
                  stroke={look(index).color}
                  stroke-width="2"
                  stroke-dasharray={look(index).dash.join(" ")}
                />
              </svg>{" "}
              {one.label}
            </li>
          ))}
        </ul>
      )}
      <Behind title={title} x={x} y={y} curves={curves} />
    </figure>
  );
}

const ROWS = 41; // of a curve in its table

/** Table of the numbers of a figure, with few enough rows per curve to read. */
export function Behind({ title, x, y, curves }: { title: string; x: string; y: string; curves: Strand[] }) {
  const [open, setOpen] = useState(false);
  return (
    <details onToggle={(event) => setOpen((event.currentTarget as HTMLDetailsElement).open)}>
      <summary>{title}: values as a table</summary>
      {open && (
        <div class="scroll" tabIndex={0} role="region" aria-label={`Table of ${title}`}>
          <table>
            <thead>
              <tr>
                <th scope="col">curve</th>
                <th scope="col">{x}</th>
                <th scope="col">{y}</th>
              </tr>
            </thead>
            <tbody>
              {curves.flatMap((one) => {
                const rows = Math.min(ROWS, one.x.length);
                const at = Array.from({ length: rows }, (_, row) =>
                  Math.round(((one.x.length - 1) * row) / Math.max(rows - 1, 1)),
                );
                return at.map((index, row) => (
                  <tr key={`${one.label} ${row}`}>
                    <th scope="row">{one.label}</th>
                    <td>{digits(one.x[index])}</td>
                    <td>{digits(one.y[index])}</td>
                  </tr>
                ));
              })}
            </tbody>
          </table>
        </div>
      )}
    </details>
  );
}
