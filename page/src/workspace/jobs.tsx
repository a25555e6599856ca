/** Jobs of the server: their state, their output, and a cancel button. */

import { signal } from "@preact/signals";
import { duration } from "../plots/looks";
import { link } from "../routes";
import type { Job, Jobs } from "../server/generated";
import { ask, pause, problemsOf, read } from "../server/server";
import { Button, Lines } from "./fields";
import { list } from "./files";

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

const look = (): Promise<unknown> => read<Jobs>("/api/jobs").then((found) => (jobs.value = found.jobs), problemsOf);

let isLooking = false;

/** Poll the jobs until none runs, once for all views. Return when the job with this number has ended. */
export async function follow(job = 0): Promise<void> {
  await look();
  if (!isLooking) void lookOn();
  while (runs(job)) await pause(LOOK_MS);
}

async function lookOn(): Promise<void> {
  isLooking = true;
  while (runs()) {
    const ran = jobs.value.filter((one) => one.state === "running");
    await pause(LOOK_MS);
    await look();
    if (ran.some((one) => !runs(one.number))) void list(); // what it wrote is in the folder
  }
  isLooking = false;
}

const LEAST_MS = 3000; // of a step, before the time left is told
const begun = new Map<string, { done: number; at: number }>(); // steps of jobs, as they were first seen

/** How far a job is. The time left supposes that the rest of the step goes as fast as its part so far. */
export function reached({ number, progress }: Pick<Job, "number" | "progress">): string {
  if (!progress) return "";
  const { task, done, total } = progress;
  const key = `${number} ${task}`;
  const first = begun.get(key) ?? { done, at: Date.now() };
  begun.set(key, first);
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
