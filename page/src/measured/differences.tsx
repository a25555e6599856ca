/** Differences between two drives, or between two fits of one kind. */
import { digits } from "../plots/looks";

export interface Compared {
  values: { key: string; before: string; after: string; interval_before: string; interval_after: string; change: number | null }[];
  lines: string[];
  command: string;
  python: string;
}

export function Differences({ values, lines }: Compared) {
  if (!values.length) return <p role="status">No value differs.</p>;
  return (
    <section aria-label="Differences">
      <table>
        <thead>
          <tr>{["Value", "Before", "95 % before", "After", "95 % after", "Change, %"].map((head) => <th scope="col" key={head}>{head}</th>)}</tr>
        </thead>
        <tbody>
          {values.map((one) => (
            <tr key={one.key} data-differs={one.key}>
              <th scope="row">{one.key}</th>
              {([one.before, one.interval_before, one.after, one.interval_after] as const).map((text, index) => <td key={index}>{text || "–"}</td>)}
              <td data-si={one.change}>{one.change === null ? "–" : digits(100 * one.change, 3)}</td>
            </tr>
          ))}
        </tbody>
      </table>
      {lines.length > 0 && <pre tabIndex={0} aria-label="Lines that differ">{lines.join("\n")}</pre>}
    </section>
  );
}
