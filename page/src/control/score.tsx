/** Score card of a benchmark: controllers and reference tracks, all runs, overlaid tracks, measured and true values. */

import { signal, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { digits, look, pretty } from "../plots/looks";
import { curveOf, Plot, zooming } from "../plots/plot";
import { useWidth } from "../plots/width";
import { link } from "../routes";
import type { Frame } from "../server/frame";
import { ask, attempting, frame, type Problem, read } from "../server/server";
import { undoable } from "../undo";
import { useAnswer } from "../workspace/answers";
import { follow, JobList, jobs } from "../workspace/jobs";
import { Copied, Problems, ReportOf, Table } from "../workspace/parts";
import { AnswerOf } from "../workspace/result";

interface ToldGain {
  key: string;
  written: string;
  meaning: string;
  rule: string;
}

interface Card {
  measure: string; // that its cells and runs are of
  drive: string;
  setup: [string, string];
  mismatch: string;
  spread: string;
  count: number;
  total: number;
  finished: boolean;
  done: number;
  laws: string[];
  references: { name: string; text: string }[];
  measures: { name: string; title: string; size: number; unit: string }[];
  cells: {
    law: string;
    reference: string;
    text: string;
    range: string[];
    value: number | null;
    best: boolean;
    lost: number;
  }[];
  each: { law: string; reference: string; seed: number; value: number | null }[];
  told: Record<string, { law: string; believes: string; period_s: number; gains: ToldGain[]; limits: string[] }>;
  plant: [string, string][];
  true: { name: string; least: string; largest: string }[];
  failed: string[];
  command: string;
  python: string;
}

interface Tracks {
  reference: string;
  laws: string[];
  seeds: number[];
  error: { unit: string; size: number };
}

const LOOK_MS = 1000; // between two looks at a comparison that runs
const measure = undoable(signal("max_error_m"));
const along = undoable(signal(""));
const zoom = signal<[number, number] | null>(null); // the part of the time that is shown
const notResumed = signal<Problem[]>([]); // it stays while the card is read again
const grownAt = signal(0); // when runs were last seen to come in
const STILL_MS = 10_000; // without a run of another process: it has ended, or is slow

export function ScoreCard({ path }: { path: string }) {
  const job = jobs.value.find((one) => one.out === path);
  const round = useSignal(0);
  const [found, problems] = useAnswer(
    path,
    async () => ({
      ...(await read<Card>("/api/comparison", { path, measure: measure.value })),
      measure: measure.value,
    }),
    [measure.value, job?.state, round.value],
  );
  const reference = (found?.references.find(({ name }) => name === along.value) ?? found?.references[0])?.name ?? "";
  const isUnfinished = found?.finished === false; // whatever process does its runs, they come in
  useEffect(() => {
    [notResumed.value, grownAt.value] = [[], 0];
    void follow();
  }, [path]);
  const runs = useRef(0);
  useEffect(() => {
    if (found && found.done > runs.current && runs.current) grownAt.value = Date.now();
    runs.current = found?.done ?? 0;
    if (job?.state !== "running" && !isUnfinished) return;
    const timer = setTimeout(() => (round.value += 1), LOOK_MS); // the next look waits for the answer
    return () => clearTimeout(timer);
  }, [found, job?.state]);
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
      {found?.finished && <AnswerOf path={path} />}
      {found && !found.finished && (
        <p data-done={found.done}>
          {found.done} of {found.total} runs are done. The medians below are of those, and can change.
        </p>
      )}
      {found && !found.finished && <Unfinished path={path} state={job?.state} />}
      <JobList of={path} />
      {found && found.done > 0 && <Along found={found} reference={reference} now={tracks} />}
      {found && <About found={found} />}
      {found && <Told found={found} />}
      {found && (
        <details>
          <summary>The same as a command and as Python</summary>
          <Copied
            command={found.command || "This benchmark was not started by a command in this folder."}
            python={found.python}
          />
        </details>
      )}
    </div>
  );
}

function About({ found }: { found: Card }) {
  const each = found.spread ? `${found.count} members of the spread ${found.spread}` : `${found.count} seeds of noise`;
  return (
    <>
      <p class="note">
        Synthetic: controllers and drive share the equations of the simulation. Only the controllers' parameters can be
        wrong.
      </p>
      <p>
        <b>{found.drive}</b>, setup {found.setup[0]}, {each} for each law and reference
        {found.mismatch && `, the true drive deviates by ${found.mismatch}`}. {found.setup[1]}
      </p>
    </>
  );
}

function Unfinished({ path, state }: { path: string; state: string | undefined }) {
  const isRunning = state === "running";
  const isElsewhere = !state && Date.now() - grownAt.value < STILL_MS; // asked again at each look
  const resume = () =>
    attempting(notResumed)(async () => {
      await ask("/api/comparisons", { resume: path });
      await follow();
    });
  return (
    <p class="row" role="status">
      Not finished: runs that are done are kept.{" "}
      {!isRunning && isElsewhere && "A process that this server did not start continues them."}
      {!isRunning && !isElsewhere && (
        <button type="button" onClick={() => void resume()}>
          Resume
        </button>
      )}
    </p>
  );
}

function Matrix({ found, reference }: { found: Card; reference: string }) {
  const now = found.measures.find((one) => one.name === found.measure)!;
  const middle = found.spread
    ? "median, then the limit for 95 % and for all of the members"
    : "median of the seeds, then least and largest";
  return (
    <section aria-label="Score card">
      <p class="row">
        <label>
          Measure{" "}
          <select value={measure.value} onChange={(event) => (measure.value = event.currentTarget.value)}>
            {found.measures.map((one) => (
              <option key={one.name} value={one.name}>
                {one.title}
              </option>
            ))}
          </select>
        </label>
        <span class="note">{middle}; simulated. ★ smallest of a column.</span>
      </p>
      <div class="scroll" tabIndex={0} role="region" aria-label={`${now.title} of controllers and references`}>
        <table class="card">
          <thead>
            <tr>
              <th scope="col">{now.title}</th>
              {found.references.map((one) => (
                <th scope="col" key={one.name} title={one.text}>
                  <button
                    type="button"
                    class="link"
                    aria-pressed={reference === one.name}
                    onClick={() => (along.value = one.name)}>
                    {one.name}
                  </button>
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {found.laws.map((law, index) => (
              <tr key={law}>
                <th scope="row">
                  <Mark index={index} /> {law}
                </th>
                {found.references.map((one) => (
                  <Cell key={one.name} of={found.cells.find((it) => it.law === law && it.reference === one.name)} />
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {found.failed.map((one) => (
        <p class="note" key={one}>
          Failed: {one}
        </p>
      ))}
    </section>
  );
}

function Cell({ of }: { of: Card["cells"][number] | undefined }) {
  if (!of) return <td>–</td>;
  const range = of.range.filter((one) => one).join(" … ");
  return (
    <td data-cell={`${of.law}/${of.reference}`} data-si={of.value} class={of.best ? "best" : ""}>
      {pretty(of.text) || "–"}
      {of.best && " ★"}
      {range && of.text && <small>{pretty(range)}</small>}
      {of.lost > 0 && <small class="kind changed">lost: {of.lost}</small>}
    </td>
  );
}

/** Line style of a controller. */
function Mark({ index }: { index: number }) {
  const { color, dash } = look(index);
  return (
    <svg viewBox="0 0 34 8" width="34" height="8" aria-hidden="true">
      <line x1="0" y1="4" x2="34" y2="4" stroke={color} stroke-width="2.2" stroke-dasharray={dash.join(" ")} />
    </svg>
  );
}

function Along({ found, reference, now }: { found: Card; reference: string; now: Frame<Tracks> | null }) {
  const text = found.references.find((one) => one.name === reference)?.text;
  const measured = found.measures.find((one) => one.name === found.measure)!;
  return (
    <section aria-label={`Along ${reference}`}>
      <div class="pair">
        <Matrix found={found} reference={reference} />
        <Strip
          title={measured.title}
          unit={measured.unit}
          size={measured.size}
          rows={found.laws.map((name) => ({
            name,
            values: found.each
              .filter((run) => run.law === name && run.reference === reference && run.value !== null)
              .map((run) => ({ value: run.value!, title: `${name}, ${found.spread ? "member" : "seed"} ${run.seed}` })),
          }))}
        />
      </div>
      <h2>
        Along {reference}
        {text !== reference && `: ${text}`}
      </h2>
      {now && (
        <div class="plots">
          <Plot
            title="Tracks"
            unit="mm"
            size={1e-3}
            height={110}
            bare
            {...zooming(zoom)}
            curves={[
              ...now.head.laws.map((law) => ({ ...curve(now, law, "position_m", law), look: found.laws.indexOf(law) })),
              ...(now.head.laws[0]
                ? [{ ...curve(now, now.head.laws[0], "reference_m", "reference"), look: found.laws.length }]
                : []),
            ]}
          />
          <Plot
            title="Errors"
            unit={now.head.error.unit}
            size={now.head.error.size}
            height={110}
            {...zooming(zoom)}
            curves={now.head.laws.map((law) => ({ ...curve(now, law, "error_m", law), look: found.laws.indexOf(law) }))}
          />
        </div>
      )}
      {now && <p class="note">First run of each controller. Error: reference minus true position.</p>}
    </section>
  );
}

const curve = (of: Frame<Tracks>, law: string, column: string, label: string) =>
  curveOf(of.arrays, of.arrays.get(`${law}/time_s`)!, `${law}/${column}`, label);

const ROW = 26; // pixels
const MOST = 700; // width, pixels

/** A controller and its values on the axis, SI. */
export interface StripRow {
  name: string;
  values: { value: number; title: string }[];
}

interface StripProps {
  title: string;
  unit: string;
  size: number;
  rows: StripRow[];
  goal?: number; // largest value that is allowed, SI
}

/** Values of each controller on its line, over a logarithmic axis, against the goal. */
export function Strip({ title, unit, size, rows, goal }: StripProps) {
  const [place, room] = useWidth<HTMLElement>();
  const width = Math.min(MOST, room);
  const left = Math.min(120, 0.3 * width);
  const known = rows.map((row) => ({ ...row, values: row.values.filter(({ value }) => value > 0) }));
  const all = known.flatMap((row) => row.values.map(({ value }) => value));
  if (!all.length)
    return (
      <figure class="plot strip note" ref={place}>
        {title}: no number above zero along this reference.
      </figure>
    );
  const logs = [...all, ...(goal ? [goal] : [])].map((value) => Math.log10(value / size));
  const [low, high] = [Math.floor(Math.min(...logs)), Math.ceil(Math.max(...logs) + 1e-9)];
  const at = (value: number) => left + ((Math.log10(value / size) - low) / (high - low)) * (width - left - 20);
  const height = ROW * rows.length + 36;
  const decades = Array.from({ length: high - low + 1 }, (_, index) => 10 ** (low + index));
  const words = known.map((row) => `${row.name} ${row.values.map(({ value }) => digits(value / size)).join(", ")}`);
  return (
    <figure class="plot strip" data-strip-of={title} ref={place}>
      <figcaption>
        {title} of each run, {pretty(unit)}
        {goal !== undefined && `; dashed: the goal, ${digits(goal / size)}`}
      </figcaption>
      <svg width={width} height={height} role="img" aria-label={`${title}, ${unit}: ${words.join("; ")}`}>
        {decades.map((one) => (
          <g key={one}>
            <line x1={at(one * size)} x2={at(one * size)} y1={4} y2={height - 30} class="grid" />
            <text x={at(one * size)} y={height - 14} text-anchor="middle">
              {one >= 1 ? one : digits(one)}
            </text>
          </g>
        ))}
        {goal !== undefined && <path class="goal" d={`M${at(goal)} 0V${height - 30}`} />}
        {known.map((row, index) => {
          const y = 4 + ROW * (index + 0.5);
          return (
            <g key={row.name} data-strip={row.name}>
              <text x={left - 10} y={y + 4} text-anchor="end">
                {row.name}
              </text>
              {row.values.map(({ value, title }) => (
                <line
                  key={title}
                  class={goal !== undefined && value > goal ? "over" : ""}
                  x1={at(value)}
                  x2={at(value)}
                  y1={y - 8}
                  y2={y + 8}
                  stroke={look(index).color}
                  stroke-width="3">
                  <title>
                    {title}: {digits(value / size)} {unit}
                  </title>
                </line>
              ))}
              {row.values.length === 1 && (
                <text
                  x={at(row.values[0]!.value) + 6}
                  y={y + 4}
                  class={goal && row.values[0]!.value > goal ? "missed" : ""}>
                  {digits(row.values[0]!.value / size)}
                  {goal !== undefined && (row.values[0]!.value > goal ? ", misses" : ", keeps")}
                </text>
              )}
            </g>
          );
        })}
      </svg>
    </figure>
  );
}

export function Gains({ gains, of = "" }: { gains: ToldGain[]; of?: string }) {
  return (
    <Table
      heads={["Gain", "Value", "Meaning", "Follows from"]}
      rows={gains.map((one) => [one.key, one.written, one.meaning, one.rule])}
      label={of ? `Gains of ${of}` : "Gains"}
    />
  );
}

function Told({ found }: { found: Card }) {
  return (
    <section aria-label="Told and true">
      <details>
        <summary>What the controllers assume of the drive</summary>
        <Table
          heads={["Drive as assumed by the controllers, near mid-stroke", ""]}
          rows={found.plant}
          label="The drive as its controllers assume it"
        />
        {Object.entries(found.told).map(([law, one]) => (
          <details key={law}>
            <summary>
              {law}: {one.law} for {one.believes}, every {digits(1e3 * one.period_s)} ms
            </summary>
            <Gains gains={one.gains} of={law} />
            <ul>
              {one.limits.map((it) => (
                <li key={it}>{it}</li>
              ))}
            </ul>
          </details>
        ))}
      </details>
      <h2>True drive</h2>
      {found.true.length ? (
        <Table
          heads={["Deviation of the true drive: factor, or SI", "least", "largest"]}
          rows={found.true.map((one) => [one.name, one.least, one.largest])}
          label="True drive"
        />
      ) : (
        <p>
          {found.finished
            ? `The drive ${found.drive}, ${found.mismatch ? `changed by ${found.mismatch}` : "as described"}; sensors and converters as in the instrumentation.`
            : "Not known before the runs are done."}
        </p>
      )}
    </section>
  );
}
