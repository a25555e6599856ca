/** The table of every view. On a phone, each cell has the name of its column before it. */
import type { ComponentChildren } from "preact";
import { pretty } from "../plots/looks";

type Data = Record<string, unknown>;
export type Cell = ComponentChildren | { text: ComponentChildren; data: Data };
type Row = Cell[] | { cells: Cell[]; data: Data };

/** Return a cell as its content and the data that it carries. */
const parted = (cell: Cell): { text: ComponentChildren; data: Data } =>
  cell !== null && typeof cell === "object" && "data" in cell ? cell : { text: cell as ComponentChildren, data: {} };

const NUMBER = /^[-−]?\d+/;
const FIGURE_SPACE = "\u2007"; // as wide as a digit

/** Return the figure spaces before each text of a column that put its decimal points below each other. */
export function pads(texts: string[]): string[] {
  const wide = texts.map((one) => NUMBER.exec(one)?.[0].length ?? 0);
  const most = wide.filter(Boolean).length > 1 ? Math.max(...wide) : 0;
  return wide.map((one) => (one && most > one ? FIGURE_SPACE.repeat(most - one) : ""));
}

/** Return the text with which a content begins. */
function beginning(of: ComponentChildren): string {
  if (Array.isArray(of)) return of.map(beginning).find(Boolean) ?? "";
  if (of !== null && typeof of === "object" && "props" in of) return beginning(of.props.children);
  return typeof of === "string" || typeof of === "number" ? String(of).trimStart() : "";
}

interface TableProps {
  heads: Cell[];
  rows: Row[]; // the first cell of a row names it; a row of one cell is the heading of those below it
  label: string;
  class?: string;
  frame?: "scroll" | "wide"; // whether a high table scrolls, or only a wide one
}

/** Table with a name in the first cell of each row. A text has units as people write them. */
export function Table({ heads, rows, label, class: look, frame = "scroll" }: TableProps) {
  const all = rows.map((row) => (Array.isArray(row) ? { cells: row, data: {} } : row));
  const columns = heads.map((_, k) => pads(all.map(({ cells }) => beginning(parted(cells[k]).text))));
  const group = { scope: "rowgroup", colSpan: heads.length };
  return (
    <div class={frame} tabIndex={0} role="region" aria-label={label}>
      <table class={look}>
        <thead>
          <tr>
            {heads.map(parted).map(({ text, data }, index) => (
              <th scope="col" key={index} {...data}>
                {text || <span class="hidden">value</span>}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {all.map(({ cells: [name, ...cells], data: rowData }, index) => (
            <tr key={index} {...rowData}>
              {name === "" ? (
                <td />
              ) : (
                <th {...(cells.length ? { scope: "row" } : group)}>{name as ComponentChildren}</th>
              )}
              {cells.map(parted).map(({ text, data }, k) => (
                <td
                  key={k}
                  data-head={beginning(parted(heads[k + 1]).text)}
                  data-pad={columns[k + 1]![index] || undefined}
                  {...data}>
                  {typeof text === "string" ? pretty(text) : text}
                </td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
