/** Commands: forms from the server's table of signatures, with their copied lines, and the jobs that they start. */

import { signal, useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useLayoutEffect } from "preact/hooks";
import { duration } from "../plots/looks";
import { link, undoable } from "../routes";
import type { CommandInput, Form, Job, Jobs, Made, Problem } from "../server/generated";
import { ask, attempts, pause, problemsOf, read, useRequest } from "../server/server";
import { Button, Lines, type Option, pairOf, Select, Tick, Ticks, toggled } from "./fields";
import { cataloguePaths, filesOf, freeName, list, pathsOf, studies } from "./files";
import { NumberField, Problems, Unsaved, useCopied } from "./parts";

type Values = Record<string, unknown>;
/** An input of a form. A view leaves out the parts that it does not use. */
export type Input = Pick<CommandInput, "key" | "label" | "kind"> &
  Partial<Omit<CommandInput, "choices">> & { choices?: Option[]; least?: number };

const forms = signal<Record<string, Form>>({});
/** Typed values by command. They are kept while another view is shown. */
const typed = undoable(signal<Record<string, Values>>({}));
/** Values with which the fields of a command began last, and the free name among them. */
const begun: Record<string, { start: string; name: unknown }> = {};

/** Files that a field offers, by its kind. */
const KINDS: Record<string, string[]> = {
  drive: ["drive", "circuit"],
  model: ["drive", "fit"],
  map: ["friction map"],
  fit: ["fit"],
  task: ["task"],
};

const put = (kind: string, change: Values): void =>
  void (typed.value = { ...typed.value, [kind]: { ...typed.value[kind], ...change } });

/** Return the request of a form, with the values that the view gives. */
export function requestOf(kind: string, given: Values = {}): Values {
  const own = typed.value[kind] ?? {};
  const starts = Object.fromEntries(
    (forms.value[kind]?.fields ?? []).filter((one) => one.start !== "").map((one) => [one.key, one.start]),
  );
  return { kind, ...starts, ...own, ...given };
}

const recordingsIn = (inputs: Made[]): string[] =>
  inputs.flatMap((one) => [...(one.kind === "recording" && one.path ? [one.path] : []), ...recordingsIn(one.inputs)]);

/** Return the recordings that made the values of a drive, and those that a validation can use. */
export function useHeldOut(drive: string): { made: string[]; offered: string[] } {
  const isFile = filesOf("drive", "circuit", "fit").some((file) => file.path === drive);
  const [lineage] = useRequest<{ inputs: Made[] }>("/api/lineage", isFile ? { path: drive } : null, [studies.value]);
  const offered = forms.value.validate?.fields.find((one) => one.kind === "recordings")?.choices ?? [];
  return { made: recordingsIn(lineage?.inputs ?? []), offered: offered.map(([path]) => path) };
}

/** Command that a view describes itself: its button, its fields, its door, and the body of a request. */
interface OwnForm {
  title: string;
  fields: Input[];
  door: string;
  body: (values: Values) => Values;
}

interface FormProps {
  kind: string;
  own?: OwnForm;
  given?: Values; // by the view: without fields
  start?: Values; // with which the fields begin, again for each other object
  isReady?: boolean;
  after?: (job: { number: number; out: string }) => void | Promise<void>; // once it is started
  jobs?: string[]; // kinds of jobs to list
  children?: ComponentChildren;
}

export function JobForm(props: FormProps) {
  const { kind, own, given = {}, start = {}, isReady = true, after, jobs = [kind], children } = props;
  const wrong = useSignal<Problem[]>([]);
  const [, attempt] = attempts(wrong);
  const form = own ?? forms.value[kind];
  const drive = form?.fields.find((one) => one.kind === "drive" || one.kind === "model");
  const { made } = useHeldOut(kind === "validate" ? String(typed.value[kind]?.[drive?.key ?? ""] ?? "") : "");
  // The offered recordings change with the folder.
  useEffect(() => void attempt(async () => void (forms.value = await read("/api/forms"))), [studies.value]);
  const free: Values = typeof start.name === "string" ? { ...start, name: freeName(start.name, usedNames()) } : start;
  const asked = JSON.stringify(start);
  useEffect(() => void (wrong.value = []), [kind, asked]);
  useLayoutEffect(() => {
    const before = begun[kind]; // before the paint: a name that is in use is never shown as free
    begun[kind] = { start: asked, name: free.name };
    if (before?.start !== asked) put(kind, free);
    else if (typed.value[kind]?.name === before.name) put(kind, free.name ? { name: free.name } : {}); // a typed name is kept
  }, [kind, asked, free.name]);
  const values = requestOf(kind, given);
  const needed = form?.fields.find((one) => one.kind in KINDS && !values[one.key]);
  const sent = { ...values, ...numbersOf(form?.fields ?? [], values) };
  const [copy, copied] = useCopied(form && isReady && !needed && !own ? sent : null, attempt);
  if (!form) return <Problems of={wrong.value} />;
  const shown = form.fields.filter(
    (one) => !(one.key in given) && (!one.only?.length || values[one.only[0]!] === one.only[1]),
  );
  const run = () =>
    attempt(async () => {
      const job = await ask<{ number: number; out: string }>(own?.door ?? "/api/jobs", own ? own.body(sent) : sent);
      void follow();
      if (free.name) put(kind, { name: free.name }); // the typed name is in use now
      await after?.(job);
    });
  return (
    <div class="form" data-form={kind}>
      <div class="fieldset">
        {shown.map((one) => (
          <FormField
            key={one.key}
            field={one}
            value={values[one.key]}
            put={(value) => put(kind, { [one.key]: value })}
            made={made}
          />
        ))}
      </div>
      {drive && <Unsaved path={String(values[drive.key] ?? "")} />}
      <p class="row">
        <Button class="primary" disabled={!isReady || needed !== undefined} act={() => run()} words={form.title} />
        {!own && copy}
        {children}
      </p>
      <Problems of={wrong.value} />
      {copied}
      <JobList kinds={jobs} />
    </div>
  );
}

/** Return the numbers of typed texts. A text that is not a number stays: the server rejects it with the reason. */
const numbersOf = (fields: Input[], values: Values): Values =>
  Object.fromEntries(
    fields.flatMap(({ key, kind }) => {
      const text = values[key];
      if (kind !== "number" || typeof text !== "string") return [];
      return [[key, !text.trim() ? null : Number.isNaN(Number(text)) ? text : Number(text)]];
    }),
  );

/** Names of the results of the folder, without their endings. */
const usedNames = (): (string | undefined)[] =>
  (studies.value?.files ?? []).map(({ path }) => path.match(/^results\/([^/]+)/)?.[1]?.replace(/\.(toml|fmu)$/, ""));

interface InputProps {
  field: Input;
  value: unknown;
  put: (value: unknown) => void;
  made?: string[]; // recordings that made the values of the drive
}

/** An input by its kind. */
export function FormField(props: InputProps) {
  const { field, value, put: change } = props;
  const { label, kind, suffix, hint = "", choices = [] } = field;
  const files = KINDS[kind];
  const list = (value as string[] | undefined) ?? [];
  if (kind === "recordings") return <Recordings {...props} />;
  if (kind === "several") return <Ticks legend={label} options={choices} chosen={list} put={change} />;
  if (kind === "flag") return <Tick class="tick" label={label} value={value === true} put={change} />;
  if (files || kind === "choice") {
    const catalogue = kind === "drive" || kind === "model" ? cataloguePaths() : [];
    const options: Option[] = files ? [["", "choose"], ...pathsOf(...files), ...catalogue] : choices;
    return <Select label={label} value={String(value ?? "")} options={options} put={change} />;
  }
  if (kind === "number" && field.start !== null)
    return (
      <label class="choice">
        {label} <NumberField low={field.least ?? 1} high={field.most} whole value={value as number} put={change} />
      </label>
    );
  return (
    <label class="choice">
      {label}
      {suffix && ` (${suffix})`}{" "}
      <input value={String(value ?? "")} placeholder={hint} onInput={(event) => change(event.currentTarget.value)} />
    </label>
  );
}

/** Recordings to tick, of those that have the channels. */
function Recordings({ field: { label, choices = [] }, value, put: change, made = [] }: InputProps) {
  const chosen = (value as string[] | undefined) ?? [];
  const offered = new Set([...choices.map((one) => pairOf(one)[0]), ...chosen]);
  const all = filesOf("recording").map(({ path }) => path);
  const files = all.filter((path) => offered.has(path));
  const others = all.length - files.length;
  return (
    <fieldset>
      <legend>{label}</legend>
      {!files.length && <p>There is no such recording in the folder.</p>}
      {files.length > 1 && <Button act={() => change(files)}>All {files.length}</Button>}
      {others > 0 && <p class="note">Not offered: {others} recordings without these channels or without a layout.</p>}
      {files.map((path) => {
        const badge = made.length > 0 && <b class="badge">{made.includes(path) ? "made the fit" : "held out"}</b>;
        const put = () => change(toggled(chosen, path));
        return (
          <Tick
            key={path}
            class="tick"
            label={
              <>
                {path} {badge}
              </>
            }
            value={chosen.includes(path)}
            put={put}
          />
        );
      })}
    </fieldset>
  );
}

export const jobs = signal<Job[]>([]);
const LOOK_MS = 300;
/** Result of a job by kind: view, path inside the folder, text of the link. */
const RESULTS: Record<string, [view: string, file: string, words: string]> = {
  characterise: ["friction", "/map.parquet", "Show the friction map of"],
  control: ["control", "", "Show the score card of"],
  fit: ["friction", "", "Show the fit"],
  validate: ["validation", "/validation.toml", "Show the validation"],
  identify: ["friction", "", "Show the fit"],
  apply: ["drive", "", "Show the drive"],
  export: ["handover", "", "Show the variables of"],
  size: ["sizing", "", "Show the candidates of"],
};
const WATCHED = ["control", "size"]; // kinds whose results are shown while they run

const runs = (job?: number): boolean =>
  jobs.value.some((one) => one.state === "running" && (job === undefined || one.number === job));

let timer = 0; // of the next look, while a job runs

async function look(): Promise<void> {
  const ran = jobs.value.filter((one) => one.state === "running");
  await read<Jobs>("/api/jobs").then((found) => (jobs.value = found.jobs), problemsOf);
  if (ran.some((one) => !runs(one.number))) void list(); // what it wrote is in the folder
  clearTimeout(timer);
  if (runs()) timer = window.setTimeout(look, LOOK_MS);
}

/** Poll the jobs until none runs, once for all views. Return when the job with this number has ended. */
export async function follow(job = 0): Promise<void> {
  await look();
  while (runs(job)) await pause(LOOK_MS);
}

const LEAST_MS = 3000; // of a step, before the time left is told
const seen = new Map<string, { done: number; at: number }>(); // steps of jobs, as they were first seen

/** How far a job is. The time left supposes that the rest of the step goes as fast as its part so far. */
export function reached({ number, progress }: Pick<Job, "number" | "progress">): string {
  if (!progress) return "";
  const { task, done, total } = progress;
  const key = `${number} ${task}`;
  const first = seen.get(key) ?? { done, at: Date.now() };
  seen.set(key, first);
  const took = Date.now() - first.at;
  const left =
    done > first.done && took > LEAST_MS
      ? `, about ${duration((1e-3 * took * (total - done)) / (done - first.done))} left in this step`
      : "";
  return `${task}: ${done} of ${total}${left}`;
}

const isOpen = signal(false);

/** Tray of the header: number of running jobs, and each job with its output. */
export function Tray() {
  const [running, failed] = ["running", "failed"].map(
    (state) => jobs.value.filter((job) => job.state === state).length,
  );
  const words = running ? `${running} running` : failed ? `${failed} failed` : jobs.value.length;
  return (
    <details class="tray" open={isOpen.value} onToggle={(event) => (isOpen.value = event.currentTarget.open)}>
      <summary>
        Jobs <b class={failed && !running ? "badge missed" : "badge"}>{words}</b>
      </summary>
      {isOpen.value && (
        <div class="panel">
          {jobs.value.length ? <JobList /> : <p class="note">No job was started since the server began.</p>}
        </div>
      )}
    </details>
  );
}

/** List all jobs, jobs of some kinds, or jobs of one folder. With `output`, the view itself shows progress and cancels. */
export function JobList({ of, kinds, output }: { of?: string; kinds?: string[]; output?: boolean }) {
  const shown = jobs.value.filter(
    (job) => (of === undefined || job.out === of) && (!kinds || kinds.includes(job.kind)),
  );
  return (
    <>
      <p class="hidden" role="status">
        {shown.map((job) => `${job.out}: ${job.state}`).join("; ")}
      </p>
      {shown.map((job) => (
        <div key={job.number}>
          {job.state === "running" && !output && <Progress job={job} />}
          <details class="job" data-state={job.state} open={job.state === "failed"}>
            <summary>
              <b>{job.out}</b>: {job.state}
            </summary>
            <Lines name={`Command of ${job.out}`}>{job.command}</Lines>
            {job.tail && <Lines name={`Output of ${job.out}`}>{job.tail}</Lines>}
          </details>
          <ResultLink job={job} isHere={of !== undefined} />
        </div>
      ))}
    </>
  );
}

/** How far a job is, and its cancellation: it may finish its current run first. */
export function Progress({ job, name = job.out }: { job: Job; name?: string }) {
  const { number, progress, ends } = job;
  const most = Math.max(progress?.total ?? 0, progress?.done ?? 0, 1);
  const cancel = () => ask("/api/cancel", { number }).then(() => follow());
  return (
    <p class="row">
      {name} runs{progress && `, ${reached(job)}`}
      {progress && <progress aria-label={`Progress of ${name}`} value={progress.done} max={most} />}
      <Button disabled={ends} act={cancel} words={ends ? "Ends after the current run ……" : `Cancel ${name}`} />
    </p>
  );
}

/** Link to the result of a job. A library for C has no view. */
function ResultLink({ job: { kind, out, state }, isHere }: { job: Job; isHere: boolean }) {
  const [view, file, words] = RESULTS[kind] ?? [];
  const isWatched = state === "running" && WATCHED.includes(kind) && !isHere;
  if (!view || !(isWatched || state === "done") || (kind === "export" && !out.endsWith(".fmu"))) return null;
  return (
    <p>
      <a href={link(view, isWatched ? out : `${out}${file}`)}>
        {isWatched ? "Watch" : words} {out}
      </a>
    </p>
  );
}
