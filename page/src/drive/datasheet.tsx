/** The data sheet of a drive: written as a job, opened as a page. */

import { signal } from "@preact/signals";
import { pretty, sentence } from "../plots/looks";
import { route } from "../routes";
import { folderOf, nameOf } from "../workspace/files";
import { JobForm, jobs } from "../workspace/jobs";
import { useHeadlines } from "../workspace/listed";
import { ReportOf } from "../workspace/parts";
import { Circuit } from "./circuit";
import { useDrawing, valid } from "./opened";

const out = signal(""); // of the job that was started here

export default function DatasheetView() {
  const { path } = route.value;
  const state = jobs.value.find((one) => one.out === out.value)?.state;
  const shapes = useDrawing();
  const line = useHeadlines()[path];
  const name = path ? `${nameOf(path).replace(/^catalogue:|\.toml$/g, "")}-datasheet` : "datasheet";
  const now = path && valid.value?.kind ? valid.value : null;
  return (
    <section aria-label="Data sheet">
      <h2>{now?.name ? `Data sheet of ${now.name}` : "Data sheet"}</h2>
      {line && <p class="answer">{pretty(sentence(line))}</p>}
      {now && shapes && (
        <div class="panel" data-hero="circuit">
          <Circuit drawing={shapes} />
        </div>
      )}
      <p class="lead">
        The sheet holds the circuit, each characteristic with its standard and interval, the curves, and the values with
        their sources.
      </p>
      <JobForm kind="datasheet" start={{ drive: path, name }} after={(job) => void (out.value = job.out)} />
      {state === "done" && <ReportOf folder={folderOf(out.value)} changed={state} />}
    </section>
  );
}
