/** The table of every view. */
import type { ComponentChildren } from "preact";
import { pretty } from "../plots/looks";

type Data = Record<string, unknown>;
export type Cell = ComponentChildren | { text: ComponentChildren; data: Data };
type Row = Cell[] | { cells: Cell[]; data: Data };

/** Return a cell as its content and the data that it carries. */
const parted = (cell: Cell): { text: ComponentChildren; data: Data } =>
  cell !== null && typeof cell === "object" && "data" in cell ? cell : { text: cell as ComponentChildren, data: {} };

interface TableProps {
  heads: Cell[];
  rows: Row[]; // the first cell of a row names it
  label: string;
  class?: string;
  frame?: "scroll" | "wide"; // whether a high table scrolls, or only a wide one
}

/** Table with a name in the first cell of each row. A text has units as people write them. */
export function Table({ heads, rows, label, class: look, frame = "scroll" }: TableProps) {
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
          {rows.map((row, index) => {
            const [[name, ...cells], rowData] = Array.isArray(row) ? [row, {}] : [row.cells, row.data];
            return (
              <tr key={index} {...rowData}>
                {name === "" ? <td /> : <th scope="row">{name as ComponentChildren}</th>}
                {cells.map(parted).map(({ text, data }, place) => (
                  <td key={place} {...data}>
                    {typeof text === "string" ? pretty(text) : text}
                  </td>
                ))}
              </tr>
            );
          })}
        </tbody>
      </table>
    </div>
  );
}
