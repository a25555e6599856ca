/** View of the controllers: a run with sliders for the gains, a new benchmark, and the benchmarks of the folder. */

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { opened } from "../drive/opened";
import { FigureView } from "../plots/figure";
import { digits } from "../plots/looks";
import { curveOf, Plot, pixelsOfPlots, zooming } from "../plots/plot";
import { type StripRow, stripFigure } from "../plots/points";
import { inCatalogue, isToml, link, route } from "../routes";
import type { Frame } from "../server/frame";
import type { Choices, Gain, ControlHead as Head } from "../server/generated";
import { ask, attempting, type Problem, read, write } from "../server/server";
import { undoable } from "../undo";
import { useLive } from "../workspace/answers";
import { Button } from "../workspace/fields";
import { list, studies } from "../workspace/files";
import { field, JobForm, requestOf } from "../workspace/form";
import { follow } from "../workspace/jobs";
import { Copied, InFolder, NumberField, Problems, Select, SliderRow, TextField, Unsaved } from "../workspace/parts";
import { Answer, Values } from "../workspace/result";
import { isOverMain } from "../workspace/tree";
import { GoalField, goalOf, MEASURE, MM, ScoreCard, Told } from "./score";

const drive = signal("");
const law = undoable(signal("nmpc"));
const gains = undoable(signal<Record<string, number>>({}));
const reference = undoable(signal(""));
const setup = undoable(signal("real"));
const mismatch = undoable(signal(""));
const seed = undoable(signal(1));
const duration = undoable(signal(""));
const choices = signal<Choices | null>(null);
const answer = signal<Frame<Head> | null>(null);
/** Gains that follow from the drive: the initial values of the sliders. */
const tuned = signal<Gain[]>([]);
const wrong = signal<Problem[]>([]);
const isRunning = signal(false);
const zoom = signal<[number, number] | null>(null); // the part of the time that is shown

/** Return the drives and circuits of the folder, then those of the catalogue. */
function described(): string[] {
  const files = studies.value?.files.filter((one) => one.kind === "drive" || one.kind === "circuit") ?? [];
  return [...files.map((one) => one.path), ...(studies.value?.catalogue ?? []).map((one) => one.path)];
}

const filesOf = (kind: string): string[] =>
  studies.value?.files.filter((one) => one.kind === kind).map((one) => one.path) ?? [];

function request(): Record<string, unknown> | null {
  if (!drive.value || !choices.value) return null;
  const units = new Map(tuned.peek().map((one) => [one.key, one.unit]));
  const changed = Object.entries(gains.value).map(([key, value]) => [
    key,
    units.get(key) ? `${value} ${units.get(key)}` : value,
  ]);
  return {
    what: "control",
    path: drive.value,
    law: law.value,
    gains: Object.fromEntries(changed),
    reference: reference.value,
    setup: setup.value,
    mismatch: mismatch.value,
    seed: seed.value,
    duration: duration.value,
    pixels: pixelsOfPlots(),
  };
}

async function choose(path: string): Promise<void> {
  drive.value = path;
  gains.value = {};
  choices.value = zoom.value = null;
  answer.value = null;
  await attempting(wrong)(async () => {
    const found = await read<Choices>("/api/control", { path });
    if (drive.value !== path) return;
    reference.value = found.references.find((one) => one.name === "R3")?.text ?? found.references[0]?.text ?? "";
    answer.value = null; // of the drive before, which may have been answered meanwhile
    choices.value = found;
  });
}

export function ControlView() {
  const { path } = route.value;
  return path && !isDrive(path) ? <ScoreCard path={path} /> : <Start path={path} />;
}

const isDrive = (path: string): boolean => isToml(path) || inCatalogue(path);

function Start({ path }: { path: string }) {
  const all = described();
  useEffect(() => {
    const first = path || (opened.value && all.includes(opened.value.path) ? opened.value.path : all[0]);
    if (first && (path ? path !== drive.value : !all.includes(drive.value))) void choose(first);
  }, [all.join(), path]);
  useEffect(() => void follow(), []);
  useLive<Head>(
    () => {
      const asked = request();
      if (asked) isRunning.value = true;
      return asked;
    },
    (frame, isMore) => {
      wrong.value = frame.head.problems ?? [];
      if (!frame.head.problems) {
        answer.value = frame;
        const before = new Map(tuned.peek().map((one) => [one.key, one]));
        tuned.value = frame.head.gains.map((one) => (one.key in gains.peek() && before.get(one.key)) || one);
      }
      isRunning.value = isMore;
    },
  );
  return (
    <div class="simulate control">
      <div class="top">
        <Problems of={wrong.value} />
        <Met />
      </div>
      <div class="shown">
        <Curves />
      </div>
      <section class="controls" aria-label="What is run">
        <div class="twin">
          <Select
            label="Drive"
            value={drive.value}
            put={(one) => (void choose(one), path && (location.hash = link("control", one)))}
            options={all}
          />
          <Select
            label="Law"
            value={law.value}
            put={(one) => ((gains.value = {}), (tuned.value = []), (law.value = one))}
            options={[...(choices.value?.laws ?? []), ...filesOf("controller")]}
          />
        </div>
        <Unsaved path={drive.value} />
        <ReferenceField />
        <div class="twin">
          <Select
            label="Setup"
            value={setup.value}
            put={(one) => (setup.value = one)}
            options={[...(choices.value?.setups ?? []), ...filesOf("setup")]}
          />
          <Select
            label="True drive"
            value={mismatch.value}
            put={(one) => (mismatch.value = one)}
            options={[["", "as described"], ...(choices.value?.mismatches ?? [])]}
          />
          <label class="choice">
            Seed{" "}
            <NumberField
              low={0}
              high={Number.MAX_SAFE_INTEGER}
              whole
              value={seed.value}
              put={(one) => (seed.value = one)}
            />
          </label>
          <label class="choice">
            Duration{" "}
            <TextField placeholder="reference's" value={duration.value} put={(text) => (duration.value = text)} />
          </label>
        </div>
        <Goal />
        <GainSliders />
        {!isToml(law.value) && (
          <p class="row">
            <Button disabled={!answer.value} act={() => saveController()}>
              Save the controller
            </Button>
            <a class="button" href={link("handover", drive.value)}>
              Export the drive
            </a>
            <span role="status">{savedAs.value}</span>
          </p>
        )}
        <p class="note" role="status">
          {isRunning.value ? "Running." : answer.value ? `Simulated in ${digits(answer.value.head.took_s, 2)} s.` : ""}
        </p>
      </section>
      <div class="after">
        <Details />
        <Compare />
        <InFolder
          files={studies.value?.files.filter((one) => one.kind === "comparison") ?? []}
          title="Comparisons"
          view="control"
        />
      </div>
    </div>
  );
}

/** The run against the goal in one sentence, with its leading values. */
function Met() {
  const head = answer.value?.head;
  if (!head) return null;
  const error = (head.max_error_m ?? Infinity) / MM;
  const isMet = error <= goalOf() && !head.lost;
  const limit = `${digits(goalOf())} mm`;
  const title = `${head.law} keeps the error within ${digits(error)} mm; ${limit} are allowed${head.lost ? ". Lost: the error exceeded 20 mm" : ""}.`;
  const state = head.lost ? "bad" : isMet ? "good" : "open";
  const leading = head.view.leading.map((value) => {
    const own = { ...value, quantity: value.label, value: null };
    return value.key === MEASURE ? { ...own, limit, state: isMet ? ("good" as const) : ("bad" as const) } : own;
  });
  return (
    <div data-score={MEASURE} data-si={head.max_error_m}>
      <Answer view={{ ...head.view, title, state, leading }} />
    </div>
  );
}

const savedAs = signal("");

/** Write law and gains as a controller file, which runs and comparisons offer as a law. */
const saveController = (): Promise<void> =>
  attempting(wrong)(async () => {
    const gainsText = answer.value!.head.gains.map((gain) => {
      const value = gains.value[gain.key] ?? gain.number;
      return `${gain.key} = ${gain.unit ? `"${value} ${gain.unit}"` : value}`;
    });
    const stem = drive.value.replace(/^catalogue:|\.toml$/gi, "");
    const used = new Set(filesOf("controller"));
    let [file, number] = [`${stem}-${law.value}.toml`, 1];
    while (used.has(file)) file = `${stem}-${law.value}-${++number}.toml`;
    await write(file, ["schema = 1", `law = "${law.value}"`, "", "[gains]", ...gainsText, ""].join("\n"), "");
    savedAs.value = `Saved ${file}.`;
    await list();
  });

const tried = signal<{ of: string; rows: StripRow[] } | null>(null);
const notTried = signal<Problem[]>([]);

/** The goal, and all laws against it on a logarithmic scale. */
function Goal() {
  const asked = JSON.stringify({ ...request(), law: "", gains: {}, pixels: 0 });
  const isTried = tried.value?.of === asked;
  const all = () =>
    attempting(notTried)(async () => {
      tried.value = { of: asked, rows: [] };
      for (const name of choices.value?.laws ?? []) {
        const found = await ask<{ value: number | null }>("/api/law", { ...request(), law: name, gains: {} });
        if (tried.value?.of !== asked) return;
        const values = found.value === null ? [] : [{ value: found.value / MM, of: name }];
        tried.value = { of: asked, rows: [...tried.value.rows, { name, values }] };
      }
    });
  return (
    <fieldset>
      <legend>Goal</legend>
      <p class="row">
        <GoalField />
        <Button act={() => all()}>Try all laws</Button>
      </p>
      <Problems of={notTried.value} />
      {isTried && tried.value!.rows.length > 0 && (
        <FigureView
          shown={stripFigure("Largest error of each law", "largest error, mm", tried.value!.rows, goalOf())}
        />
      )}
    </fieldset>
  );
}

function ReferenceField() {
  const usual = choices.value?.references.filter((one) => one.usable) ?? [];
  return (
    <>
      <label class="choice">
        Reference <TextField value={reference.value} put={(text) => (reference.value = text)} />
      </label>
      <p class="row" role="group" aria-label="Standard references">
        {usual.map((one) => (
          <Button
            class="link"
            key={one.name}
            title={one.text}
            aria-pressed={reference.value === one.text}
            act={() => (reference.value = one.text)}>
            {one.name}
          </Button>
        ))}
      </p>
    </>
  );
}

function GainSliders() {
  if (isToml(law.value)) return <p class="note">The gains come from the file.</p>;
  return (
    <>
      {tuned.value.map((gain) => {
        const value = gains.value[gain.key] ?? gain.number;
        const isChanged = gain.key in gains.value;
        const put = (next: number) => (gains.value = { ...gains.value, [gain.key]: next });
        const ends: [number, number] = [gain.low, gain.high];
        return (
          <SliderRow
            key={gain.key}
            id={`slider-${gain.key}`}
            label={`${gain.key}: ${gain.meaning}`}
            name={gain.key}
            title={gain.rule}
            value={value}
            shown={isChanged ? value : digits(value)}
            ends={ends}
            unit={gain.unit}
            kind={isChanged ? "changed" : ""}
            state={isChanged ? "changed" : "follows"}
            put={put}
          />
        );
      })}
      {Object.keys(gains.value).length > 0 && (
        <p>
          <Button class="link" act={() => (gains.value = {})}>
            Reset all gains to the values that follow from the drive
          </Button>
        </p>
      )}
    </>
  );
}

const HEIGHTS = [110, 92, 64, 62, 62];

/** Curves of the run. The band of the error is the goal. */
function Curves() {
  const now = answer.value;
  if (!now) return null;
  const { head, arrays } = now;
  const time = arrays.get("time_s")!;
  const ends = [time[0]!, time[time.length - 1]!];
  const allowed = goalOf() * MM;
  const band = { x: ends, low: [-allowed, -allowed], high: [allowed, allowed], look: 2 };
  return (
    <section aria-label="The run">
      {wrong.value.length > 0 && <p class="banner">Curves and numbers below belong to the last run.</p>}
      <section class="plots" aria-label="Curves" data-samples={head.samples}>
        {head.panels.map((panel, k, every) => (
          <Plot
            bare={k < every.length - 1}
            {...zooming(zoom)}
            key={panel.title}
            title={panel.title}
            unit={panel.unit}
            size={panel.size}
            height={HEIGHTS[k] ?? 62}
            bands={panel.title === "Error" ? [band] : []}
            curves={panel.curves.map((one) => curveOf(arrays, time, one.column, one.label))}
          />
        ))}
      </section>
    </section>
  );
}

/** Score, events, and the assumptions of the law on the drive. */
function Details() {
  const head = answer.value?.head;
  if (!head) return null;
  return (
    <section aria-label="Details of the run">
      {head.warnings.map((one) => (
        <p class="note" key={one}>
          {one}.
        </p>
      ))}
      <p>
        The drive {head.drive},{" "}
        {head.mismatch[0] ? `changed by ${head.mismatch[0]}. ${head.mismatch[1]}` : "as described."}
      </p>
      <details open={!isOverMain()}>
        <summary>All measures, deviations and events</summary>
        <Values view={head.view} />
      </details>
      <Told view={head.told} />
      <details>
        <summary>The same as a command and as Python</summary>
        <Copied command={head.command} python={head.python} />
      </details>
    </section>
  );
}

/** Start a benchmark as a job, with the chosen drive, instrumentation and deviation. */
function Compare() {
  const found = choices.value;
  if (!found) return null;
  const pairs = (names: string[]) => names.map((name): [string, string] => [name, name]);
  const isSpread = Boolean(requestOf("control").spread);
  const own = {
    title: "Compare",
    door: "/api/comparisons",
    fields: [
      field("laws", "Laws", "several", { choices: pairs([...found.laws, ...filesOf("controller")]) }),
      field("along", "Standard references", "several", { choices: pairs(found.references.map(({ name }) => name)) }),
      field("other", "And along", "text", { hint: "a reference of your own" }),
      field("spread", "Spread of drives", "choice", {
        choices: [["", "none: seeds of noise"], ...pairs(found.spreads)],
      }),
      field("count", isSpread ? "Members" : "Seeds", "number", { most: MOST_MEMBERS }),
      field("name", "Into results/", "name"),
    ],
    body: ({ laws, along, other, spread, count, name }: Record<string, unknown>) => ({
      ...{ drive: drive.value, setup: setup.value, laws, count, name },
      references: [...((along as string[] | undefined) ?? []), ...(String(other ?? "").trim() ? [other] : [])],
      ...(spread ? { spread } : { mismatch: mismatch.value }),
    }),
  };
  return (
    <section aria-label="Compare laws">
      <h2>Compare laws</h2>
      <p class="note">
        With the drive, the setup and the true drive chosen above
        {Object.keys(gains.value).length > 0 &&
          ", not with the gains changed there: the copied command writes these to a controller file, which can be compared"}
        .
      </p>
      <JobForm
        kind="control"
        own={own}
        start={{ laws: ["pid", "nmpc"], along: ["R1", "R3"], other: "", spread: "", count: 3, name: "laws" }}
      />
    </section>
  );
}

const MOST_MEMBERS = 10_000;
