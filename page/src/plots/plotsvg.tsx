/** A plot as a drawing or a picture; texts of a drawing stay texts. */
import { render } from "preact";
import type { Axis, Line } from "../server/generated";
import { PanelDrawing } from "./figure";
import { look } from "./looks";
import { axis } from "./points";
import { type Saved, saveDrawing } from "./saving";
import { scaleOf } from "./scale";

const DASH = 1.6; // pixels of a unit of a dash

/** Return the visible curves of a plot as lines. A value of another curve's time is left out; null is a gap. */
const linesOf = ({ u, curves }: Saved): Line[] =>
  curves.map(({ label, look: own }, k): Line => {
    const { min = 0, max = 1 } = u.scales.x!;
    const [index, isGap, values] = [own ?? k, !u.series[k + 1]!.spanGaps, u.data[k + 1]!];
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

export async function saveAs(ending: "svg" | "png", plot: Saved): Promise<void> {
  const { u, title, unit, over } = plot;
  const marks = linesOf(plot);
  const axisOf = (label: string, { min, max, distr }: uPlot.Scale): Axis => ({
    ...axis(label, distr === 3 ? "log" : "linear", min),
    high: max ?? null,
  });
  const [x, y] = [axisOf(over, u.scales.x!), axisOf(`${title}, ${unit || "1"}`, u.scales.y!)];
  const host = document.querySelector(".pneudrive")!.appendChild(document.createElement("div"));
  host.style.width = `${u.width}px`;
  const ends = marks.length > 1 ? Math.max(...marks.map(({ label }) => label.length)) : 0;
  const drawing = { panel: { marks, title: "", x, y }, x, y, scales: [scaleOf(x, "x", marks), scaleOf(y, "y", marks)] };
  render(
    <PanelDrawing {...drawing} ends={ends} width={u.width} height={u.height + 60} longest={8} name="saved" />,
    host,
  );
  await saveDrawing(title, host, ending);
  render(null, host);
  host.remove();
}
