/** A result in the form that terminal, notebook and report share: a table of values, curves, and sentences. */

import type { ComponentChildren } from "preact";
import { FigurePanel } from "../plots/figure";
import { isSevere, pretty } from "../plots/looks";
import { type Group, isWide, pointsFigure } from "../plots/points";
import { route } from "../routes";
import type { Finding, SentCurve, SentView, ShownFigure } from "../server/generated";
import { useRequest } from "../server/server";
import { Fold, Table } from "./fields";
import { changesOf } from "./files";
import { Leading, Problems } from "./parts";

const MOST_BESIDE = 4; // columns of a table beside the figure

/** Table of the values of a result. A cell carries its value in SI. */
function ShownTable({ view }: { view: SentView }) {
  const quantities = [...new Set(view.rows.map((one) => one.quantity))];
  const labels = [...new Set(view.rows.map((one) => one.label))];
  const cell = (label: string, quantity: string, text: string | undefined) => {
    const row = view.rows.find((one) => one.label === label && one.quantity === quantity);
    const si = typeof row?.value === "number" ? row.value : undefined;
    return { text, data: { "data-value": row?.key, "data-si": si } };
  };
  const rows = labels.map((label, y) => ({
    cells: [label, ...quantities.map((quantity, x) => cell(label, quantity, view.table[y]?.[x + 1]))],
    data: { "data-row": label },
  }));
  return <Table label={`Values: ${view.title}`} heads={view.head} rows={rows} />;
}

export function Notes({ of }: { of: string[] }) {
  return of.length ? (
    <ul class="said">
      {of.map((one) => (
        <li key={one}>{one}</li>
      ))}
    </ul>
  ) : null;
}

const STATES = { good: "in order", open: "open", bad: "needs you" };

/** Headline with its state, at most five numbers with their limits, and the findings, the worst first, with buttons for their remedies. */
export function Answer(props: {
  view: SentView;
  withFindings?: boolean;
  remedy?: ((of: Finding) => ComponentChildren) | undefined;
}) {
  const { view, withFindings = true, remedy } = props;
  const isJudged =
    view.state !== "good" || view.leading.some((one) => one.limit) || view.findings.some((one) => one.state !== "good");
  return (
    <div class="panel answer-card" data-state={view.state}>
      <h2>
        {isJudged && (
          <>
            <span class={`pill ${view.state}`}>{STATES[view.state]}</span>{" "}
          </>
        )}
        {view.title}
      </h2>
      <Leading of={view.leading} />
      {withFindings && <Findings of={view.findings} remedy={remedy} />}
    </div>
  );
}

const MOST_OPEN = 3; // findings that are shown before the others are asked for

/** Findings, the worst first, with their remedies. Only notes without danger are folded. */
export function Findings({ of, remedy }: { of: Finding[]; remedy?: ((of: Finding) => ComponentChildren) | undefined }) {
  const first = of.filter((one, k) => k < MOST_OPEN || one.state === "bad" || isSevere(one.text));
  const others = of.filter((one) => !first.includes(one));
  const list = (some: Finding[]) => (
    <ul class="findings">
      {some.map((one) => (
        <li key={one.text} class={one.state}>
          <b>{pretty(one.text)}</b>
          {one.remedy && ` ${pretty(one.remedy.replace(/^Remedy: /, ""))}`}
          {remedy?.(one)}
        </li>
      ))}
    </ul>
  );
  return (
    <>
      {first.length > 0 && list(first)}
      {others.length > 0 && <Fold title={`${others.length} more notes`}>{list(others)}</Fold>}
    </>
  );
}

/** Return the view of a result; null while it is read, and for a result that cannot be read yet. */
export const useView = (path: string, changed?: unknown): SentView | null =>
  useRequest<SentView>("/api/view", path ? { path } : null, [changed, changesOf(path)])[0];

/** Points and line of a curve, which are in usual units. Points that are not measured lie between measured ones. */
function groupOf({ label, x, y, low, high, measured }: SentCurve): Group {
  const [xs, ys, lows, highs] = [x, y, low, high].map((values) => values.map((value) => value ?? Number.NaN));
  const points = xs!.flatMap((at, k) => {
    const half = (highs![k]! - lows![k]!) / 2;
    if (!measured[k] || Number.isNaN(at + ys![k]!)) return [];
    return [{ x: at, y: ys![k]!, spread: half >= 0 ? half : null }];
  });
  if (points.length === x.length) return { label, points };
  const ends = points.map((point) => point.x);
  const range = ends.length ? [Math.min(...ends), Math.max(...ends)] : [-Infinity, Infinity];
  return { label, points, curve: { x: xs!, y: ys!, ...(low.length && { low, high }), measured: range } };
}

/** Return a figure of the curves of each pair of axes. */
const figuresOf = (curves: SentCurve[]): ShownFigure[] =>
  [...new Set(curves.map((one) => `${one.x_title}\n${one.y_title}`))].map((pair) => {
    const [x, y] = pair.split("\n") as [string, string];
    const groups = curves.filter((one) => `${one.x_title}\n${one.y_title}` === pair).map(groupOf);
    const name = `${y.split(",")[0]} over ${x.split(",")[0]}`;
    return pointsFigure({ name, x, y, panels: [{ title: "", groups }], isLog: isWide(groups) });
  });

/** Figures of a view, or those of its curves. */
export function Figures({ view }: { view: SentView }) {
  return (
    <>
      {(view.figures.length ? view.figures : figuresOf(view.curves)).map((one) => (
        <FigurePanel key={one.name} shown={one} />
      ))}
    </>
  );
}

/** Values and tables of a view. */
export function Values({ view }: { view: SentView }) {
  return (
    <>
      {view.rows.length > 0 && (
        <div class="panel">
          <ShownTable view={view} />
        </div>
      )}
      {view.tables.map((one) => (
        <div class="panel" key={one.caption}>
          <h3>{one.caption}</h3>
          <Table label={one.caption} heads={one.head} rows={one.rows} />
        </div>
      ))}
      {view.notes.length > 0 && (
        <div class="panel">
          <h3>Notes</h3>
          <Notes of={view.notes} />
        </div>
      )}
    </>
  );
}

/** A whole result: answer, figure with the values at its side, further tables and figures. */
export function Shown({ view, label }: { view: SentView; label: string }) {
  const isNarrow = view.head.length <= MOST_BESIDE && view.tables.every((one) => one.head.length <= MOST_BESIDE);
  const isBeside = isNarrow && view.figures.length > 0;
  return (
    <section aria-label={label}>
      <Answer view={view} />
      <div class={isBeside ? "result" : "result-figures"}>
        <div class="result-figures">
          <Figures view={view} />
        </div>
        <div class="result-figures">
          <Values view={view} />
        </div>
      </div>
    </section>
  );
}

/** Any result of the folder. */
export default function ResultView() {
  const { path } = route.value;
  const [view, problems] = useRequest<SentView>("/api/view", path ? { path } : null, [changesOf(path)]);
  return (
    <>
      {!path && <p>Open a result of the folder on the left.</p>}
      <Problems of={problems} />
      {view && <Shown view={view} label="Values of a result" />}
    </>
  );
}
