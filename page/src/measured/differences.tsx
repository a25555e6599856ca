/** Differences between two drives, or between two fits of one kind. */
import { FigureView } from "../plots/figure";
import { digits } from "../plots/looks";
import type { ShownFigure } from "../server/generated";
import { Table } from "../workspace/parts";

export interface Compared {
  sentence: string;
  figure: ShownFigure | null;
  values: {
    key: string;
    before: string;
    after: string;
    interval_before: string;
    interval_after: string;
    change: number | null;
  }[];
  lines: string[];
  command: string;
  python: string;
}

/** Sentence, figure and table of the differences. `names` are the heads of the columns, for two files. */
export function Differences({
  sentence,
  figure,
  values,
  lines,
  names: [before, after] = ["Before", "After"],
}: Compared & { names?: string[] }) {
  if (!values.length && !figure) return <p role="status">{sentence}</p>;
  return (
    <section aria-label="Differences">
      <p class="answer">{sentence}</p>
      {figure && <FigureView shown={figure} />}
      <Table
        label="Values that differ"
        heads={["Value", before!, "95 %", after!, "95 %", "Change, %"]}
        rows={values.map((one) => ({
          cells: [
            one.key,
            ...[one.before, one.interval_before, one.after, one.interval_after].map((text) => text || "–"),
            one.change === null ? "–" : digits(100 * one.change, 3),
          ],
          data: { "data-differs": one.key },
        }))}
      />
      {lines.length > 0 && (
        <pre tabIndex={0} role="group" aria-label="Lines that differ">
          {lines.join("\n")}
        </pre>
      )}
    </section>
  );
}
