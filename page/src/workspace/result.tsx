/** A result in the form that terminal, notebook and report share: a table of values, curves, and sentences. */
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { isWide, Scatter, type Group } from "../plots/scatter";
import { route } from "../routes";
import { attempting, read, type Problem } from "../server/server";
import type { SentCurve, SentView } from "../server/types";
import { Problems } from "./parts";

/** Table of the values of a result. A cell carries its value in SI. */
export function ShownTable({ view }: { view: SentView }) {
  const quantities = [...new Set(view.rows.map((one) => one.quantity))];
  const labels = [...new Set(view.rows.map((one) => one.label))];
  if (!view.rows.length) return null;
  return (
    <div class="wide" tabIndex={0} role="region" aria-label={`Values: ${view.title}`}>
      <table class="cards-on-phone">
        <thead>
          <tr>{view.head.map((one, index) => <th scope="col" key={index}>{one || <span class="hidden">Name</span>}</th>)}</tr>
        </thead>
        <tbody>
          {labels.map((label, y) => (
            <tr key={label} data-row={label}>
              <th scope="row">{label}</th>
              {quantities.map((quantity, x) => {
                const one = view.rows.find((row) => row.label === label && row.quantity === quantity);
                return <td key={quantity} data-head={view.head[x + 1]} data-value={one?.key} data-si={typeof one?.value === "number" ? one.value : undefined}>{view.table[y]?.[x + 1]}</td>;
              })}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

/** One plot for each pair of axes; curves of one group have one colour. */
export function ShownCurves({ curves }: { curves: SentCurve[] }) {
  const axes = [...new Set(curves.map((one) => `${one.x_title}\n${one.y_title}`))];
  return (
    <>
      {axes.map((pair) => {
        const [x, y] = pair.split("\n") as [string, string];
        const groups = curves.filter((one) => `${one.x_title}\n${one.y_title}` === pair).map(drawn);
        return <Scatter key={pair} title={`${y.split(",")[0]} over ${x.split(",")[0]}`} x={x} y={y} groups={groups} log={isWide(groups)} />;
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
  const [x, y, low, high] = [one.x, one.y, one.low, one.high].map((values) => values.map((value) => value ?? Number.NaN)) as [number[], number[], number[], number[]];
  return { label: one.label, points, curve: { x, y, low, high, measured: [Math.min(...xs), Math.max(...xs)] } };
}

export function Notes({ of }: { of: string[] }) {
  return of.length ? <ul class="said">{of.map((one) => <li key={one}>{one}</li>)}</ul> : null;
}

/** All of a result: its headline, figures and values. */
export function Shown({ view, label }: { view: SentView; label: string }) {
  return (
    <section aria-label={label}>
      <h2>{view.title}</h2>
      <ShownTable view={view} />
      <ShownCurves curves={view.curves} />
      <Notes of={view.notes} />
    </section>
  );
}

/** Any result of the folder. */
export function ResultView() {
  const { path } = route.value;
  const view = useSignal<SentView | null>(null);
  const wrong = useSignal<Problem[]>([]);
  useEffect(() => {
    [view.value, wrong.value] = [null, []];
    if (path) void attempting(wrong)(async () => void (view.value = await read<SentView>("/api/view", { path })));
  }, [path]);
  return (
    <>
      {!path && <p>Open a result of the folder on the left.</p>}
      <Problems of={wrong.value} />
      {view.value && <Shown view={view.value} label="Values of a result" />}
    </>
  );
}
