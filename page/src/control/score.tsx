/** Score card of a benchmark: controllers and reference tracks, all runs, overlaid tracks, measured and true values. */

import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { FigureView } from "../plots/figure";
import { MM, pretty } from "../plots/looks";
import { curveOf, LineSample, Plot, zooming } from "../plots/plot";
import { stripFigure } from "../plots/points";
import { kept, link, undoable } from "../routes";
import type { Frame } from "../server/frame";
import type { Card, SentView, Tracks } from "../server/generated";
import { ask, attempts, frame, LOOK_MS, read, useAnswer, useWatched } from "../server/server";
import { Button, type Cell, Fold, Select, Table } from "../workspace/fields";
import { follow, JobList, jobs } from "../workspace/jobs";
import { Copied, NumberField, Problems, ReportOf } from "../workspace/parts";
import { Answer, Findings, Notes, useView, Values } from "../workspace/result";

/** Measure that the goal limits. */
export const MEASURE = "max_error_m";

/** Largest error that is allowed, mm, of the address. */
const goal = kept("goal");
export const goalOf = (): number => Number(goal.value) || 0.2;

export function GoalField() {
  const put = (value: number) => (goal.value = String(value));
  return (
    <label>
      Goal <NumberField label="Largest error allowed, mm" low={1e-6} value={goalOf()} put={put} /> mm largest error
    </label>
  );
}

const measure = undoable(signal(MEASURE));
const along = undoable(signal(""));
const zoom = signal<[number, number] | null>(null); // the part of the time that is shown
const [notResumed, resuming] = attempts(); // it stays while the card is read again
const grownAt = signal(0); // when runs were last seen to come in
const STILL_MS = 10_000; // without a run of another process: it has ended, or is slow

export function ScoreCard({ path }: { path: string }) {
  const job = jobs.value.find((one) => one.out === path);
  const [found, problems] = useWatched(
    path,
    () => read<Card>("/api/comparison", { path, measure: measure.value }),
    (last) => (job?.state === "running" || last?.finished === false ? LOOK_MS : 0), // whatever process does its runs
    [measure.value, job?.state],
  );
  const view = useView(found?.finished ? path : "");
  const reference = (found?.references.find(({ name }) => name === along.value) ?? found?.references[0])?.name ?? "";
  useEffect(() => void ([notResumed.value, grownAt.value] = [[], 0]), [path]);
  const runs = useRef(0);
  useEffect(() => {
    if (found && found.done > runs.current && runs.current) grownAt.value = Date.now();
    runs.current = found?.done ?? 0;
  }, [found]);
  /* During a benchmark, the tracks of a controller appear after its first run along the reference. */
  const ready = new Set(found?.each.filter((run) => run.reference === reference).map((run) => run.law)).size;
  const [tracks] = useAnswer(
    ready ? `${path}/${reference}` : "",
    () => frame<Tracks>("/api/tracks", { path, reference, pixels: "1000" }),
    [ready, found?.finished],
  );
  useEffect(() => void (zoom.value = null), [path, reference]);
  return (
    <div class="score">
      <div class="row title">
        <div>
          <h2>{path}</h2>
          <a href={link("control")}>A run, a new benchmark, and all benchmarks</a>
        </div>
        <ReportOf folder={path} changed={found?.finished} />
      </div>
      <Problems of={[...problems, ...notResumed.value]} />
      {view && <Answer view={view} />}
      {found && !found.finished && (
        <>
          <p data-done={found.done}>
            {found.done} of {found.total} runs are done. The medians below are of those, and can change.
          </p>
          <Unfinished path={path} state={job?.state} />
          <Findings of={found.failed.map((text) => ({ text, state: "bad", remedy: "" }))} />
        </>
      )}
      <JobList of={path} />
      {found && found.done > 0 && <Along found={found} reference={reference} now={tracks} />}
      <p class="note">
        Synthetic: controllers and drive share the equations of the simulation, so only the parameters that controllers
        assume can be wrong.
      </p>
      <Notes of={view?.notes ?? []} />
      {found && <Told view={found.told} />}
      {found && (
        <Fold title="The same as a command and as Python">
          <Copied
            command={found.command || "This benchmark was not started by a command in this folder."}
            python={found.python}
          />
        </Fold>
      )}
    </div>
  );
}

/** Continuation of a benchmark that nothing runs. */
function Unfinished({ path, state }: { path: string; state: string | undefined }) {
  const isElsewhere = !state && Date.now() - grownAt.value < STILL_MS; // asked again at each look
  const resume = () => resuming(async () => (await ask("/api/comparisons", { resume: path }), follow()));
  return (
    <p class="row" role="status">
      Not finished: runs that are done are kept.{" "}
      {isElsewhere && "A process that this server did not start continues them."}
      {state !== "running" && !isElsewhere && <Button act={resume}>Resume</Button>}
    </p>
  );
}

function Matrix({ found, reference }: { found: Card; reference: string }) {
  const now = found.measures.find((one) => one.name === found.measure)!;
  const headOf = ({ name, text }: Card["references"][number]) => ({
    text: <Button class="link" aria-pressed={reference === name} act={() => (along.value = name)} words={name} />,
    data: { title: text },
  });
  const middle = found.spread
    ? "median, then the limit for 95 % and for all of the members"
    : "median of the seeds, then least and largest";
  return (
    <section aria-label="Score card">
      <p class="row">
        <Select
          label="Measure"
          value={measure.value}
          options={found.measures.map((one): [string, string] => [one.name, one.title])}
          put={(name) => (measure.value = name)}
        />
        {measure.value === MEASURE && <GoalField />}
        <span class="note">{middle}; simulated. ★ smallest of a column.</span>
      </p>
      <Table
        class="card"
        label={`${now.title} of controllers and references`}
        heads={[now.title, ...found.references.map(headOf)]}
        rows={found.laws.map((law, index) => [
          <>
            <LineSample index={index} /> {law}
          </>,
          ...found.references.map(({ name }) =>
            cellOf(found.cells.find((cell) => cell.law === law && cell.reference === name)),
          ),
        ])}
      />
    </section>
  );
}

function cellOf(cell: Card["cells"][number] | undefined): Cell {
  if (!cell) return "–";
  const range = cell.range.filter((end) => end).join(" … ");
  const text = (
    <>
      {pretty(cell.text) || "–"}
      {cell.best && " ★"}
      {range && cell.text && <small>{pretty(range)}</small>}
      {cell.lost > 0 && <small class="kind changed">lost: {cell.lost}</small>}
    </>
  );
  const data = { "data-cell": `${cell.law}/${cell.reference}`, "data-si": cell.value, class: cell.best ? "best" : "" };
  return { text, data };
}

function Along({ found, reference, now }: { found: Card; reference: string; now: Frame<Tracks> | null }) {
  const text = found.references.find((one) => one.name === reference)?.text;
  const measured = found.measures.find((one) => one.name === found.measure)!;
  const runs = found.each.filter((run) => run.reference === reference && run.value !== null);
  const kind = found.spread ? "member" : "seed";
  const rows = found.laws.map((name) => {
    const own = runs.filter((run) => run.law === name);
    const values = own.map(({ value, seed }) => ({ value: value! / measured.size, of: `${name}, ${kind} ${seed}` }));
    return { name, values };
  });
  const limit = measured.name === MEASURE ? (goalOf() * MM) / measured.size : undefined;
  return (
    <section aria-label={`Along ${reference}`}>
      <div class="pair">
        <Matrix found={found} reference={reference} />
        {runs.some((run) => run.value! > 0) ? (
          <FigureView
            shown={stripFigure(`${measured.title} of each run`, `${measured.title}, ${measured.unit}`, rows, limit)}
          />
        ) : (
          <p class="note">{measured.title}: no number above zero along this reference.</p>
        )}
      </div>
      <h2>
        Along {reference}
        {text !== reference && `: ${text}`}
      </h2>
      {now && <Overlay now={now} laws={found.laws} />}
      {now && <p class="note">First run of each controller. Error: reference minus true position.</p>}
    </section>
  );
}

/** Tracks and errors of the laws above each other. */
function Overlay({ now: { head, arrays }, laws }: { now: Frame<Tracks>; laws: string[] }) {
  const curve = (law: string, column: string, label = law) => ({
    ...curveOf(arrays, arrays.get(`${law}/time_s`)!, `${law}/${column}`, label),
    look: label === law ? laws.indexOf(law) : laws.length,
  });
  const tracks = head.laws.map((law) => curve(law, "position_m"));
  const reference = head.laws.slice(0, 1).map((law) => curve(law, "reference_m", "reference"));
  const errors = head.laws.map((law) => curve(law, "error_m"));
  const shared = { height: 110, ...zooming(zoom) };
  return (
    <div class="plots">
      <Plot title="Tracks" unit="mm" size={MM} bare {...shared} curves={[...tracks, ...reference]} />
      <Plot title="Errors" {...head.error} {...shared} curves={errors} />
    </div>
  );
}

/** The drive as laws assume it, and the deviations of the true one. */
export const Told = ({ view }: { view: SentView }) => (
  <Fold title={view.title}>
    <Values view={view} />
  </Fold>
);
