/** Comparison of two drives, or of two results of one kind. */

import { FigureView } from "../plots/figure";
import { digits, pretty } from "../plots/looks";
import type { Compared } from "../server/generated";
import { usePosted } from "../server/server";
import { Fold, Lines, Table } from "../workspace/fields";
import { Copied, Problems } from "../workspace/parts";

/** Return whether two intervals such as "0.5 … 3.3" overlap. */
function isAlike(some: string, others: string): boolean {
  const ends = (text: string) => text.split(" … ").map(parseFloat) as [number, number];
  const [[low, high], [least, most]] = [ends(some), ends(others)];
  return low <= most && least <= high;
}

/** Sentence, figure and table of the differences between two files. */
function Differences({ sentence, figure, values, lines, names: [before, after] }: Compared) {
  if (!values.length && !figure) return <p role="status">{sentence}</p>;
  return (
    <section aria-label="Differences">
      <p class="answer">{pretty(sentence)}</p>
      {figure && <FigureView shown={figure} />}
      <Table
        label="Values that differ"
        heads={["Value", before, "95 %", after, "95 %", "Change, %", "Verdict"]}
        rows={values.map(({ key, before: first, after: second, interval_before, interval_after, change }) => ({
          cells: [
            key,
            ...[first, interval_before, second, interval_after].map((text) => text || "–"),
            change === null ? "–" : digits(100 * change, 3),
            interval_before && interval_after && (
              <span class={`pill ${isAlike(interval_before, interval_after) ? "" : "good"}`}>
                {isAlike(interval_before, interval_after) ? "may be equal" : "differs"}
              </span>
            ),
          ],
          data: { "data-differs": key },
        }))}
      />
      {lines.length > 0 && (
        <Fold title="Lines that differ">
          <Lines name="Lines that differ">{lines.join("\n")}</Lines>
        </Fold>
      )}
    </section>
  );
}

/** Differences between two files, asked for again when `again` changes. */
export default function Comparison({ before, after, again }: { before: string; after: string; again?: unknown }) {
  const [compared, problems] = usePosted<Compared>("/api/compare", { before, after }, [again]);
  return (
    <>
      <Problems of={problems} />
      {!problems.length && !compared && <p role="status">Comparing.</p>}
      {compared && <Differences {...compared} />}
      {compared && <Copied of="the difference" {...compared} />}
    </>
  );
}
