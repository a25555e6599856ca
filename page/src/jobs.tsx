/** The jobs of the server: how they stand, their output, an end by Ctrl-C. */
import { signal } from "@preact/signals";
import { link } from "./routes";
import { ask, read, Refused } from "./server";

interface Job {
  number: number;
  command: string;
  out: string;
  state: "running" | "done" | "failed" | "cancelled";
  tail: string;
}

const jobs = signal<Job[]>([]);
const LOOK_MS = 300;

/** Look at the jobs until none runs. */
export async function follow(): Promise<void> {
  for (;;) {
    try {
      jobs.value = (await read<{ jobs: Job[] }>("/api/jobs")).jobs;
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
    }
    if (!jobs.value.some((one) => one.state === "running")) return;
    await new Promise((resolve) => setTimeout(resolve, LOOK_MS));
  }
}

export function JobList() {
  return (
    <>
      {jobs.value.map((one) => (
        <details key={one.number} class="job" data-state={one.state} open={one.state === "failed"}>
          <summary>
            <b>{one.out}</b>: {one.state}
          </summary>
          <pre tabIndex={0} aria-label={`Command of ${one.out}`}>{one.command}</pre>
          {one.tail && <pre tabIndex={0} aria-label={`Output of ${one.out}`}>{one.tail}</pre>}
          {one.state === "running" && (
            <button type="button" onClick={() => void ask("/api/cancel", { number: one.number }).then(follow)}>
              Cancel {one.out}
            </button>
          )}
        </details>
      ))}
      {jobs.value
        .filter((one) => one.state === "done" && one.out.startsWith("results/"))
        .map((one) => (
          <p key={one.number}>
            <a href={link("friction", `${one.out}/map.parquet`)}>Show the friction map of {one.out}</a>
          </p>
        ))}
    </>
  );
}
