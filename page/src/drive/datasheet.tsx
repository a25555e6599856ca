/** The data sheet of a drive: written as a job, opened as a page. */
import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { follow, JobList, jobs } from "../workspace/jobs";
import { DriveChoice, folderOf, Problems, ReportOf, Unsaved, useCopied } from "../workspace/parts";
import { route } from "../routes";
import { ask, attempting, type Problem } from "../server/server";
import { studies } from "../workspace/studies";
import { filesOf, nameOf } from "../workspace/tree";

const drive = signal("");
const name = signal("");
const out = signal(""); // of the job that was started here
const wrong = signal<Problem[]>([]);
const attempt = attempting(wrong);

export function DatasheetView() {
  const { path } = route.value;
  useEffect(() => {
    [drive.value, name.value, out.value, wrong.value] = [path, path && `${nameOf(path).replace(/^catalogue:|\.toml$/g, "")}-datasheet`, "", []];
    void follow();
  }, [path]);
  const drives = [...filesOf("drive", "circuit"), ...(studies.value?.catalogue ?? [])].map((one) => one.path);
  const work = { kind: "datasheet", drive: drive.value, name: name.value };
  const [copy, copied] = useCopied(drive.value ? work : null, attempt);
  const write = () => attempt(async () => ((out.value = (await ask<{ out: string }>("/api/jobs", work)).out), void follow()));
  const state = jobs.value.find((one) => one.out === out.value)?.state;
  return (
    <section aria-label="Data sheet">
      <h2>Data sheet</h2>
      <p class="lead">The sheet holds the circuit, each characteristic with its standard and interval, the curves, and the values with their sources.</p>
      <p class="row">
        <DriveChoice label="Drive or circuit" drives={drives} chosen={drive} />
        <label>
          Into results/ <input value={name.value} onInput={(event) => (name.value = event.currentTarget.value)} />
        </label>
        <button type="button" class="primary" disabled={!drive.value || state === "running"} onClick={() => void write()}>Write the data sheet</button>
        {copy}
      </p>
      <Unsaved path={drive.value} />
      <Problems of={wrong.value} />
      {copied}
      {out.value ? <JobList of={out.value} /> : <JobList kinds={["datasheet"]} />}
      {state === "done" && <ReportOf folder={folderOf(out.value)} changed={state} />}
    </section>
  );
}
