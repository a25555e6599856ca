/** A plot as an SVG drawing; texts stay texts. */
import { render } from "preact";
import type { Axis, Line, Panel } from "../server/generated";
import { PanelDrawing } from "./figure";
import { look } from "./looks";
import { axis } from "./points";
import { type Saved, saveDrawing } from "./saving";
import { scaleOf } from "./scale";

const DASH = 1.6; // pixels of a unit of a dash

/** Return the visible curves of a plot as lines. A value of another curve's time is left out; null is a gap. */
function linesOf({ u, legend }: Saved): Line[] {
  const { min = 0, max = 1 } = u.scales.x!;
  return legend.map(({ label, look: index }, k): Line => {
    const isGap = !u.series[k + 1]!.spanGaps;
    const values = u.data[k + 1]!;
    const rows = Array.from(u.data[0], (x, row) => [x, values[row]] as const).filter(
      ([x, y]) => x >= min! && x <= max! && y !== undefined && (y !== null || isGap),
    );
    return {
      x: rows.map(([x]) => x),
      y: rows.map(([, y]) => y ?? null),
      label,
      width: 1.1,
      steps: false,
      kind: "line",
      look: [`look-${(index % 8) + 1}`, [0, look(index).dash.map((length) => length / DASH)], ""],
    };
  });
}

export function saveSvg(plot: Saved): void {
  const { u, title } = plot;
  const marks = linesOf(plot);
  const isLog = u.scales.x!.distr === 3;
  const over = (label: string, { min = null, max = null }: { min?: number | null; max?: number | null }): Axis => ({
    ...axis(label, isLog ? "log" : "linear", min),
    high: max,
  });
  const [x, y] = [over(plot.x, u.scales.x!), over(`${title}, ${plot.y}`, u.scales.y!)];
  const panel: Panel = { marks, title: "", x, y };
  const host = document.querySelector(".pneudrive")!.appendChild(document.createElement("div"));
  host.style.width = `${u.width}px`;
  const ends = plot.legend.length > 1 ? Math.max(...plot.legend.map(({ label }) => label.length)) : 0;
  render(
    <PanelDrawing
      panel={panel}
      x={x}
      y={y}
      ends={ends}
      width={u.width}
      height={u.height + 60}
      isBare={false}
      longest={8}
      name="saved"
      hasEnds={ends > 0}
      scales={[scaleOf(x, "x", marks), scaleOf(y, "y", marks)]}
    />,
    host,
  );
  saveDrawing(title, host);
  render(null, host);
  host.remove();
}
