/** View of sizing: text and check of the task, the search as a job, and its answer with the candidates against their limits. */

import { computed, signal } from "@preact/signals";
import { useEffect, useLayoutEffect } from "preact/hooks";
import { FigureView } from "../plots/figure";
import { count, digits } from "../plots/looks";
import { isToml, link, route, undoable } from "../routes";
import type { Candidate, Field, Finding, Job, Limit, Sizing } from "../server/generated";
import { ask, attempts, LOOK_MS, read, useWatched } from "../server/server";
import { Button, Fold, Select, Table, toggled } from "../workspace/fields";
import { changesOf } from "../workspace/files";
import { follow, JobForm, JobList, jobs, Progress } from "../workspace/jobs";
import { Files } from "../workspace/listed";
import { Problems, ReportOf, useCopied } from "../workspace/parts";
import { Answer, Notes } from "../workspace/result";
import { open, opened, problems, set, valid } from "./opened";
import { useOpenText } from "./text";

const [wrong, attempt] = attempts();
const name = signal("task.toml"); // of a new task
const pinned = undoable(signal<string[]>([]));
const orderBy = undoable(signal("Rank"));

const path = computed(() => (route.value.view === "sizing" ? route.value.path : ""));
const isFile = computed(() => isToml(path.value));

/** Request that continues the search of a folder as it was begun. */
const again = (folder: string, { task, draws, asked }: Sizing) => {
  return { kind: "size", task, draws, ...asked, name: "sizing", resume: folder };
};

const resume = (folder: string, now: Sizing): Promise<void> =>
  attempt(async () => (await ask("/api/jobs", again(folder, now)), void follow()));

export default function SizingView() {
  const folder = isFile.value ? "" : path.value;
  const state = jobs.value.find((one) => one.out === folder)?.state;
  const [answer, problems] = useWatched(
    folder,
    () => read<Sizing & { waits?: true }>("/api/sizing", { path: folder }),
    (last) => (state === "running" || last?.searched ? LOOK_MS : 0), // by any process
    [state],
  );
  const now = answer?.waits ? null : answer;
  useLayoutEffect(() => void ([wrong.value, pinned.value] = [[], []]), [path.value]);
  useEffect(() => {
    if (!folder) void open(path.value, true);
  }, [path.value, changesOf(path.value)]);
  if (!path.value || isFile.value) return <TaskView />;
  return (
    <div class="sizing">
      {now ? <Result now={now} folder={path.value} /> : <h2>{path.value}</h2>}
      <Problems of={[...problems, ...wrong.value]} />
      {!now && !problems.length && (
        <p>{state === "running" ? "There is no candidate yet." : "No search was started in this folder."}</p>
      )}
      <JobList of={path.value} output />
      <All />
    </div>
  );
}

const All = () => (
  <p>
    <a href={link("sizing")}>A new task, and all sizings</a>
  </p>
);

function TaskView() {
  const now = opened.value?.isTask && opened.value.path === path.value ? opened.value : null;
  const task = now && valid.value;
  const [editor, state] = useOpenText(path.value, name);
  const [given, others] = ["given", "default"].map((kind) => task?.values?.filter((one) => one.kind === kind) ?? []);
  const isSaved = now?.sha256 && now.text === now.saved;
  return (
    <>
      <div class="drive">
        <section aria-label="Task">
          <h2>{path.value || "A new task"}</h2>
          {path.value && <All />}
          {editor}
          {state}
        </section>
        <section aria-label="What the task says">
          <h2>{task?.name ?? "What the task says"}</h2>
          <TaskValues label="Values of the task" of={given!} />
          <Fold title={count(others!.length, "default")}>
            <TaskValues label="Defaults of the task" of={others!} />
          </Fold>
          <ul>
            {task?.follows?.map((one) => (
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
          given={{ task: path.value || name.value }}
          start={{ name: "sizing" }}
          isReady={Boolean(isSaved && !problems.value.length)}
          after={({ out }) => void (location.hash = link("sizing", out))}>
          {!isSaved && <span class="note">Save the task first.</span>}
        </JobForm>
        <Files title="Sizings in the folder" kinds={["sizing"]} />
      </section>
    </>
  );
}

const TaskValues = ({ label, of }: { label: string; of: Field[] }) => (
  <Table label={label} heads={["Key", "Value", "Meaning"]} rows={of.map((one) => [one.key, one.text, one.origin])} />
);

function Result({ now, folder }: { now: Sizing; folder: string }) {
  const running = jobs.value.find((one) => one.out === folder && one.state === "running");
  const isDone = now.done && !running;
  const [copy, copied] = useCopied(now.asked && now.task ? again(folder, now) : null, attempt);
  const kept = now.view?.findings.filter((one) => one.state === "good") ?? [];
  const findings = now.view?.findings.filter((one) => one.state !== "good") ?? [];
  const state = running || now.searched ? "running" : now.done ? "done" : "stopped";
  return (
    <>
      <div class="row title">
        <div>
          <h2>{now.name}</h2>
          <p class="lead" data-state={state} data-simulated={now.candidates.length}>
            {now.words}. {count(now.candidates.length, "candidate")} simulated.{" "}
            {now.task ? (
              <a href={link("sizing", now.task)}>Change the task</a>
            ) : (
              "The folder does not contain this task any more."
            )}
          </p>
        </div>
        <ReportOf folder={folder} changed={isDone} />
        <ReportOf folder={`${folder}/sheet`} changed={isDone} word="sheet" />
      </div>
      {now.view ? (
        <Answer
          view={{ ...now.view, title: withoutFigures(now.view.title), findings }}
          remedy={(finding) => now.task && <Remedies of={finding} task={now.task} />}
        />
      ) : (
        <p class="answer">{now.provisional}</p>
      )}
      <Search now={now} folder={folder} running={running} />
      {now.candidates.length > 0 && (
        <div class="result">
          <div class="panel" data-hero="ranges">
            <Ranges now={now} />
          </div>
          {now.sheet && (
            <aside>
              <div class="panel" data-order>
                <h3>What to order</h3>
                {now.sheet.figures.map((one) => (
                  <FigureView key={one.name} shown={one} />
                ))}
                <ul>
                  {now.sheet.tables[0]!.rows.map(([number, slot, type]) => (
                    <li key={type} class={slot === "missing" ? "missed" : ""}>
                      <b>{type}</b> ({slot}, {number})
                    </li>
                  ))}
                </ul>
              </div>
            </aside>
          )}
        </div>
      )}
      {now.candidates.length > 0 && <Choices now={now} />}
      {now.view && (
        <Fold class="panel" title="Reasons, savings, kept checks, and the size of the search">
          <Notes of={[...kept.map((one) => one.text), ...now.view.notes]} />
        </Fold>
      )}
      <div class="row">
        {now.sheet && <DataSheet folder={folder} />}
        {copy}
      </div>
      {copied}
      <p class="note">Simulated drives. Values that no sheet gives are assumed; each file says which.</p>
    </>
  );
}

/** The answer of a sizing without the figures, which stand below it. */
const withoutFigures = (title: string): string => title.replace(/: [\d.]+ s of .*?(; limited by|$)/, "$1");

/** Progress of a search, and its continuation. */
function Search({ now, folder, running }: { now: Sizing; folder: string; running: Job | undefined }) {
  if (running) return <Progress job={running} name="the search" />;
  if (now.searched) return <p class="note">A process that this server did not start searches in this folder.</p>;
  if (now.done) return null;
  const noTask = `It continues once the folder has its task again: ${folder}/sizing.json has the values.`;
  return (
    <p class="row">
      The search was stopped early. {now.task ? <Button act={() => resume(folder, now)}>Resume</Button> : noTask}
    </p>
  );
}

/** Remedies of an open check as buttons: each sets its keys in the text of the task, which is shown unsaved. */
function Remedies({ of, task }: { of: Finding; task: string }) {
  const remedies = of.remedy.replace(/^Remedy: /, "").split("; or ");
  return (
    <span class="row">
      {remedies.map((remedy) => {
        const pairs = [...remedy.matchAll(/(\w+) = ("[^"]*")/g)].map(([, key, value]) => [key!, value!.slice(1, -1)]);
        const [words] = remedy.split(/: | = |, /);
        if (!pairs.length) return null;
        return (
          <Button key={remedy} title={remedy} act={() => amend(task, pairs)}>
            {remedy.includes(": ") ? `Add ${words}` : `Set ${pairs.map((pair) => pair.join(" = ")).join(", ")}`}
          </Button>
        );
      })}
    </span>
  );
}

/** Set keys in the text of a task, and show it. */
async function amend(task: string, pairs: string[][]): Promise<void> {
  await open(task, true);
  for (const [key, value] of pairs) await set(key!, value!);
  location.hash = link("sizing", task);
}

/** Button that writes the data sheet of the best drive, and the link to it. */
function DataSheet({ folder }: { folder: string }) {
  const own = `${folder.slice(folder.lastIndexOf("/") + 1)}-sheet`;
  const job = jobs.value.find((one) => one.out === `results/${own}/report.html`);
  const asked = { kind: "datasheet", drive: `${folder}/01.toml`, name: own };
  const start = () => attempt(async () => (await ask("/api/jobs", asked), void follow()));
  return (
    <div class="row" data-sheet={job?.state ?? "none"}>
      <Button disabled={job?.state === "running"} act={() => start()}>
        {job?.state === "running" ? "The data sheet is being written" : "Data sheet of the best"}
      </Button>
      <ReportOf folder={`results/${own}`} changed={job?.state} word="data sheet" />
    </div>
  );
}

const MOST_COLUMNS = matchMedia("(max-width: 40rem)").matches ? 2 : 4;
const PERCENT = 100;

/** Pinned candidates, then the best of each cylinder. */
function columnsOf(every: Candidate[]): Candidate[] {
  const first = every.filter((one, k) => every.findIndex((other) => other.cylinder === one.cylinder) === k);
  const isPinned = (one: Candidate) => pinned.value.includes(one.name);
  const most = Math.max(MOST_COLUMNS, pinned.value.length);
  return [...every.filter(isPinned), ...first.filter((one) => !isPinned(one))].slice(0, most);
}

/** Candidates side by side: the range of each value against its limit. */
function Ranges({ now }: { now: Sizing }) {
  const shown = columnsOf(now.candidates);
  const names = [...new Set(shown.flatMap((one) => one.limits.map((limit) => limit.name)))];
  const limits = names.map((name) => {
    const cells = shown.map((one) => one.limits.find((limit) => limit.name === name));
    const most = 1.1 * Math.max(...cells.flatMap((one) => [one?.limit ?? 0, one?.value ?? 0]), 1e-9);
    const [limit] = [...new Set(cells.map((one) => one?.limit))];
    const isCommon = typeof limit === "number" && cells.every((one) => one?.limit === limit);
    const title = (
      <>
        {name}
        {isCommon && <small>{`limit ${digits(limit)} ${cells[0]!.unit}`}</small>}
      </>
    );
    const bars = cells.map((one) => (one ? <Range of={one} most={most} isCommon={isCommon} /> : "–"));
    return { cells: [title, ...bars], data: { "data-limit": name } };
  });
  const margins = shown.map((one) => (
    <>
      {one.margin === null ? "–" : `${digits(PERCENT * one.margin)} %`} <small>{one.binding}</small>
    </>
  ));
  const kept = shown.map((one) => (
    <>
      {one.met} of {one.draws} <small>at least {digits(PERCENT * one.at_least)} %</small>
    </>
  ));
  const heads = shown.map((one) => ({
    text: one.file ? <a href={link("drive", one.file)}>{one.title}</a> : one.title,
    data: { "data-column-of": one.name, title: one.parts },
  }));
  return (
    <>
      <Table
        class="ranges"
        frame="wide"
        label="Candidates against their limits"
        heads={["", ...heads]}
        rows={[...limits, ["margin", ...margins], ["samples that keep all limits", ...kept]]}
      />
      <p class="note">
        Band: 98 % of the samples. Thick mark: the value that 1 % of them exceed; for air, the mean. Dashed: the limit.
      </p>
    </>
  );
}

/** The range of a value as a bar, with the value, its mark and its limit. */
function Range({ of, most, isCommon }: { of: Limit; most: number; isCommon: boolean }) {
  const { value, limit, unit, margin, interval } = of;
  const at = (one: number | null) => `${(PERCENT * Math.min(Math.max(one ?? most, 0), most)) / most}%`;
  const [low, high] = interval ?? [value, value];
  const isMissed = limit !== null && (margin === null || margin < 0);
  const end = limit === null ? "-9in" : at(limit);
  const places = { "--low": at(low), "--high": at(high), "--mark": at(value), "--limit": end };
  return (
    <span class={isMissed ? "range missed" : "range"}>
      <i style={places} />
      <b>{value === null ? "does not end" : `${digits(value)} ${unit}`}</b>
      {limit !== null && !isCommon && <small>limit {digits(limit)}</small>}
      {isMissed && <small>above its limit</small>}
    </span>
  );
}

const COLUMNS: [title: string, column: string, value: (one: Candidate) => number | null][] = [
  ["Rank", "place", (one) => (one.place === null ? null : one.place + 1)],
  ["Air, l ANR", "air", (one) => one.air],
  ["Time out, s", "time_out", (one) => one.time_out],
  ["Time back, s", "time_back", (one) => one.time_back],
  ["Impact, J", "energy", (one) => one.energy],
  ["Load ratio, %", "load_ratio", (one) => (one.load_ratio === null ? null : PERCENT * one.load_ratio)],
  ["Margin, %", "margin", (one) => (one.margin === null ? null : PERCENT * one.margin)],
];
const MOST_ROWS = 200;

/** Every simulated choice, in the order of a column. A pinned choice is a column of the ranges. */
function Choices({ now: { candidates: every, view } }: { now: Sizing }) {
  const [, , value] = COLUMNS.find(([title]) => title === orderBy.value)!;
  const rows = [...every].sort((a, b) => (value(a) ?? Infinity) - (value(b) ?? Infinity));
  return (
    <Fold class="panel" title={`Every simulated choice: ${every.length}`}>
      {view?.figures.map((one) => (
        <FigureView key={one.name} shown={one} />
      ))}
      <div class="row">
        <Select label="Order by" of={orderBy} options={COLUMNS.map(([title]) => title)} />
      </div>
      <Table
        label="Every simulated choice"
        heads={["Parts", ...COLUMNS.map(([title]) => title), "What limits it", "Settings"]}
        rows={rows.slice(0, MOST_ROWS).map((one) => {
          const isPinned = pinned.value.includes(one.name);
          return {
            data: { "data-candidate": one.name, "data-meets": one.place !== null },
            cells: [
              <>
                {one.parts}{" "}
                <Button
                  class="link"
                  aria-label={`${isPinned ? "Unpin" : "Pin"} ${one.name}`}
                  act={() => (pinned.value = toggled(pinned.value, one.name))}
                  words={isPinned ? "unpin" : "pin"}
                />
              </>,
              ...COLUMNS.map(([, column, shown]) => {
                return { text: digits(shown(one)), data: { "data-column": column, "data-si": shown(one) } };
              }),
              <span class={one.misses ? "missed" : ""}>{one.binding}</span>,
              one.setting,
            ],
          };
        })}
      />
      {rows.length > MOST_ROWS && <p class="note">{rows.length - MOST_ROWS} more are in choices.jsonl.</p>}
    </Fold>
  );
}
