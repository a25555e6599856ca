/**
 * View that checks a drive against its recordings: free runs, verdicts, causes of the difference, and origin of
 * each value.
 */

import { computed, effect, signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { type Field, open as openDrive, valid } from "../drive/opened";
import { digits, instant } from "../plots/looks";
import { curveOf, Plot } from "../plots/plot";
import { link, route } from "../routes";
import type { Frame } from "../server/frame";
import { ask, attempting, Live, type Problem, Refused, read } from "../server/server";
import { filesOf, folderOf, kindOf, list, studies } from "../workspace/files";
import { JobForm } from "../workspace/form";
import { follow, JobList, jobs } from "../workspace/jobs";
import { InFolder, KINDS, Problems, ReportOf, SliderRow, Table, useCopied } from "../workspace/parts";
import { AnswerOf } from "../workspace/result";
import { type Compared, Differences } from "./differences";

interface Metrics {
  rms: number;
  largest: number;
  nrmse: number | null;
  fit_percent: number | null;
}

interface Channel {
  free: Metrics;
  restarted: Metrics;
  off_s?: number;
}

interface Recorded {
  badge?: string; // "made the fit", "held out", or empty
  name: string;
  file: string;
  sha256: string;
  samples: number;
  span: [number, number];
  start_s?: number; // time 0 on the clock of the file
  breakaway: { start_s: number; onset_s: number; measured_n: number; model_n: number; error: number }[];
  [column: string]: unknown;
}

interface Culprit {
  what: string;
  share: number;
  text: string;
  remedy: string;
  rivals: string[];
  free: string[];
}

interface Value {
  key: string;
  text: string;
  kind: string;
  origin: string;
  interval?: string;
  fit?: string;
  source?: { name: string; file: string }[];
}

interface Validation {
  name: string;
  drive: string;
  editable: boolean;
  version: string;
  window_s: number;
  synthetic: boolean;
  notes: string[];
  verdict: { what: string; text: string; met?: boolean }[];
  record: Recorded[];
  condition: Record<string, number | string>[];
  diagnosis: { left: number; clean: boolean; residual_over_noise: Record<string, number | null>; culprit?: Culprit[] };
  suspects: Field[];
  values: Value[];
  channels: { column: string; label: string; size: number; unit: string }[];
}

interface Head {
  number: number;
  problems?: Problem[];
  fit?: Record<string, number | null>;
}

const found = signal<Validation | null>(null);
const wrong = signal<Problem[]>([]);
const attempt = attempting(wrong);
const frame = signal<Frame<Head> | null>(null);
const record = signal(0);
const span = signal<[number, number]>([0, 1]);
const key = signal("");
const number = signal<number | null>(null);

const INPUTS = ["drive", "circuit", "fit", "recording"];
const path = computed(() =>
  route.value.view === "validation" && !INPUTS.includes(kindOf(route.value.path)) ? route.value.path : "",
);
/** Values that can have a slider: those of the file, and those that a cause names but the file lacks. */
const fields = computed(() =>
  [...(found.value?.suspects ?? []), ...(valid.value?.values ?? [])].filter((one) => one.number !== undefined),
);
const field = computed(() => fields.value.find((one) => one.key === key.value));
const changes = computed<Record<string, string | number>>(() => {
  const [one, value] = [field.value, number.value];
  if (!one || value === null || value === one.number) return {};
  return { [one.key]: one.unit ? `${value} ${one.unit}` : value };
});

async function load(at: string): Promise<void> {
  found.value = frame.value = number.value = difference.value = null;
  free.value = after.value = "";
  wrong.value = [];
  record.value = 0;
  try {
    const one = await read<Validation>("/api/validation", { path: at });
    if (path.value !== at) return;
    frame.value = null; // of the one before, which may have been answered meanwhile
    found.value = one;
    span.value = one.record[0]!.span;
    key.value = one.diagnosis.culprit?.find((cause) => cause.free.length)?.free[0] ?? "";
    if (one.editable) await openDrive(one.drive);
  } catch (error) {
    if (error instanceof Refused && path.value === at) wrong.value = error.problems;
  }
}

async function start(given: Record<string, unknown>): Promise<void> {
  await attempt(async () => {
    const { number: job } = await ask<{ number: number }>("/api/jobs", given);
    await follow(job);
    await list();
  });
}

export function ValidationView() {
  useEffect(() => {
    void follow();
    const page = document.documentElement.dataset;
    const count = () => (page.sent = String(live.sent + Number(live.isWaiting)));
    const live = new Live<Head>((answer) => {
      wrong.value = answer.head.problems ?? [];
      if (!answer.head.problems) frame.value = answer;
      count();
      page.drawn = String(answer.head.number);
      page.mostOnTheWay = String(live.mostOnTheWay);
    });
    const end = effect(() => {
      const now = found.value;
      if (!now || !path.value) return; // the list of validations, after one of them
      live.request({
        what: "validation",
        path: path.value,
        record: record.value,
        span: span.value,
        pixels: 1000,
        changes: changes.value,
        drive: now.drive,
      });
      count();
    });
    return () => {
      end();
      live.close();
    };
  }, []);
  useEffect(() => {
    if (path.value) void load(path.value);
  }, [path.value]);
  if (!path.value) return <Start />;
  return (
    <div class="validation">
      <h2>{found.value?.name ?? path.value}</h2>
      <p>
        <a href={link("validation")}>A new validation, and all of them</a>
      </p>
      <Problems of={wrong.value} />
      {found.value && <AnswerOf path={path.value} withFindings={false} />}
      <ReportOf folder={folderOf(path.value)} />
      {found.value && <Result now={found.value} />}
    </div>
  );
}

function Start() {
  const { path: object } = route.value;
  const start = kindOf(object) === "recording" ? { recordings: [object] } : object ? { drive: object } : {};
  return (
    <>
      <h2>Does my model hold?</h2>
      <p>
        The drive runs under the recorded command; the page shows where it leaves the recording, and what would explain
        it.
      </p>
      <JobForm
        kind="validate"
        start={{ name: "validation", ...start }}
        after={async (job) => (await follow(job.number), await list())}
      />
      <InFolder files={filesOf("validation")} title="Validations" view="validation" />
    </>
  );
}

const MARK = { yes: "Met", no: "Missed", none: "Not tested" };

function Result({ now }: { now: Validation }) {
  const one = now.record[record.value] ?? now.record[0]!;
  return (
    <>
      {now.synthetic && <p class="banner">Synthetic: the recordings were simulated.</p>}
      {!now.drive && (
        <p class="banner">
          The validated drive is no longer in this folder, because it was changed or removed. Validate again.
        </p>
      )}
      <p>
        {now.drive && (
          <>
            Drive: {now.drive.startsWith("catalogue:") ? now.drive : <a href={link("drive", now.drive)}>{now.drive}</a>}
            .{" "}
          </>
        )}
        Recordings:{" "}
        {now.record.map((each) => (
          <span key={each.name}>
            {each.file ? <a href={link("recording", each.file)}>{each.name}</a> : each.name}
            {each.badge && (
              <>
                {" "}
                <b class="badge">{each.badge}</b>
              </>
            )}{" "}
          </span>
        ))}
      </p>
      <ul class="verdicts">
        {now.verdict.map((verdict) => {
          const word = verdict.met === undefined || verdict.met === null ? "none" : verdict.met ? "yes" : "no";
          return (
            <li key={verdict.what} data-verdict={verdict.what} data-met={word}>
              <b class={word === "no" ? "missed" : ""}>{MARK[word]}</b>: {verdict.text}
            </li>
          );
        })}
      </ul>
      <div class="result">
        <Runs now={now} one={one} />
        <aside>
          <div class="panel">
            <Suspect now={now} />
          </div>
          <div class="panel">
            <Why now={now} />
          </div>
        </aside>
      </div>
      <Origins now={now} />
      {now.notes.map((note) => (
        <p class="note" key={note}>
          {note}
        </p>
      ))}
    </>
  );
}

function Why({ now }: { now: Validation }) {
  const { culprit = [], clean, left, residual_over_noise: sizes } = now.diagnosis;
  return (
    <section aria-label="Why the model is off">
      <h2>{clean && !culprit.length ? "The model at the measured states" : "Why the model is off"}</h2>
      <p>
        Residual of the balances at the measured states, as a multiple of noise and 1 % of the terms:{" "}
        {Object.entries(sizes)
          .map(([balance, size]) => `${balance.replace("_", " ")} ${digits(size, 2)}`)
          .join(", ")}
        .
      </p>
      {!culprit.length && (
        <p>
          {clean
            ? "The balances close: the residuals are sensor noise and less than 1 % of the terms."
            : "The balances do not close, but none of the known causes explains the residuals."}
        </p>
      )}
      {culprit.map((cause) => (
        <div key={cause.what} class="cause" data-cause={cause.what}>
          <p>{cause.text}</p>
          <meter min={0} max={1} value={cause.share} aria-label={`Share explained by ${cause.what}`} />{" "}
          {cause.free.map((one) => (
            <button type="button" key={one} class="link" onClick={() => ((key.value = one), (number.value = null))}>
              Slider for {one}
            </button>
          ))}
        </div>
      ))}
      {culprit.length > 0 && (
        <p class="note">{digits(100 * left, 2)} % of the residual remains without an explanation.</p>
      )}
    </section>
  );
}

function Runs({ now, one }: { now: Validation; one: Recorded }) {
  const shown = frame.value;
  const isChanged = Boolean(shown?.head.fit);
  const zoom = (from: number, to: number) => (span.value = [from, to]);
  return (
    <section aria-label="Runs beside the recording" data-from={span.value[0]} data-to={span.value[1]}>
      <h2>Runs beside the recording</h2>
      <p class="row">
        <label>
          Recording{" "}
          <select
            value={record.value}
            onChange={(event) => {
              record.value = Number(event.currentTarget.value);
              span.value = now.record[record.value]!.span;
            }}>
            {now.record.map((each, index) => (
              <option key={each.name} value={index}>
                {each.name}
              </option>
            ))}
          </select>
        </label>
        <button type="button" onClick={() => (span.value = one.span)}>
          Whole recording
        </button>
        <span class="note">
          Drag in a plot to zoom.
          {one.start_s
            ? ` Times count from the beginning of the recording: 0 s in this plot is ${digits(one.start_s, 12)} s in the file.`
            : ""}
        </span>
      </p>
      <div class="plots">
        {shown &&
          now.channels.map(({ column, label, size, unit }) => {
            const x = shown.arrays.get("time_s")!;
            const curve = (words: string, run: string) => curveOf(shown.arrays, x, `${column}.${run}`, words);
            const runs = [
              curve("measured", "measured"),
              curve("free run", "free"),
              ...(isChanged ? [curve("changed", "changed")] : []),
            ];
            const off = [
              curve(`from states, ${digits(now.window_s)} s`, "restarted.residual"),
              curve("free run", "free.residual"),
              ...(isChanged ? [curve("changed", "changed.residual")] : []),
            ];
            const isWhole = span.value[0] <= one.span[0] && span.value[1] >= one.span[1];
            const plot = {
              unit,
              size,
              onZoom: zoom,
              range: span.value,
              onReset: isWhole ? undefined : () => (span.value = one.span),
            };
            return (
              <div key={column}>
                <Plot {...plot} title={label} curves={runs} bare />
                <Plot
                  {...plot}
                  title={`residual of ${label}`}
                  curves={off}
                  height={110}
                  bare={column !== now.channels[now.channels.length - 1]!.column}
                />
              </div>
            );
          })}
      </div>
      <div class="wide" tabIndex={0} role="region" aria-label="Figures of the runs">
        <table>
          <thead>
            <tr>
              {[
                "Channel",
                "Fit, %",
                "NRMSE, %",
                "rms",
                "Largest",
                "From states: fit, %",
                "Deviates from",
                ...(isChanged ? ["Changed: fit, %"] : []),
              ].map((head) => (
                <th scope="col" key={head}>
                  {head}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {now.channels.map(({ column, label, size, unit }) => {
              const { free, restarted, off_s: off } = one[column] as Channel;
              return (
                <tr key={column}>
                  <th scope="row">{label}</th>
                  <td data-fit={column} data-si={free.fit_percent}>
                    {digits(free.fit_percent)}
                  </td>
                  <td>{digits(free.nrmse === null ? null : 100 * free.nrmse, 3)}</td>
                  <td>
                    {digits(free.rms / size, 3)} {unit}
                  </td>
                  <td>
                    {digits(free.largest / size, 3)} {unit}
                  </td>
                  <td>{digits(restarted.fit_percent)}</td>
                  <td>
                    {off === undefined ? (
                      "–"
                    ) : (
                      <button
                        type="button"
                        class="link"
                        aria-label={`Zoom to ${instant(off, now.window_s / 100)} s, where ${label} deviates`}
                        onClick={() =>
                          zoom(Math.max(off - now.window_s, one.span[0]), Math.min(off + now.window_s, one.span[1]))
                        }>
                        {instant(off, now.window_s / 100)} s
                      </button>
                    )}
                  </td>
                  {isChanged && (
                    <td data-changed={column} data-si={shown!.head.fit![column]}>
                      {digits(shown!.head.fit![column])}
                    </td>
                  )}
                </tr>
              );
            })}
          </tbody>
        </table>
      </div>
      {one.breakaway.length > 0 && <Stops one={one} />}
    </section>
  );
}

function Stops({ one }: { one: Recorded }) {
  return (
    <>
      <h2>Breakaway after stops</h2>
      <Table
        label="Breakaway after stops"
        heads={["Stop from, s", "Lasts, s", "Measured, N", "Model, N", "Error, %"]}
        rows={one.breakaway.map((stop) =>
          [stop.start_s, stop.onset_s - stop.start_s, stop.measured_n, stop.model_n, 100 * stop.error].map((value) =>
            digits(value, 3),
          ),
        )}
      />
    </>
  );
}

/** Slider that moves one value of the drive towards the recording, followed by the fit that identifies it. */
function Suspect({ now }: { now: Validation }) {
  const one = field.value;
  if (!now.editable || !fields.value.length) return null;
  const value = number.value ?? one?.number ?? 0;
  const [low, high] = one
    ? [
        Math.min(0.5 * one.number!, 1.5 * one.number!) || one.low!,
        Math.max(0.5 * one.number!, 1.5 * one.number!) || one.high!,
      ]
    : [0, 1];
  const put = (next: number) => (number.value = Number.isFinite(next) ? next : null);
  const folder = path.value.slice(0, path.value.lastIndexOf("/") + 1);
  return (
    <section aria-label="Suspect">
      <h2>Move a value towards the recording</h2>
      <p>
        <label>
          Value{" "}
          <select
            value={key.value}
            onChange={(event) => ((key.value = event.currentTarget.value), (number.value = null))}>
            <option value="">choose</option>
            {fields.value.map((each) => (
              <option key={each.key} value={each.key}>
                {each.key} = {digits(each.number, 4)} {each.unit}
              </option>
            ))}
          </select>
        </label>
      </p>
      {one && (
        <SliderRow
          id="suspect"
          label={one.key}
          name={one.key}
          value={value}
          shown={value === one.number ? digits(value, 4) : value}
          ends={[low, high]}
          unit={one.unit}
          kind={value === one.number ? one.kind : "changed"}
          state={value === one.number ? KINDS[one.kind]! : "changed"}
          put={put}
        />
      )}
      {key.value && <Refit now={now} folder={folder} />}
    </section>
  );
}

const free = signal("");
const after = signal("");
const difference = signal<Compared | null>(null);

/** Identify the suspect value from these recordings, write it into a new drive file, and show the differences. */
function Refit({ now, folder }: { now: Validation; folder: string }) {
  const wanted = free.value || key.value;
  const fit = `${folder}fit-${wanted.replace(/[^\w]+/g, "-")}.toml`;
  const target = after.value || `${now.drive.replace(/^catalogue:/, "").replace(/\.toml$/, "")}-identified.toml`;
  const files = studies.value?.files ?? [];
  const has = (file: string) => files.some((one) => one.path === file);
  const given = {
    kind: "identify",
    drive: now.drive,
    recordings: now.record.map((one) => one.file),
    free: wanted,
    out: fit,
  };
  const applied = { kind: "apply", drive: now.drive, fit, out: target };
  const [copy, copied] = useCopied(has(fit) ? applied : given, attempt);
  const busy = jobs.value.some((one) => one.state === "running" && [fit, target].includes(one.out));
  const isWithout = now.record.some((one) => !one.file);
  return (
    <>
      <p class="row">
        <label>
          Identify <input value={wanted} onInput={(event) => (free.value = event.currentTarget.value)} />
        </label>
        <button type="button" disabled={busy || has(fit) || isWithout} onClick={() => void start(given)}>
          Identify from these recordings
        </button>
        {isWithout && (
          <span class="note">
            A recording of this validation is not in the folder any more, or others have its name.
          </span>
        )}
        {has(fit) && <a href={link("friction", fit)}>{fit}</a>}
      </p>
      {has(fit) && (
        <p class="row">
          <label>
            Apply into <input value={target} onInput={(event) => (after.value = event.currentTarget.value)} />
          </label>
          <button type="button" disabled={busy || has(target)} onClick={() => void start(applied)}>
            Apply to a new drive file
          </button>
          {has(target) && (
            <>
              <a href={link("drive", target)}>{target}</a>
              <button
                type="button"
                onClick={() =>
                  void attempt(
                    async () =>
                      void (difference.value = await ask("/api/compare", { before: now.drive, after: target })),
                  )
                }>
                Compare with {now.drive}
              </button>
            </>
          )}
        </p>
      )}
      <p class="row">{copy}</p>
      {copied}
      <JobList kinds={["identify", "apply"]} />
      {difference.value && <Differences {...difference.value} />}
    </>
  );
}

function Origins({ now }: { now: Validation }) {
  if (!now.values.length) return null;
  return (
    <section aria-label="Where each value comes from">
      <h2>Where each value comes from</h2>
      <Table
        label="Values of the drive"
        heads={["Key", "Value", "Where it comes from", "95 % interval", "Recordings", "Fit"]}
        rows={now.values.map((one) => ({
          cells: [
            one.key,
            one.text,
            <>
              <span class={`kind ${one.kind}`}>{KINDS[one.kind]}</span> {one.origin.replace(/^assumed: /, "")}
            </>,
            one.interval,
            one.source?.map((each) => (
              <span key={each.name}>
                {each.file ? <a href={link("recording", each.file)}>{each.name}</a> : each.name}{" "}
              </span>
            )),
            one.fit && <a href={link("friction", one.fit)}>{one.fit}</a>,
          ],
          data: { "data-origin": one.key },
        }))}
      />
    </section>
  );
}
