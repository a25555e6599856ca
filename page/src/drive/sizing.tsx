/** View of sizing: text and check of the task, the search as a job, and candidates over time and air. */

import { computed, signal } from "@preact/signals";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import { count, digits, fitting, isSevere } from "../plots/looks";
import { ticks } from "../plots/strip";
import { isToml, link, route } from "../routes";
import type { MachineCheck } from "../server/generated";
import { ask, attempting, type Problem, Refused, read, write } from "../server/server";
import { list, studies } from "../workspace/files";
import { JobForm } from "../workspace/form";
import { Cancel, follow, JobList, jobs, reached } from "../workspace/jobs";
import { InFolder, NumberField, Problems, ReportOf, SaveButton, Table, Tiles, useCopied } from "../workspace/parts";
import type { Editor } from "./editor";
import { wasSaved } from "./opened";

interface Limit {
  name: string;
  value: number | null;
  limit: number;
  unit: string;
  margin: number | null;
  interval: Ends;
}

/** Values that 99 % and 1 % of the samples exceed. Folders of earlier versions do not have them. */
type Ends = [number | null, number | null] | null;

interface Candidate {
  name: string;
  parts: Record<string, string>;
  setting: string;
  draws: number;
  met: number;
  at_least: number;
  time_out: number | null;
  time_back: number | null;
  end_speed: number | null;
  energy: number | null;
  air: number | null;
  load_ratio: number | null;
  intervals: Record<string, Ends>;
  margin: number | null;
  binding: string;
  limits: Limit[];
  meets: boolean; // as the ranking says
  misses: boolean;
  place: number | null;
  file: string;
  measure: string;
  explains: number;
}

interface Sizing {
  name: string;
  task: string;
  draws: number;
  limits: { out: number; back: number };
  candidates: Candidate[];
  meets: number; // of the ranking, the one count of this view
  checks: MachineCheck[]; // of the best, open ones first
  short: number;
  done: boolean;
  searched: boolean; // by a process, of this server or not
  feasible: boolean | null;
  miss: { limit: string; gives: string } | null;
  said: string[];
  asked: { least: number; draws: number } | null;
  provisional: string;
}

interface Task {
  problems: Problem[];
  name?: string;
  values?: { key: string; text: string; given: boolean; meaning: string }[];
  follows?: { what: string; value: number; unit: string }[];
}

const text = signal("");
const saved = signal("");
const sha256 = signal("");
const task = signal<Task | null>(null);
/** Last valid answer, kept while the text is wrong. */
const meant = signal<Task | null>(null);
const said = signal("");
const wrong = signal<Problem[]>([]);
const attempt = attempting(wrong);
const isLoaded = signal(false); // a loaded text may be empty
const file = signal("task.toml");
const least = signal(10); // of a search that is continued
const found = signal<(Sizing & { folder: string }) | null>(null);
const chosen = signal("");
const pinned = signal<string[]>([]);
const order = signal<{ by: string; down: boolean }>({ by: "place", down: false });

/** Whether the table shows every choice, or the best of each cylinder. */
const isWhole = signal(false);

const path = computed(() => (route.value.view === "sizing" ? route.value.path : ""));
const isFile = computed(() => isToml(path.value));

let asked = 0;

/** Unsaved texts of tasks by path, with the hash of the file that they started from. */
const drafts = new Map<string, { text: string; sha256: string }>();
addEventListener("beforeunload", (event) => void (drafts.size && event.preventDefault()));

/** Keep the typed text until it is saved or dropped. */
function type(next: string): Promise<void> {
  if (next === saved.value) drafts.delete(path.value);
  else drafts.set(path.value, { text: next, sha256: sha256.value });
  return change(next);
}

/** Replace the text of the task and check it. Only the newest answer counts. */
async function change(next: string): Promise<void> {
  text.value = next;
  const mine = ++asked;
  await attempt(async () => {
    const one = await ask<Task>("/api/task", { text: next });
    if (mine !== asked) return;
    task.value = one;
    if (!one.problems.length) meant.value = one;
  });
}

async function load(at: string): Promise<void> {
  [isLoaded.value, text.value, saved.value, sha256.value, file.value] = [false, "", "", "", at || "task.toml"]; // the name at once: it can be typed before the text is there
  if (said.value !== wasSaved(at)) said.value = "";
  task.value = meant.value = null;
  await attempt(async () => {
    const one = at
      ? await read<{ text: string; sha256: string }>("/api/file", { path: at })
      : { ...(await ask<{ text: string }>("/api/task", {})), sha256: "" };
    if (path.value !== at) return;
    const draft = drafts.get(at);
    [saved.value, sha256.value] = [one.text, draft?.sha256 ?? one.sha256];
    if (draft && draft.sha256 !== one.sha256) said.value = `${at} has changed on disk since you opened it.`;
    isLoaded.value = true;
    await change(draft?.text ?? one.text);
  });
}

/** Show the file instead of the typed text. */
function dropChanges(): void {
  drafts.delete(path.value);
  void load(path.value);
}

async function save(): Promise<void> {
  const [at, into, now] = [path.value, file.value, text.value];
  said.value = "";
  await attempt(async () => {
    try {
      const { sha256: written } = await write(into, now, sha256.value);
      const left = drafts.get(at)?.text;
      drafts.delete(at);
      if (left !== undefined && left !== now) drafts.set(into, { text: left, sha256: written }); // typed meanwhile
      if (path.value !== at) return;
      [saved.value, sha256.value, said.value] = [now, written, wasSaved(into)];
      location.hash = link("sizing", into);
      await list();
    } catch (error) {
      if (!(error instanceof Refused) || error.status !== 412) throw error;
      said.value = at
        ? `${into} changed on disk: nothing was written.`
        : `${into} already exists: nothing was written. Choose another name.`;
    }
  });
}

async function look(folder: string): Promise<void> {
  await attempt(async () => {
    const one = await read<Sizing | { waits: true }>("/api/sizing", { path: folder });
    if (path.value === folder && !("waits" in one)) found.value = { ...one, folder };
  });
}

const LOOK_MS = 500;
/** Request that continues the search of a folder as it was begun. */
const again = (folder: string, now: Sizing) => ({
  kind: "size",
  task: now.task,
  draws: now.draws,
  least: least.value,
  ...now.asked,
  name: "sizing",
  resume: folder,
});

const resume = (folder: string, now: Sizing): Promise<void> =>
  attempt(async () => (await ask("/api/jobs", again(folder, now)), void follow()));

export function SizingView() {
  const now = found.value?.folder === path.value ? found.value : null; // not that of the folder before
  const state = jobs.value.find((one) => one.out === path.value)?.state;
  useLayoutEffect(() => {
    wrong.value = [];
    void follow();
    if (path.value && !isFile.value) [found.value, chosen.value, pinned.value] = [null, "", []];
    else void load(path.value);
  }, [path.value]);
  useEffect(() => {
    const folder = path.value;
    if (!folder || isFile.value) return;
    void look(folder);
    if (state !== "running" && !now?.searched) return;
    const timer = setInterval(() => void look(folder), LOOK_MS);
    return () => clearInterval(timer);
  }, [path.value, state, now?.searched]);
  if (path.value && !isFile.value)
    return (
      <div class="sizing">
        <h2>{now?.name ?? path.value}</h2>
        <All />
        <Problems of={wrong.value} />
        {now ? (
          <Result now={now} folder={path.value} />
        ) : (
          <p>
            {state === "running"
              ? "There is no candidate yet."
              : wrong.value.length
                ? ""
                : "No search was started in this folder."}
          </p>
        )}
        <JobList of={path.value} output />
      </div>
    );
  return <TaskView />;
}

const All = () => (
  <p>
    <a href={link("sizing")}>A new task, and all sizings</a>
  </p>
);

function TaskView() {
  const place = useRef<HTMLDivElement>(null);
  const editor = useRef<Editor | null>(null);
  const now = task.value;
  useEffect(() => {
    let gone = false;
    if (place.current && isLoaded.value)
      void import("./editor").then(({ edit }) => {
        if (!gone && place.current) editor.current = edit(place.current, text.value, (next) => void type(next));
      });
    return () => {
      gone = true;
      editor.current?.end();
      editor.current = null;
    };
  }, [path.value, isLoaded.value]);
  useEffect(() => editor.current?.show(text.value, now?.problems ?? []), [text.value, now]);
  const files = studies.value?.files ?? [];
  const results = files.filter((one) => one.kind === "sizing");
  const isSaved = sha256.value !== "" && text.value === saved.value;
  return (
    <>
      <div class="drive">
        <section aria-label="Task">
          <h2>{path.value || "A new task"}</h2>
          {path.value && <All />}
          <div ref={place} class="editor" />
          <p class="row">
            <label>
              File{" "}
              <input
                value={file.value}
                disabled={sha256.value !== ""}
                onInput={(event) => (file.value = event.currentTarget.value)}
              />
            </label>
            <SaveButton isSaved={isSaved || !isLoaded.value} save={save} />
            {path.value && text.value !== saved.value && (
              <button type="button" onClick={dropChanges}>
                Drop these changes and show the file
              </button>
            )}
            <span role="status">{said.value}</span>
          </p>
          <Problems of={[...(now?.problems ?? []), ...wrong.value]} onLine={(line) => editor.current?.go(line)} />
          {now && !now.problems.length && <p class="note">No problems.</p>}
        </section>
        <section aria-label="What the task says">
          <h2>{meant.value?.name ?? "What the task says"}</h2>
          <Table
            label="Values of the task"
            heads={["Key", "Value", "Meaning"]}
            rows={(meant.value?.values ?? []).map((one) => [
              one.key,
              <span>
                {one.text} <span class="kind">{one.given ? "" : "default"}</span>
              </span>,
              one.meaning,
            ])}
          />
          <ul>
            {meant.value?.follows?.map((one) => (
              <li key={one.what}>
                {one.what}: {digits(one.value)} {one.unit}
              </li>
            ))}
          </ul>
        </section>
      </div>
      <section aria-label="Search">
        <h2>Search the catalogue</h2>
        <JobForm
          kind="size"
          given={{ task: file.value }}
          start={{ name: "sizing" }}
          isReady={isSaved && !now?.problems.length}
          after={({ out }) => void (location.hash = link("sizing", out))}>
          {!isSaved && <span class="note">Save the task first.</span>}
        </JobForm>
        <InFolder files={results} title="Sizings" view="sizing" />
      </section>
    </>
  );
}

function Result({ now, folder }: { now: Sizing; folder: string }) {
  const running = jobs.value.find((one) => one.out === folder && one.state === "running");
  const done = now.asked && now.task ? again(folder, now) : null;
  const [copy, copied] = useCopied(done, attempt);
  return (
    <>
      {(now.said[0] || now.provisional) && (
        <p class={isSevere(now.said[0] ?? "") ? "answer severe" : "answer"} data-answer>
          {now.said[0] ?? now.provisional}
        </p>
      )}
      <OpenChecks of={now.checks.filter((one) => one.is_kept !== true)} task={now.task} />
      <Best now={now} />
      {now.candidates.some((one) => one.file) && <DataSheet folder={folder} />}
      <p class="banner">Simulated drives. Values that no sheet gives are assumed; each file says which.</p>
      <p
        data-state={running || now.searched ? "running" : now.done ? "done" : "stopped"}
        data-simulated={now.candidates.length}>
        {count(now.candidates.length, "candidate")} simulated{now.said.length > 0 && `, ${now.meets} meet the task`};{" "}
        {count(now.short, "choice")} {now.short === 1 ? "is" : "are"} short of it even in the nominal case.{" "}
        {now.task ? (
          <a href={link("sizing", now.task)}>{now.task}</a>
        ) : (
          "The folder does not contain this task any more."
        )}
      </p>
      <ReportOf folder={folder} changed={now.done && !running} />
      {running && (
        <p class="row">
          <progress
            aria-label="Progress of the search"
            value={running.progress?.done ?? 0}
            max={Math.max(running.progress?.total ?? 1, 1)}
          />
          {reached(running)}
          <Cancel job={running}>Cancel the search</Cancel>
        </p>
      )}
      {!running && now.searched && (
        <p class="note">A process that this server did not start searches in this folder.</p>
      )}
      {!running && !now.searched && !now.done && (
        <p class="row">
          The search was stopped early.
          {now.task ? (
            <>
              <label>
                Smallest number of choices{" "}
                <NumberField low={1} high={100} whole value={least.value} put={(one) => (least.value = one)} />
              </label>
              <button type="button" onClick={() => void resume(folder, now)}>
                Resume
              </button>
            </>
          ) : (
            `It continues once the folder has its task again: ${folder}/sizing.json has the values.`
          )}
        </p>
      )}
      {now.miss && (
        <div class="problem" data-miss={now.miss.limit}>
          <p>
            <b>Nothing meets the task.</b> {now.miss.gives}
          </p>
        </div>
      )}
      {done && <p>{copy}</p>}
      {done && copied}
      {now.candidates.length > 0 && (
        <>
          <div class="plots">
            <Candidates now={now} way="out" />
            <Candidates now={now} way="back" />
          </div>
          <p class="note">
            Times, speeds, energies and load ratios are those that 1 % of the samples exceed; below each, the range of
            98 % of the samples. Air: the mean. Circle: meets the task. Cross: misses a limit. Small ring: the search
            ended before its last samples. Large ring: chosen or pinned.
          </p>
          <h2>Candidates</h2>
          <p class="row">
            <label>
              <input
                type="checkbox"
                checked={isWhole.value}
                onChange={(event) => (isWhole.value = event.currentTarget.checked)}
              />{" "}
              Every simulated choice, not only the best of each cylinder
            </label>
          </p>
          <Ranking now={now} />
          <Chosen now={now} />
        </>
      )}
      {now.said.length > 1 && (
        <details open>
          <summary>Reasons, savings, kept checks, and the size of the search</summary>
          <ul>
            {now.said
              .slice(1)
              .filter((one) => !isSevere(one))
              .map((one) => (
                <li key={one}>{one}</li>
              ))}
          </ul>
        </details>
      )}
    </>
  );
}

/** Checks of the best that are not kept or not decided, with their remedies: none is folded. */
function OpenChecks({ of, task }: { of: MachineCheck[]; task: string }) {
  const shown = (value: number | null, unit: string) =>
    value === null ? "not on the sheet" : `${digits(value)} ${unit}`;
  return (
    <>
      {of.map((one) => (
        <div class="problem" key={one.name} data-open-check={one.name}>
          <p>
            <b class="severe">
              {one.name}: {one.is_kept === null ? "not decided" : "NOT KEPT"}
            </b>
          </p>
          <p>
            {shown(one.value, one.unit)}, limit {shown(one.limit, one.unit)} ({one.rule}).
          </p>
          {one.remedies.length > 0 && (
            <ul>
              {one.remedies.map((remedy) => (
                <li key={remedy}>{remedy}</li>
              ))}
            </ul>
          )}
        </div>
      ))}
      {of.length > 0 && task && (
        <p>
          <a href={link("sizing", task)}>Change the task</a>
        </p>
      )}
    </>
  );
}

/** Figures of the best candidate, each with its limit. */
function Best({ now }: { now: Sizing }) {
  const best = now.candidates.find((one) => one.place === 0);
  if (!best) return null;
  const isAssumed = now.checks.some((one) => one.rule.startsWith("assumed")); // the limit of the energy
  const limits = best.limits.map((one) => ({
    key: one.name,
    title: one.name,
    text: one.value === null ? "does not end" : `${digits(one.value)} ${one.unit}`,
    note: `limit ${digits(one.limit)} ${one.unit}${isAssumed && one.name.startsWith("energy") ? ", assumed" : ""}`,
    missed: one.margin === null || one.margin < 0,
  }));
  return (
    <Tiles
      label="The best candidate"
      of={[...limits, { key: "air", title: "air of a cycle", text: `${digits(best.air)} l ANR`, note: "mean" }]}
    />
  );
}

/** Button that writes the data sheet of the best drive, and the link to it. */
function DataSheet({ folder }: { folder: string }) {
  const own = `${folder.slice(folder.lastIndexOf("/") + 1)}-sheet`;
  const job = jobs.value.find((one) => one.out === `results/${own}/report.html`);
  const start = () =>
    attempt(async () => {
      await ask("/api/jobs", { kind: "datasheet", drive: `${folder}/01.toml`, name: own });
      void follow();
    });
  return (
    <div class="row" data-sheet={job?.state ?? "none"}>
      <button type="button" disabled={job?.state === "running"} onClick={() => void start()}>
        Data sheet of the best
      </button>
      {job?.state === "running" && "The data sheet is being written."}
      <ReportOf folder={`results/${own}`} changed={job?.state} />
    </div>
  );
}

const HEIGHT = 300;
const EDGE = { left: 64, right: 12, top: 10, bottom: 40 };

function Candidates({ now, way }: { now: Sizing; way: "out" | "back" }) {
  const width = fitting(520);
  const timed = (one: Candidate) => (way === "out" ? one.time_out : one.time_back);
  const shown = now.candidates.filter((one) => timed(one) !== null && one.air !== null);
  const airs = shown.map((one) => one.air!);
  const limit = now.limits[way];
  const [low, high] = [0.95 * Math.min(...airs), 1.05 * Math.max(...airs)];
  const times = [limit, ...shown.map((one) => timed(one)!)];
  const room = 0.1 * (Math.max(...times) - Math.min(...times)) || 0.05 * limit;
  const [bottom, top] = [Math.max(0, Math.min(...times) - room), Math.max(...times) + room];
  const x = (air: number) => EDGE.left + ((air - low) / (high - low)) * (width - EDGE.left - EDGE.right);
  const y = (time: number) =>
    HEIGHT - EDGE.bottom - ((time - bottom) / (top - bottom)) * (HEIGHT - EDGE.top - EDGE.bottom);
  return (
    <figure class="plot candidates" data-plot={`Stroke ${way}`}>
      <figcaption>Stroke {way}</figcaption>
      <svg
        viewBox={`0 0 ${width} ${HEIGHT}`}
        role="img"
        aria-label={`Time of the stroke ${way} over air of a cycle; the table has the numbers`}>
        {ticks(bottom, top).map((one) => (
          <g key={one}>
            <line class="grid" x1={EDGE.left} x2={width - EDGE.right} y1={y(one)} y2={y(one)} />
            <text x={EDGE.left - 6} y={y(one) + 4} text-anchor="end">
              {digits(one, 3)}
            </text>
          </g>
        ))}
        {shown.length > 0 &&
          ticks(low, high).map((one) => (
            <text key={one} x={x(one)} y={HEIGHT - EDGE.bottom + 16} text-anchor="middle">
              {digits(one, 3)}
            </text>
          ))}
        <text x={width / 2} y={HEIGHT - 4} text-anchor="middle">
          air of a cycle, l ANR
        </text>
        <text x={12} y={HEIGHT / 2} text-anchor="middle" transform={`rotate(-90 12 ${HEIGHT / 2})`}>
          time {way}, worst 1 %, s
        </text>
        <line class="limit" x1={EDGE.left} x2={width - EDGE.right} y1={y(limit)} y2={y(limit)} />
        <text x={width - EDGE.right} y={y(limit) - 4} text-anchor="end">
          longest time allowed
        </text>
        {shown.map((one) => {
          const [cx, cy] = [x(one.air!), y(timed(one)!)];
          const isMarked = chosen.value === one.name || pinned.value.includes(one.name);
          return (
            <g
              key={one.name}
              class={one.meets ? "meets" : one.misses ? "misses" : "unfinished"}
              data-point={one.name}
              onClick={() => (chosen.value = one.name)}>
              {isMarked && <circle class="ring" cx={cx} cy={cy} r={9} />}
              {!one.misses ? (
                <circle cx={cx} cy={cy} r={one.meets ? 5 : 3} />
              ) : (
                <path d={`M${cx - 5} ${cy - 5}l10 10m0 -10l-10 10`} />
              )}
              <title>{Object.values(one.parts).join(" + ")}</title>
            </g>
          );
        })}
      </svg>
    </figure>
  );
}

const [PERCENT, FULL] = [100, 100]; // %: a load ratio above FULL does not move

/** Text of an interval. */
const range = (ends: Ends | undefined, unit = "") =>
  ends && `${ends.map((one) => (one === null ? "does not end" : digits(one, 3))).join(" … ")} ${unit}`;
const between = (ends: Ends | undefined) => ends && <small>{range(ends)}</small>;

const marked = (text: string, isMissed: boolean) => <span class={isMissed ? "missed" : ""}>{text}</span>;

type Column = [title: string, by: string, value: (one: Candidate) => number | null, limits: string[]];
const COLUMNS: Column[] = [
  ["Rank", "place", (one) => (one.place === null ? null : one.place + 1), []],
  ["Air, l ANR", "air", (one) => one.air, []],
  ["Time out, s", "time_out", (one) => one.time_out, ["time out"]],
  ["Time back, s", "time_back", (one) => one.time_back, ["time back"]],
  ["At the end, m/s", "end_speed", (one) => one.end_speed, ["end speed out", "end speed back"]],
  ["Impact, J", "energy", (one) => one.energy, ["energy out", "energy back"]],
  ["Load ratio, %", "load_ratio", (one) => (one.load_ratio === null ? null : PERCENT * one.load_ratio), []],
  ["At least, %", "at_least", (one) => 100 * one.at_least, []],
  ["Margin, %", "margin", (one) => (one.margin === null ? null : 100 * one.margin), []],
];
const MOST_ROWS = 200;

/** Best choice of each cylinder and pinned choices. All choices are shown until a ranking exists. */
function bestOfEach(every: Candidate[]): Candidate[] {
  const ranked = every.filter((one) => one.place !== null).sort((a, b) => a.place! - b.place!);
  if (!ranked.length) return [...every];
  const first = new Map<string, Candidate>();
  for (const one of ranked) if (!first.has(one.parts.cylinder!)) first.set(one.parts.cylinder!, one);
  return every.filter((one) => pinned.value.includes(one.name) || first.get(one.parts.cylinder!) === one);
}

/** Candidates in the order of a column, pinned ones first. Values that miss their limit are marked. */
function Ranking({ now }: { now: Sizing }) {
  const { by, down } = order.value;
  const value = COLUMNS.find((one) => one[1] === by)![2];
  const at = (one: Candidate) => value(one) ?? (down ? -Infinity : Infinity); // without a value: last either way
  const rows = (isWhole.value ? [...now.candidates] : bestOfEach(now.candidates)).sort((a, b) => {
    const pins = Number(pinned.value.includes(b.name)) - Number(pinned.value.includes(a.name));
    return pins || (down ? -1 : 1) * (at(a) === at(b) ? 0 : at(a) - at(b));
  });
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label="Candidates">
      <table>
        <thead>
          <tr>
            <th scope="col">Parts</th>
            {COLUMNS.map(([title, column]) => (
              <th scope="col" key={column} aria-sort={by === column ? (down ? "descending" : "ascending") : undefined}>
                <button
                  type="button"
                  class="link"
                  onClick={() => (order.value = { by: column, down: by === column && !down })}>
                  {title}
                </button>
              </th>
            ))}
            <th scope="col">What limits it</th>
            <th scope="col">Open</th>
          </tr>
        </thead>
        <tbody>
          {rows.slice(0, MOST_ROWS).map((one) => (
            <tr key={one.name} data-candidate={one.name} data-meets={one.meets}>
              <th scope="row">
                <button
                  type="button"
                  class="link"
                  aria-pressed={chosen.value === one.name}
                  onClick={() => (chosen.value = one.name)}>
                  {Object.values(one.parts).join(" + ")}
                </button>{" "}
                <button
                  type="button"
                  class="link"
                  aria-label={`${pinned.value.includes(one.name) ? "Unpin" : "Pin"} ${one.name}`}
                  onClick={() =>
                    (pinned.value = pinned.value.includes(one.name)
                      ? pinned.value.filter((other) => other !== one.name)
                      : [...pinned.value, one.name])
                  }>
                  {pinned.value.includes(one.name) ? "unpin" : "pin"}
                </button>
              </th>
              {COLUMNS.map(([, column, shown, limits]) => {
                const isOver = column === "load_ratio" && (shown(one) ?? 0) > FULL;
                const missed =
                  isOver ||
                  one.limits.some(
                    (limit) => limits.includes(limit.name) && (limit.margin === null || limit.margin < 0),
                  );
                return (
                  <td key={column} data-column={column} data-si={shown(one)} class={missed ? "missed" : ""}>
                    {digits(shown(one))} {between(one.intervals[column])}
                    {missed && " above its limit"}
                  </td>
                );
              })}
              <td class={one.misses ? "missed" : ""}>{one.binding}</td>
              <td>
                {one.file && <a href={link("drive", one.file)}>{one.file.slice(one.file.lastIndexOf("/") + 1)}</a>}
              </td>
            </tr>
          ))}
        </tbody>
      </table>
      {rows.length > MOST_ROWS && (
        <p class="note">{rows.length - MOST_ROWS} more are in the plot and in choices.jsonl.</p>
      )}
    </div>
  );
}

function Chosen({ now }: { now: Sizing }) {
  const one = now.candidates.find((each) => each.name === chosen.value);
  if (!one) return <p class="note">Choose a candidate to see its limits and its settings.</p>;
  return (
    <section aria-label="Chosen candidate">
      <h2>{Object.values(one.parts).join(" + ")}</h2>
      <p>
        {one.setting}. {one.met} of {one.draws} draws keep all limits: at least {digits(100 * one.at_least)} % (95 %
        confidence).
        {one.measure && ` Measure first: ${one.measure} (${digits(100 * one.explains, 2)} % of its margin).`}
      </p>
      <Table
        label="Limits of the candidate"
        heads={["Figure", "1 % of the samples exceed", "98 % lie between", "Limit", "Margin of 99 %"]}
        rows={[
          ...one.limits.map(({ name, value, unit, interval, limit, margin }) => ({
            cells: [
              name,
              marked(value === null ? "does not end" : `${digits(value)} ${unit}`, margin === null || margin < 0),
              range(interval, unit) ?? "–",
              `${digits(limit)} ${unit}`,
              margin === null ? "–" : `${digits(PERCENT * margin, 3)} %`,
            ],
            data: { "data-limit": name },
          })),
          ...(one.load_ratio === null
            ? []
            : [
                [
                  "load ratio",
                  marked(`${digits(PERCENT * one.load_ratio)} %`, one.load_ratio > 1),
                  range(one.intervals.load_ratio, "%"),
                  `${FULL} %`,
                  `${digits(PERCENT * (1 - one.load_ratio), 3)} %`,
                ],
              ]),
        ]}
      />
      <p class="note">
        Load ratio: weight, external force and friction at rest over the force of the supply on the piston, the worse of
        both strokes. Above 100 % the drive does not move. The simulation includes all further forces.
      </p>
      {one.file && (
        <p>
          <a href={link("drive", one.file)}>Open {one.file} in the Drive view</a>
        </p>
      )}
    </section>
  );
}
