/** Jobs of the server: their state, their output, and a cancel button. */

import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { duration } from "../plots/looks";
import { link } from "../routes";
import { ask, Refused, read } from "../server/server";
import { list } from "./files";

interface Job {
  number: number;
  command: string;
  kind: string;
  out: string;
  state: "running" | "done" | "failed" | "cancelled";
  ends: boolean; // it was cancelled, and runs until it can stop
  tail: string;
  progress: { done: number; total: number; task: string } | null;
}

export const jobs = signal<Job[]>([]);
const LOOK_MS = 300;
/** Result of a finished job by kind: view, path inside the folder, text of the link. */
const RESULTS: Record<string, [string, string, string]> = {
  characterise: ["friction", "/map.parquet", "Show the friction map of"],
  control: ["control", "", "Show the score card of"],
  fit: ["friction", "", "Show the fit"],
  validate: ["validation", "/validation.toml", "Show the validation"],
  identify: ["friction", "", "Show the fit"],
  apply: ["drive", "", "Show the drive"],
  export: ["handover", "", "Show the variables of"],
  size: ["sizing", "", "Show the candidates of"],
};

/** Jobs whose results are shown while they run. */
const WATCHED = ["control", "size"];

const pause = () => new Promise((resolve) => setTimeout(resolve, LOOK_MS));
const runs = (job?: number): boolean =>
  jobs.value.some((one) => one.state === "running" && (job === undefined || one.number === job));

async function look(): Promise<void> {
  try {
    jobs.value = (await read<{ jobs: Job[] }>("/api/jobs")).jobs;
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
  }
}

let isLooking = false;

/** Poll the jobs until none runs, once for all views. Return when the job with this number has ended. */
export async function follow(job = 0): Promise<void> {
  await look();
  if (!isLooking) void lookOn();
  while (runs(job)) await pause();
}

async function lookOn(): Promise<void> {
  isLooking = true;
  while (runs()) {
    const ran = jobs.value.filter((one) => one.state === "running");
    await pause();
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

/** Cancel a job, which may finish its current run first. */
export function Cancel({ job, children }: { job: Job; children: ComponentChildren }) {
  return (
    <button
      type="button"
      disabled={job.ends}
      onClick={() => void ask("/api/cancel", { number: job.number }).then(() => follow())}>
      {job.ends ? "Ends after the current run ……" : children}
    </button>
  );
}

const isOpen = signal(false);

/** Tray of the header: number of running jobs, and each job with its output. */
export function Tray() {
  const [running, failed] = ["running", "failed"].map(
    (state) => jobs.value.filter((one) => one.state === state).length,
  );
  return (
    <details
      class="tray"
      open={isOpen.value}
      onToggle={(event) => (isOpen.value = (event.currentTarget as HTMLDetailsElement).open)}>
      <summary>
        Jobs{" "}
        {running ? (
          <b class="badge">{running} running</b>
        ) : failed ? (
          <b class="badge missed">{failed} failed</b>
        ) : (
          <b class="badge">{jobs.value.length}</b>
        )}
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
    (one) => (of === undefined || one.out === of) && (!kinds || kinds.includes(one.kind)),
  );
  return (
    <>
      {shown
        .filter((one) => one.state === "running" && !output)
        .map((one) => (
          <p key={one.number} class="row">
            {one.out} runs{one.progress && `, ${reached(one)}`}
            {one.progress && (
              <progress
                aria-label={`Progress of ${one.out}`}
                value={one.progress.done}
                max={Math.max(one.progress.total, one.progress.done, 1)}
              />
            )}
            <Cancel job={one}>Cancel {one.out}</Cancel>
          </p>
        ))}
      <p class="hidden" role="status">
        {shown.map((one) => `${one.out}: ${one.state}`).join("; ")}
      </p>
      {shown.map((one) => (
        <details key={one.number} class="job" data-state={one.state} open={one.state === "failed"}>
          <summary>
            <b>{one.out}</b>: {one.state}
          </summary>
          <pre tabIndex={0} role="group" aria-label={`Command of ${one.out}`}>
            {one.command}
          </pre>
          {one.tail && (
            <pre tabIndex={0} role="group" aria-label={`Output of ${one.out}`}>
              {one.tail}
            </pre>
          )}
        </details>
      ))}
      {of === undefined &&
        shown
          .filter((one) => one.state === "running" && WATCHED.includes(one.kind))
          .map((one) => (
            <p key={one.number}>
              <a href={link(RESULTS[one.kind]![0], one.out)}>Watch {one.out}</a>
            </p>
          ))}
      {shown
        .filter(
          (one) => one.state === "done" && RESULTS[one.kind] && (one.kind !== "export" || one.out.endsWith(".fmu")),
        ) // a library for C has no view
        .map((one) => (
          <p key={one.number}>
            <a href={link(RESULTS[one.kind]![0], `${one.out}${RESULTS[one.kind]![1]}`)}>
              {RESULTS[one.kind]![2]} {one.out}
            </a>
          </p>
        ))}
    </>
  );
}
