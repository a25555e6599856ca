/** One plot over time: the only file that touches uPlot. */
import { useEffect, useRef, useState } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { digits, isDark, look } from "./looks";

export interface Curve {
  label: string;
  x: ArrayLike<number>;
  y: ArrayLike<number>;
}

/** A part of the time that is shaded: a stroke. */
export interface Shade {
  from: number;
  to: number;
  strong: boolean;
}

export interface PlotProps {
  title: string;
  unit: string;
  xUnit?: string;
  size: number; // of the unit, in SI
  curves: Curve[];
  height?: number;
  onZoom?: (from: number, to: number) => void;
  range?: [number, number];
  shades?: Shade[];
}

const ROWS = 11;

function scaled(values: ArrayLike<number>, size: number): Float64Array {
  const out = new Float64Array(values.length);
  for (let i = 0; i < values.length; i++) out[i] = (values[i] as number) / size;
  return out;
}

function aligned(curves: Curve[], size: number): uPlot.AlignedData {
  const same = curves.every((one) => one.x === curves[0]?.x);
  const tables = curves.map((one) => [one.x, scaled(one.y, size)] as unknown as uPlot.AlignedData);
  if (!curves.length) return [[]] as unknown as uPlot.AlignedData;
  if (same) return [curves[0]!.x, ...tables.map((one) => one[1])] as unknown as uPlot.AlignedData;
  return uPlot.join(tables);
}

export function Plot(props: PlotProps) {
  const place = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const latest = useRef(props);
  latest.current = props;
  const [open, setOpen] = useState(false);
  const shape = props.curves.map((one) => one.label).join("|") + props.unit + (isDark() ? "d" : "l");

  useEffect(() => {
    const at = place.current!;
    const ink = isDark() ? "#d8d8d8" : "#333333";
    const axis = { stroke: ink, grid: { stroke: isDark() ? "#3a3a3a" : "#e2e2e2", width: 1 }, ticks: { show: false }, font: "12px system-ui" };
    const made = new uPlot(
      {
        width: at.clientWidth || 400,
        height: props.height ?? 210,
        cursor: { sync: { key: "time" }, drag: { x: true, y: false, setScale: !props.onZoom } },
        scales: { x: { time: false, ...(props.range && { range: () => latest.current.range! }) } },
        legend: { live: true },
        axes: [
          { ...axis, size: 34, space: 70, label: props.xUnit ?? "s", labelSize: 16, labelFont: "12px system-ui" },
          { ...axis, size: 64, label: props.unit, labelSize: 16, labelFont: "12px system-ui" },
        ],
        series: [
          { label: `time, ${props.xUnit ?? "s"}`, value: (_, v) => digits(v) },
          ...props.curves.map((one, index) => {
            const { color, dash } = look(index);
            return { label: one.label, stroke: color, dash, width: 1.4, spanGaps: props.curves.length > 1, points: { show: false }, value: (_: uPlot, v: number | null) => digits(v) };
          }),
        ],
        hooks: {
          drawClear: [(u) => shade(u, latest.current.shades ?? [])],
          setSelect: [
            (u) => {
              if (!latest.current.onZoom || u.select.width <= 2) return;
              const [from, to] = [u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")];
              u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
              latest.current.onZoom(from, to);
            },
          ],
        },
      },
      aligned(props.curves, props.size),
      at,
    );
    plot.current = made;
    const seen = new ResizeObserver(() => made.setSize({ width: at.clientWidth, height: props.height ?? 210 }));
    seen.observe(at);
    return () => {
      seen.disconnect();
      made.destroy();
      plot.current = null;
    };
  }, [shape]);

  useEffect(() => {
    plot.current?.setData(aligned(props.curves, props.size));
  }, [props.curves, props.shades]);

  const label = props.unit ? `${props.title}, ${props.unit}` : props.title;
  return (
    <figure class="plot" data-plot={props.title}>
      <figcaption>{label}</figcaption>
      <div ref={place} aria-hidden="true" />
      <details onToggle={(event) => setOpen((event.currentTarget as HTMLDetailsElement).open)}>
        <summary>{props.title}: values as a table</summary>
        {open && <Values {...props} />}
      </details>
    </figure>
  );
}

/** Draw the shaded parts below the curves; of many that are too thin to see, none. */
function shade(u: uPlot, parts: Shade[]): void {
  const { left, top, width, height } = u.bbox;
  const [low, high] = [u.scales["x"]!.min!, u.scales["x"]!.max!];
  const seen = parts.filter((one) => one.to >= low && one.from <= high);
  if (seen.length > width / 4) return;
  u.ctx.save();
  for (const one of seen) {
    const from = Math.max(u.valToPos(one.from, "x", true), left);
    const to = Math.min(u.valToPos(one.to, "x", true), left + width);
    u.ctx.fillStyle = isDark() ? (one.strong ? "#39424d" : "#262c34") : one.strong ? "#d8e0ea" : "#eef2f6";
    u.ctx.fillRect(from, top, to - from, height);
  }
  u.ctx.restore();
}

function Values({ curves, size, unit, xUnit, title }: PlotProps) {
  const first = curves[0];
  if (!first) return <p>No curve.</p>;
  const at = Array.from({ length: ROWS }, (_, row) => Math.round(((first.x.length - 1) * row) / (ROWS - 1)));
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={`Table of ${title}`}>
      <table>
        <thead>
          <tr>
            <th scope="col">{xUnit === "samples" ? "sample" : `time, ${xUnit ?? "s"}`}</th>
            {curves.map((one) => (
              <th scope="col" key={one.label}>
                {one.label}, {unit}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {at.map((index) => (
            <tr key={index}>
              <th scope="row">{digits(first.x[index])}</th>
              {curves.map((one) => (
                <td key={one.label}>{digits((one.y[index] ?? Number.NaN) / size, 6)}</td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
