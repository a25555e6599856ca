/** View of the controllers: a run with sliders for the gains, a new benchmark, and the benchmarks of the folder. */

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { opened } from "../drive/opened";
import { FigureView } from "../plots/figure";
import { digits, MM, withUnit } from "../plots/looks";
import { curvesOf, Plot, pixelsOfPlots, zooming } from "../plots/plot";
import { type StripRow, stripFigure } from "../plots/points";
import { inCatalogue, isToml, link, route, undoable } from "../routes";
import type { Frame } from "../server/frame";
import type { Choices, Gain, ControlHead as Head } from "../server/generated";
import { ask, attempts, isShowable, read, useLive, write } from "../server/server";
import { Button, Fold, type Option, Remarks, Select } from "../workspace/fields";
import { cataloguePaths, freeName, list, pathsOf } from "../workspace/files";
import { FormField, type Input, JobForm, requestOf } from "../workspace/jobs";
import { Files, isOverMain } from "../workspace/listed";
import { Copied, Problems, SliderRow, TextField, Unsaved } from "../workspace/parts";
import { Answer, Values } from "../workspace/result";
import { GoalField, goalOf, MEASURE, ScoreCard, Told } from "./score";

/** Request of a run, without its drive. */
const START = { law: "nmpc", gains: {} as Record<string, number>, reference: "", setup: "real", mismatch: "" };
const run = undoable(signal({ ...START, seed: 1, duration: "" }));
const change = (values: Partial<typeof run.value>): void => void (run.value = { ...run.value, ...values });

const drive = signal("");
const choices = signal<Choices | null>(null);
const answer = signal<Frame<Head> | null>(null);
/** Gains that follow from the drive: the initial values of the sliders. */
const tuned = signal<Gain[]>([]);
const [wrong, attempt] = attempts();
const isRunning = signal(false);
const zoom = signal<[number, number] | null>(null); // the part of the time that is shown

function request(): Record<string, unknown> | null {
  if (!drive.value || !choices.value) return null;
  const units = new Map(tuned.peek().map((one) => [one.key, one.unit]));
  const texts = Object.entries(run.value.gains).map(([key, value]) => [key, withUnit(value, units.get(key))]);
  const gains = Object.fromEntries(texts);
  return { ...run.value, what: "control", path: drive.value, gains, pixels: pixelsOfPlots() };
}

async function choose(path: string): Promise<void> {
  drive.value = path;
  choices.value = zoom.value = answer.value = null;
  await attempt(async () => {
    const found = await read<Choices>("/api/control", { path });
    if (drive.value !== path) return;
    const usual = found.references.find((one) => one.name === "R3") ?? found.references[0];
    change({ gains: {}, reference: usual?.text ?? "" });
    answer.value = null; // of the drive before, which may have been answered meanwhile
    choices.value = found;
  });
}

export default function ControlView() {
  const { path } = route.value;
  return path && !isDrive(path) ? <ScoreCard path={path} /> : <Start path={path} />;
}

const isDrive = (path: string): boolean => isToml(path) || inCatalogue(path);

function Start({ path }: { path: string }) {
  const all = [...pathsOf("drive", "circuit"), ...cataloguePaths()];
  useEffect(() => {
    const first = path || (opened.value && all.includes(opened.value.path) ? opened.value.path : all[0]);
    if (first && (path ? path !== drive.value : !all.includes(drive.value))) void choose(first);
  }, [all.join(), path]);
  useLive<Head>(
    () => {
      const asked = request();
      if (asked) isRunning.value = true;
      return asked;
    },
    (frame, isMore) => {
      isRunning.value = isMore;
      if (!isShowable(frame, wrong)) return;
      answer.value = frame;
      const before = new Map(tuned.peek().map((one) => [one.key, one]));
      tuned.value = frame.head.gains.map((one) => (one.key in run.peek().gains && before.get(one.key)) || one);
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
            value={run.value.law}
            put={(law) => ((tuned.value = []), change({ law, gains: {} }))}
            options={[...(choices.value?.laws ?? []), ...pathsOf("controller")]}
          />
        </div>
        <Unsaved path={drive.value} />
        <ReferenceField />
        <div class="twin">
          {inputs(choices.value).map((field) => {
            const key = field.key as keyof typeof run.value;
            return (
              <FormField key={key} field={field} value={run.value[key]} put={(value) => change({ [key]: value })} />
            );
          })}
        </div>
        <Goal />
        <GainSliders />
        {!isToml(run.value.law) && (
          <p class="row">
            <Button disabled={!answer.value} act={() => saveController()} words="Save the controller" />
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
        <Files title="Comparisons in the folder" kinds={["comparison"]} />
      </div>
    </div>
  );
}

/** Inputs of a run in addition to drive, law and reference. */
const inputs = (found: Choices | null): Input[] => [
  { key: "setup", label: "Setup", kind: "choice", choices: [...(found?.setups ?? []), ...pathsOf("setup")] },
  {
    key: "mismatch",
    label: "True drive",
    kind: "choice",
    choices: [["", "as described"], ...(found?.mismatches ?? [])],
  },
  { key: "seed", label: "Seed", kind: "number", least: 0 },
  { key: "duration", label: "Duration", kind: "text", hint: "reference's" },
];

/** The run against the goal in one sentence, with its leading values. */
function Met() {
  const head = answer.value?.head;
  if (!head) return null;
  const error = (head.max_error_m ?? Infinity) / MM;
  const isMet = error <= goalOf() && !head.lost;
  const limit = `${digits(goalOf())} mm`;
  const title = `${head.law} ${isMet ? "keeps" : "misses"} the goal: largest error ${digits(error)} mm, allowed ${limit}${head.lost ? ". Lost: the error exceeded 20 mm" : ""}.`;
  const state = isMet ? "good" : "bad";
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
  attempt(async () => {
    const { law, gains } = run.value;
    const lines = answer.value!.head.gains.map(
      ({ key, number, unit }) => `${key} = ${JSON.stringify(withUnit(gains[key] ?? number, unit))}`,
    );
    const stem = drive.value.replace(/^catalogue:|\.toml$/gi, "");
    const used = pathsOf("controller").map((one) => one.replace(/\.toml$/, ""));
    const file = `${freeName(`${stem}-${law}`, used)}.toml`;
    await write(file, ["schema = 1", `law = "${law}"`, "", "[gains]", ...lines, ""].join("\n"), "");
    savedAs.value = `Saved ${file}.`;
    await list();
  });

const tried = signal<{ of: string; rows: StripRow[] } | null>(null);
const [notTried, trying] = attempts();

/** The goal, and all laws against it on a logarithmic scale. */
function Goal() {
  const asked = JSON.stringify({ ...request(), law: "", gains: {}, pixels: 0 });
  const isTried = tried.value?.of === asked;
  const all = () =>
    trying(async () => {
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
        Reference <TextField value={run.value.reference} put={(reference) => change({ reference })} />
      </label>
      <p class="row" role="group" aria-label="Standard references">
        {usual.map((one) => (
          <Button
            class="link"
            key={one.name}
            title={one.text}
            aria-pressed={run.value.reference === one.text}
            act={() => change({ reference: one.text })}
            words={one.name}
          />
        ))}
      </p>
    </>
  );
}

function GainSliders() {
  if (isToml(run.value.law)) return <p class="note">The gains come from the file.</p>;
  const { gains } = run.value;
  return (
    <>
      {tuned.value.map((gain) => {
        const value = gains[gain.key] ?? gain.number;
        const isChanged = gain.key in gains;
        return (
          <SliderRow
            key={gain.key}
            of={gain}
            id={`slider-${gain.key}`}
            label={`${gain.key}: ${gain.meaning}`}
            title={gain.rule}
            value={value}
            shown={isChanged ? value : digits(value)}
            kind={isChanged ? "changed" : ""}
            state={isChanged ? "changed" : "follows"}
            put={(next) => change({ gains: { ...gains, [gain.key]: next } })}
          />
        );
      })}
      {Object.keys(gains).length > 0 && (
        <p>
          <Button class="link" act={() => change({ gains: {} })}>
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
            key={panel.title}
            {...panel}
            {...zooming(zoom)}
            bare={k < every.length - 1}
            height={HEIGHTS[k] ?? 62}
            bands={panel.title === "Error" ? [band] : []}
            curves={curvesOf(now, panel)}
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
      <Remarks of={head.warnings.map((one) => `${one}.`)} />
      <p>
        The drive {head.drive},{" "}
        {head.mismatch[0] ? `changed by ${head.mismatch[0]}. ${head.mismatch[1]}` : "as described."}
      </p>
      <Fold open={!isOverMain()} title="All measures, deviations and events">
        <Values view={head.view} />
      </Fold>
      <Told view={head.told} />
      <Fold title="The same as a command and as Python">
        <Copied command={head.command} python={head.python} />
      </Fold>
    </section>
  );
}

/** Start a benchmark as a job, with the chosen drive, instrumentation and deviation. */
function Compare() {
  const found = choices.value;
  if (!found) return null;
  const isSpread = Boolean(requestOf("control").spread);
  const usual = found.references.map(({ name }) => name);
  const spreads: Option[] = [["", "none: seeds of noise"], ...found.spreads];
  const own = {
    title: "Compare",
    door: "/api/comparisons",
    fields: [
      { key: "laws", label: "Laws", kind: "several", choices: [...found.laws, ...pathsOf("controller")] },
      { key: "along", label: "Standard references", kind: "several", choices: usual },
      { key: "other", label: "And along", kind: "text", hint: "a reference of your own" },
      { key: "spread", label: "Spread of drives", kind: "choice", choices: spreads },
      { key: "count", label: isSpread ? "Members" : "Seeds", kind: "number", most: MOST_MEMBERS },
      { key: "name", label: "Into results/", kind: "name" },
    ],
    body: ({ along = [], other, spread, ...others }: Record<string, unknown>) => ({
      ...others,
      drive: drive.value,
      setup: run.value.setup,
      references: [along, String(other ?? "").trim()].flat().filter(Boolean),
      ...(spread ? { spread } : { mismatch: run.value.mismatch }),
    }),
  };
  return (
    <section aria-label="Compare laws">
      <h2>Compare laws</h2>
      <p class="note">
        With the drive, the setup and the true drive chosen above
        {Object.keys(run.value.gains).length > 0 &&
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
