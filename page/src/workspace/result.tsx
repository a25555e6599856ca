import type { ComponentChildren } from "preact";
import { FigureView } from "../plots/figure";
import { pretty } from "../plots/looks";
import { type Group, isWide, Scatter } from "../plots/scatter";
import { route } from "../routes";
import type { Finding, SentCurve, SentView } from "../server/generated";
import { read } from "../server/server";
import { useAnswer } from "./answers";
import { changesOf } from "./files";
import { Leading, Problems, Table } from "./parts";

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

/** One plot for each pair of axes; curves of one group have one colour. */
export function ShownCurves({ curves }: { curves: SentCurve[] }) {
  const axes = [...new Set(curves.map((one) => `${one.x_title}\n${one.y_title}`))];
  return (
    <>
      {axes.map((pair) => {
        const [x, y] = pair.split("\n") as [string, string];
        const groups = curves.filter((one) => `${one.x_title}\n${one.y_title}` === pair).map(drawn);
        return (
          <Scatter
            key={pair}
            title={`${y.split(",")[0]} over ${x.split(",")[0]}`}
            x={x}
            y={y}
            groups={groups}
            log={isWide(groups)}
          />
        );
      })}
    </>
  );
}

function drawn(one: SentCurve): Group {
  const points = one.x.flatMap((x, k) => {
    const y = one.y[k];
    const [low, high] = [one.low[k], one.high[k]];
    if (!one.measured[k] || x === null || y == null) return [];
    return [{ x, y, spread: low == null || high == null ? null : (high - low) / 2 }];
  });
  if (points.length === one.x.length) return { label: one.label, points }; // measured points alone have no curve between them
  const xs = points.map((point) => point.x);
  const [x, y, low, high] = [one.x, one.y, one.low, one.high].map((values) =>
    values.map((value) => value ?? Number.NaN),
  ) as [number[], number[], number[], number[]];
  return { label: one.label, points, curve: { x, y, low, high, measured: [Math.min(...xs), Math.max(...xs)] } };
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
export function Answer({
  view,
  withFindings = true,
  remedy,
}: {
  view: SentView;
  withFindings?: boolean;
  remedy?: (of: Finding) => ComponentChildren;
}) {
  const isJudged =
    view.state !== "good" || view.leading.some((one) => one.limit) || view.findings.some((one) => one.state !== "good");
  const findings = withFindings ? view.findings : [];
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
      {findings.length > 0 && (
        <ul class="findings">
          {findings.map((one) => (
            <li key={one.text} class={one.state}>
              <b>{pretty(one.text)}</b>
              {one.remedy && ` ${pretty(one.remedy.replace(/^Remedy: /, ""))}`}
              {remedy?.(one)}
            </li>
          ))}
        </ul>
      )}
    </div>
  );
}

/** Answer of a result above its special view. `changed` asks for it again; a result that cannot be read yet has none. */
export function AnswerOf({
  path,
  changed,
  withFindings = true,
}: {
  path: string;
  changed?: unknown;
  withFindings?: boolean;
}) {
  const [view] = useAnswer(path, () => read<SentView>("/api/view", { path }), [changed, changesOf(path)]);
  return view && <Answer view={view} withFindings={withFindings} />;
}

/** Figures of a view, or its curves. */
export function Figures({ view }: { view: SentView }) {
  if (view.figures.length)
    return (
      <>
        {view.figures.map((one) => (
          <div class="panel" key={one.name}>
            <FigureView shown={one} />
          </div>
        ))}
      </>
    );
  return view.curves.length ? (
    <div class="panel">
      <ShownCurves curves={view.curves} />
    </div>
  ) : null;
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
  const isBeside = isNarrow && (view.figures.length > 0 || view.curves.length > 0);
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
export function ResultView() {
  const { path } = route.value;
  const [view, problems] = useAnswer(path, () => read<SentView>("/api/view", { path }), [changesOf(path)]);
  return (
    <>
      {!path && <p>Open a result of the folder on the left.</p>}
      <Problems of={problems} />
      {view && <Shown view={view} label="Values of a result" />}
    </>
  );
}
