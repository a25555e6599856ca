/** Save a plot as a picture, as a drawing or as numbers. */
import type uPlot from "uplot";
import { look, token } from "./looks";

/** Content of a saved plot. */
export interface Saved {
  title: string;
  x: string;
  y: string;
  legend: { label: string; look: number }[];
  u: uPlot;
  extreme?: boolean; // values are the lowest and the highest of each pixel, in turn
}

const LINE = 22; // height of the title and of each line of the legend, pixels

export function download(name: string, blob: Blob): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** Return the name of a file with a title. */
function fileOf(title: string, ending: string): string {
  const words = title.toLowerCase().replace(/[^\w]+/g, "-");
  return `${words.replace(/^-|-$/g, "")}.${ending}`;
}

export function savePng(of: Saved): void {
  const { canvas: drawn } = of.u.ctx;
  const [canvas, ratio] = [document.createElement("canvas"), devicePixelRatio];
  const above = LINE * (of.legend.length > 1 ? 2 : 1) * ratio;
  [canvas.width, canvas.height] = [drawn.width, drawn.height + above];
  const at = canvas.getContext("2d")!;
  at.fillStyle = token("surface");
  at.fillRect(0, 0, canvas.width, canvas.height);
  at.drawImage(drawn, 0, above);
  at.fillStyle = at.strokeStyle = token("axis");
  at.font = `600 ${13 * ratio}px system-ui`;
  at.fillText(`${of.title}, ${of.y}`, 8 * ratio, 15 * ratio);
  at.font = `${12 * ratio}px system-ui`;
  let x = 8 * ratio;
  for (const one of of.legend.length > 1 ? of.legend : []) {
    const { color, dash } = look(one.look);
    at.strokeStyle = color;
    at.lineWidth = 2 * ratio;
    at.setLineDash(dash.map((each) => each * ratio));
    at.stroke(new Path2D(`M${x} ${(LINE + 11) * ratio}h${28 * ratio}`));
    at.fillText(one.label, x + 34 * ratio, LINE * ratio + 15 * ratio);
    x += at.measureText(one.label).width + 54 * ratio;
  }
  canvas.toBlob((blob) => blob && download(fileOf(of.title, "png"), blob));
}

/** A cell of a CSV file; a spreadsheet runs texts that begin with = + - @ unless a ' precedes them. */
function cell(given: string): string {
  const text = /^[=+\-@\t\r]/.test(given) && Number.isNaN(Number(given)) ? `'${given}` : given;
  return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** The numbers that are drawn, one column for each curve. */
export function saveCsv(of: Saved): void {
  const columns = of.u.data.slice(1);
  const x = of.extreme ? `${of.x} (lowest and highest of each pixel)` : of.x;
  const heads = [x, ...of.legend.map((one) => `${one.label}, ${of.y}`)];
  const rows = Array.from(of.u.data[0], (at, i) => [String(at), ...columns.map((column) => String(column[i] ?? ""))]);
  saveRows(of.title, [heads, ...rows]);
}

/** Save all samples of the shown part, where a plot draws the lowest and the highest of each pixel. */
export function saveSamples({ title, x, y }: Saved, samples: Map<string, ArrayLike<number>>): void {
  const [time, ...others] = [...samples.values()];
  const rows = Array.from(time!, (at, i) => [String(at), ...others.map((column) => String(column[i]))]);
  saveRows(`${title} samples`, [[x, ...others.map(() => `${title}, ${y}`)], ...rows]);
}

/** Save rows of texts as CSV. */
export function saveRows(title: string, rows: string[][]): void {
  const text = rows.map((row) => `${row.map(cell).join(",")}\n`).join("");
  download(fileOf(title, "csv"), new Blob([text], { type: "text/csv" }));
}

/** Save the panels of a figure as one drawing, in the colours that are shown. */
export function saveDrawing(title: string, place: HTMLElement): void {
  const box = place.getBoundingClientRect();
  const panels = Array.from(place.querySelectorAll<SVGElement>(".panel-drawing"), (panel) => {
    const [own, copy] = [panel.getBoundingClientRect(), panel.cloneNode(true) as SVGElement];
    copy.setAttribute("x", String(own.x - box.x));
    copy.setAttribute("y", String(own.y - box.y));
    return new XMLSerializer().serializeToString(copy);
  });
  const head = `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${box.width} ${box.height}">`;
  const surface = '<rect width="100%" height="100%" fill="var(--surface)"/>';
  const probe = place.appendChild(document.createElement("i"));
  const text = `${head}${surface}${panels.join("")}</svg>`.replace(/var\(--[\w-]+\)/g, (name) => {
    probe.style.color = name;
    return getComputedStyle(probe).color;
  });
  probe.remove();
  download(fileOf(title, "svg"), new Blob([text], { type: "image/svg+xml" }));
}
