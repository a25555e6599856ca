/** Save a plot or a figure as a picture, as a drawing or as numbers. */
import type uPlot from "uplot";

/** A plot that is saved, as it is drawn, with the label of its axis of time or frequency. */
export interface Saved {
  title: string;
  unit: string;
  over: string;
  curves: { label: string; look?: number }[];
  u: uPlot;
  extreme?: boolean; // values are the lowest and the highest of each pixel, in turn
}

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

/** A cell of a CSV file; a spreadsheet runs texts that begin with = + - @ unless a ' precedes them. */
function cell(given: string): string {
  const text = /^[=+\-@\t\r]/.test(given) && Number.isNaN(Number(given)) ? `'${given}` : given;
  return /[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

const quantity = ({ unit }: Saved, name: string): string => `${name}, ${unit || "1"}`;

/** The numbers that are drawn, one column for each curve. */
export function saveCsv(of: Saved): void {
  const x = of.extreme ? `${of.over} (lowest and highest of each pixel)` : of.over;
  const heads = [x, ...of.curves.map(({ label }) => quantity(of, label))];
  saveColumns(of.title, heads, of.u.data);
}

/** Save all samples of the shown part, where a plot draws the lowest and the highest of each pixel. */
export const saveSamples = (of: Saved, samples: Map<string, ArrayLike<number>>): void =>
  saveColumns(`${of.title} samples`, [of.over, quantity(of, of.title)], [...samples.values()]);

function saveColumns(title: string, heads: string[], columns: ArrayLike<number | null | undefined>[]): void {
  const rows = Array.from(columns[0]!, (_, row) => columns.map((column) => String(column[row] ?? "")));
  saveRows(title, [heads, ...rows]);
}

/** Save rows of texts as CSV. */
export function saveRows(title: string, rows: string[][]): void {
  const text = rows.map((row) => `${row.map(cell).join(",")}\n`).join("");
  download(fileOf(title, "csv"), new Blob([text], { type: "text/csv" }));
}

/** Save the panels of a figure as one drawing or as a picture, in the colours that are shown. */
export async function saveDrawing(title: string, place: HTMLElement, ending: "svg" | "png" = "svg"): Promise<void> {
  const box = place.getBoundingClientRect();
  const panels = Array.from(place.querySelectorAll<SVGElement>(".panel-drawing"), (panel) => {
    const [own, copy] = [panel.getBoundingClientRect(), panel.cloneNode(true) as SVGElement];
    copy.setAttribute("x", String(own.x - box.x));
    copy.setAttribute("y", String(own.y - box.y));
    return new XMLSerializer().serializeToString(copy);
  });
  const size = `width="${box.width}" height="${box.height}" viewBox="0 0 ${box.width} ${box.height}"`;
  const surface = '<rect width="100%" height="100%" fill="var(--surface)"/>';
  const probe = place.appendChild(document.createElement("i"));
  const text = `<svg xmlns="http://www.w3.org/2000/svg" ${size}>${surface}${panels.join("")}</svg>`.replace(
    /var\(--[\w-]+\)/g,
    (name) => {
      probe.style.color = name;
      return getComputedStyle(probe).color;
    },
  );
  probe.remove();
  if (ending === "svg") return download(fileOf(title, "svg"), new Blob([text], { type: "image/svg+xml" }));
  const picture = new Image();
  picture.src = `data:image/svg+xml,${encodeURIComponent(text)}`;
  await picture.decode();
  const canvas = new OffscreenCanvas(box.width * devicePixelRatio, box.height * devicePixelRatio);
  canvas.getContext("2d")!.drawImage(picture, 0, 0, canvas.width, canvas.height);
  download(fileOf(title, "png"), await canvas.convertToBlob());
}
