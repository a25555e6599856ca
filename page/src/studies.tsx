/** Start page: content of the folder by kind, and the drives of the catalogue. */
import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Differences, type Compared } from "./differences";
import { Chain, lookForStale, stale, trace } from "./lineage";
import { Copied, Problems } from "./parts";
import { ask, connection, drop, read, Refused, type Listed, type Problem, type Studies } from "./server";
import { link, VIEW_OF } from "./routes";

declare const __BUILD__: string;

export const studies = signal<Studies | null>(null);
export const isOld = signal(false);
const filter = signal("");

let listing: Promise<void> | null = null;

/** Read the folder. */
export function list(): Promise<void> {
  const mine = readFolder().finally(() => (listing = listing === mine ? null : listing));
  return (listing = mine);
}

async function readFolder(): Promise<void> {
  try {
    studies.value = await read<Studies>("/api/studies");
    isOld.value = studies.value.build !== __BUILD__;
    lookForStale();
    compare();
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    if (error.status) refused.value = error.problems; // a server that is gone has a line of its own
  }
}

const taking = signal("");
const refused = signal<Problem[]>([]);

let copying = Promise.resolve();

/** Copy files into the folder one after the other, including files that arrive meanwhile. */
export function take(files: File[]): Promise<void> {
  if (!taking.value) refused.value = [];
  return (copying = copying.then(() => copyIn(files)));
}

/** Copy files into the folder. A single recording is opened. */
async function copyIn(files: File[]): Promise<void> {
  if (!files.length) return;
  for (const [index, file] of files.entries()) {
    taking.value = `Copying ${file.name}, ${size(file.size)} (${index + 1} of ${files.length}).`;
    try {
      await drop(file);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      refused.value = [...refused.value, ...error.problems];
    }
  }
  taking.value = "";
  await list();
  const own = studies.value?.files.find((one) => one.path === files[0]!.name);
  if (files.length === 1 && own?.kind === "recording" && !refused.value.length) location.hash = link("recording", own.path);
  else location.hash = link("studies");
}

/** Accept files that are dropped anywhere on the page. */
export function takeDrops(): void {
  const isFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
  addEventListener("dragover", (event) => isFiles(event) && event.preventDefault());
  addEventListener("drop", (event) => {
    if (!isFiles(event)) return;
    event.preventDefault();
    void take([...event.dataTransfer!.files]);
  });
}

const TITLES: Record<string, string> = {
  drive: "Drives",
  circuit: "Circuits",
  recording: "Recordings",
  campaign: "Campaigns",
  comparison: "Comparisons of laws",
  "friction map": "Friction maps",
  fit: "Fits",
  validation: "Validations",
  fmu: "Drives for other tools",
  task: "Tasks of drives",
  sizing: "Sizings",
  layout: "Layouts",
  protocol: "Protocols",
  rig: "Rigs",
  setup: "Setups",
  controller: "Controllers",
  formula: "Laws of friction and other parts as formulas",
  other: "Other TOML files",
  unreadable: "Files that cannot be read",
};
const MOST = 200; // rows of a kind on the page; the filter finds the others

function size(bytes: number): string {
  return bytes < 1e4 ? `${bytes} B` : bytes < 1e7 ? `${Math.round(bytes / 1e3)} kB` : `${Math.round(bytes / 1e6)} MB`;
}

export function StudiesView() {
  useEffect(() => void (listing ?? list()), [connection.value === "open"]); // what the page reads as it begins is read once
  const found = studies.value;
  if (!found) return refused.value.length ? <Problems of={refused.value} /> : <p>Reading the folder.</p>;
  const word = filter.value.toLowerCase();
  const files = found.files.filter((one) => one.path.toLowerCase().includes(word));
  const drives = found.catalogue.filter((one) => `${one.path} ${one.title}`.toLowerCase().includes(word));
  return (
    <>
      <p class="row">
        <label>
          Show only <input type="search" value={filter.value} onInput={(event) => (filter.value = event.currentTarget.value)} />
        </label>
        <button type="button" onClick={() => void list()}>Read the folder again</button>
        <span>
          {found.files.length} files in {found.folder}
          {found.left_out > 0 && `; ${found.left_out} names are no UTF-8 and left out`}
          {found.is_cut && "; those beyond are not listed: start pneudrive web in a folder below"}
        </span>
      </p>
      <p class="row">
        <label>
          Copy files into the folder (or drop them anywhere on the page){" "}
          <input type="file" multiple onChange={({ currentTarget: own }) => (void take([...(own.files ?? [])]), (own.value = ""))} />
        </label>
        <span role="status">{taking.value}</span>
      </p>
      <Problems of={refused.value} />
      <Compare />
      <Chain files={found.files} />
      {stale.value.unchecked > 0 && <p class="note">{stale.value.unchecked} older results were not checked against their inputs.</p>}
      {Object.entries(TITLES).map(([kind, title]) => (
        <Kind key={kind} title={title} files={files.filter((one) => one.kind === kind)} />
      ))}
      <section>
        <h2>Catalogue: drives to begin with</h2>
        <ul class="files">
          {drives.map((one) => (
            <li key={one.path}>
              <a href={link("simulate", one.path)}>{one.path.replace("catalogue:", "")}</a>
              <span>{one.title}</span>
            </li>
          ))}
        </ul>
      </section>
    </>
  );
}

/** Kinds that can be compared in pairs, and kinds that carry or supply hashes of inputs. */
const ALIKE = ["drive", "fit"];
const TRACED = ["drive", "circuit", "recording", "friction map", "fit", "validation", "comparison", "campaign", "rig"];
const pair = signal<string[]>([]);
const compared = signal<Compared | null>(null);
const apart = signal<Problem[]>([]);

/** Select a file for the comparison. The newest two count. */
const tick = (path: string): void => {
  pair.value = pair.value.includes(path) ? pair.value.filter((one) => one !== path) : [...pair.value, path].slice(-2);
  compared.value = null;
  compare();
};

/** Compare the two selected files in their current state. */
function compare(): void {
  const [before, after] = pair.value;
  apart.value = [];
  if (!before || !after) return;
  const isSame = () => pair.value[0] === before && pair.value[1] === after; // other files may be selected meanwhile
  void ask<Compared>("/api/compare", { before, after }).then(
    (found) => void (isSame() && (compared.value = found)),
    (error: unknown) => {
      if (!(error instanceof Refused)) throw error;
      if (isSame()) [compared.value, apart.value] = [null, error.problems];
    },
  );
}

function Compare() {
  if (!pair.value.length) return null;
  return (
    <section aria-label="Compare two">
      <h2>{pair.value.length < 2 ? `Compare ${pair.value[0]} with another drive or fit: tick it` : pair.value.join(" and ")}</h2>
      <Problems of={apart.value} />
      {compared.value && <Differences {...compared.value} />}
      {compared.value && <Copied {...compared.value} />}
    </section>
  );
}

function Kind({ title, files }: { title: string; files: Listed[] }) {
  if (!files.length) return null;
  return (
    <section>
      <h2>{title}</h2>
      <ul class="files">
        {files.slice(0, MOST).map((one) => (
          <li key={one.path}>
            {VIEW_OF[one.kind] ? <a href={link(VIEW_OF[one.kind]!, one.path)}>{one.path}</a> : <span>{one.path}</span>}
            <span>
              {size(one.size)}, {new Date(1000 * one.changed).toLocaleString()}
              {stale.value.stale[one.path] && <b class="missed" data-stale={one.path}> out of date: made from another {stale.value.stale[one.path]!.join(", ")}</b>}
            </span>
            <span class="row">
              {ALIKE.includes(one.kind) && (
                <label>
                  <input type="checkbox" aria-label={`Compare ${one.path}`} checked={pair.value.includes(one.path)} onChange={() => tick(one.path)} /> compare
                </label>
              )}
              {TRACED.includes(one.kind) && <button type="button" class="link" aria-label={`Chain of ${one.path}`} onClick={() => void trace(one.path)}>chain</button>}
            </span>
          </li>
        ))}
      </ul>
      {files.length > MOST && <p>{files.length - MOST} more; narrow the list above.</p>}
    </section>
  );
}
