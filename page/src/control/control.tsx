/** View of the controllers: a run with sliders for the gains, a new benchmark, and the benchmarks of the folder. */

import { effect, signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { opened } from "../drive/opened";
import { digits } from "../plots/looks";
import { curveOf, Plot, pixelsOfPlots, zooming } from "../plots/plot";
import { inCatalogue, isToml, kept, link, route } from "../routes";
import type { Frame } from "../server/frame";
import type { SentView } from "../server/generated";
import { ask, attempting, Live, type Problem, read, write } from "../server/server";
import { undoable } from "../undo";
import { list, studies } from "../workspace/files";
import { follow, JobList } from "../workspace/jobs";
import { Copied, InFolder, NumberField, Problems, SliderRow, Table, Tiles, Unsaved } from "../workspace/parts";
import { Answer, Notes } from "../workspace/result";
import { Gains, ScoreCard, Strip, type StripRow } from "./score";

interface Gain {
  key: string;
  number: number;
  unit: string;
  low: number;
  high: number;
  meaning: string;
  rule: string;
}

interface Head {
  number: number;
  problems?: Problem[];
  panels: { title: string; unit: string; size: number; curves: { column: string; label: string }[] }[];
  samples: number;
  took_s: number;
  command: string;
  python: string;
  law: string;
  drive: string;
  believes: string;
  period_s: number;
  gains: Gain[];
  plant: [string, string][];
  limits: string[];
  setup: [string, string];
  mismatch: [string, string];
  warnings: string[];
  true: { name: string; value: string }[];
  score: { name: string; title: string; text: string; value: number | null }[];
  view: SentView;
  events: { time_s: number; text: string; kind: string }[];
  assumed: number;
  lost: boolean;
}

interface Choices {
  laws: string[];
  setups: string[];
  mismatches: string[];
  spreads: string[];
  references: { name: string; text: string; usable: boolean }[];
}

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
  useEffect(() => {
    void follow();
    const live = new Live<Head>((frame) => {
      wrong.value = frame.head.problems ?? [];
      if (!frame.head.problems) {
        answer.value = frame;
        const before = new Map(tuned.peek().map((one) => [one.key, one]));
        tuned.value = frame.head.gains.map((one) => (one.key in gains.peek() && before.get(one.key)) || one);
      }
      isRunning.value = live.isRunning;
      const page = document.documentElement.dataset;
      page.sent = String(live.sent + Number(live.isWaiting)); // the test waits for the newest
      page.drawn = String(frame.head.number);
      page.mostOnTheWay = String(live.mostOnTheWay);
    });
    const end = effect(() => {
      const asked = request();
      if (!asked) return;
      isRunning.value = true;
      live.request(asked);
    });
    return () => {
      end();
      live.close();
    };
  }, []);
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
          <Choice
            label="Drive"
            value={drive.value}
            put={(one) => (void choose(one), path && (location.hash = link("control", one)))}
            of={all}
          />
          <Choice
            label="Law"
            value={law.value}
            put={(one) => ((gains.value = {}), (tuned.value = []), (law.value = one))}
            of={[...(choices.value?.laws ?? []), ...filesOf("controller")]}
          />
        </div>
        <Unsaved path={drive.value} />
        <ReferenceField />
        <div class="twin">
          <Choice
            label="Setup"
            value={setup.value}
            put={(one) => (setup.value = one)}
            of={[...(choices.value?.setups ?? []), ...filesOf("setup")]}
          />
          <Choice
            label="True drive"
            value={mismatch.value}
            put={(one) => (mismatch.value = one)}
            of={choices.value?.mismatches ?? []}
            none="as described"
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
            <input
              value={duration.value}
              placeholder="reference's"
              onChange={(event) => (duration.value = event.currentTarget.value)}
            />
          </label>
        </div>
        <Goal />
        <GainSliders />
        {!isToml(law.value) && (
          <p class="row">
            <button type="button" disabled={!answer.value} onClick={() => void saveController()}>
              Save the controller
            </button>
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

const MM = 1e-3;

/** Largest error that is allowed, mm, of the address. */
const goal = kept("goal");
const goalOf = (): number => Number(goal.value) || 0.2;

const MEASURE = "max_error_m";

/** The run against the goal in one sentence, with its leading values. */
function Met() {
  const head = answer.value?.head;
  if (!head) return null;
  const error = (head.score.find((one) => one.name === MEASURE)?.value ?? Infinity) / MM;
  const isMet = error <= goalOf() && !head.lost;
  const limit = `${digits(goalOf())} mm`;
  const title = `${head.law} keeps the error within ${digits(error)} mm; ${limit} are allowed${head.lost ? ". Lost: the error exceeded 20 mm" : ""}.`;
  const state = head.lost ? "bad" : isMet ? "good" : "open";
  const leading = head.view.leading.map((value) => {
    const own = { ...value, quantity: value.label, value: null };
    return value.key === MEASURE ? { ...own, limit, state: isMet ? ("good" as const) : ("bad" as const) } : own;
  });
  return <Answer view={{ ...head.view, title, state, leading }} />;
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
        const values = found.value === null ? [] : [{ value: found.value, title: name }];
        tried.value = { of: asked, rows: [...tried.value.rows, { name, values }] };
      }
    });
  return (
    <fieldset>
      <legend>Goal</legend>
      <p class="row">
        <NumberField
          label="Largest error allowed, mm"
          low={1e-6}
          value={goalOf()}
          put={(value) => (goal.value = String(value))}
        />
        mm largest error
        <button type="button" onClick={() => void all()}>
          Try all laws
        </button>
      </p>
      <Problems of={notTried.value} />
      {isTried && tried.value!.rows.length > 0 && (
        <Strip title="Largest error" unit="mm" size={MM} rows={tried.value!.rows} goal={goalOf() * MM} />
      )}
    </fieldset>
  );
}

function Choice(props: { label: string; value: string; put: (value: string) => void; of: string[]; none?: string }) {
  return (
    <label class="choice">
      {props.label}{" "}
      <select value={props.value} onChange={(event) => props.put(event.currentTarget.value)}>
        {props.none && <option value="">{props.none}</option>}
        {props.of.map((one) => (
          <option key={one} value={one}>
            {one}
          </option>
        ))}
      </select>
    </label>
  );
}

function ReferenceField() {
  const usual = choices.value?.references.filter((one) => one.usable) ?? [];
  return (
    <>
      <label class="choice">
        Reference <input value={reference.value} onChange={(event) => (reference.value = event.currentTarget.value)} />
      </label>
      <p class="row" role="group" aria-label="Standard references">
        {usual.map((one) => (
          <button
            type="button"
            class="link"
            key={one.name}
            title={one.text}
            aria-pressed={reference.value === one.text}
            onClick={() => (reference.value = one.text)}>
            {one.name}
          </button>
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
          <button type="button" class="link" onClick={() => (gains.value = {})}>
            Reset all gains to the values that follow from the drive
          </button>
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
      {head.true.length > 0 && (
        <Table
          heads={["Deviation of the true drive", "factor, or SI"]}
          rows={head.true.map((one) => [one.name, one.value])}
          label="Deviations"
        />
      )}
      <h2>Score</h2>
      <Tiles
        label="Score"
        of={head.score.map((one) => ({
          key: one.name,
          title: one.title,
          text: one.text,
          data: { "data-score": one.name, "data-si": one.value },
        }))}
      />
      {head.events.length > 0 && (
        <details>
          <summary>{head.events.length} events of the supervisor</summary>
          <ul>
            {head.events.map((one, index) => (
              <li key={index}>
                {digits(one.time_s)} s: {one.text || one.kind}
              </li>
            ))}
          </ul>
        </details>
      )}
      <details>
        <summary>
          Assumed drive: {head.law} for {head.believes}, every {digits(1e3 * head.period_s)} ms
        </summary>
        <p>
          Setup {head.setup[0]}. {head.setup[1]} {head.assumed} values are assumed: Drive lists those of the drive.
        </p>
        <Gains gains={head.gains.map((one) => ({ ...one, written: `${digits(one.number)} ${one.unit}` }))} />
        <Notes of={head.limits} />
        <Table heads={["Property", "Value"]} rows={head.plant} label="The drive to its law" />
      </details>
      <details>
        <summary>The same as a command and as Python</summary>
        <Copied command={head.command} python={head.python} />
      </details>
    </section>
  );
}

const laws = undoable(signal<string[]>(["pid", "nmpc"]));
const along = undoable(signal<string[]>(["R1", "R3"]));
const other = undoable(signal(""));
const spread = undoable(signal(""));
const count = undoable(signal(3));
const name = signal("laws");
const notBegun = signal<Problem[]>([]);

function Checks(props: { legend: string; of: string[]; chosen: string[]; put: (chosen: string[]) => void }) {
  return (
    <fieldset>
      <legend>{props.legend}</legend>
      <div class="row">
        {props.of.map((one) => (
          <label key={one}>
            <input
              type="checkbox"
              checked={props.chosen.includes(one)}
              onChange={(event) =>
                props.put(
                  event.currentTarget.checked ? [...props.chosen, one] : props.chosen.filter((it) => it !== one),
                )
              }
            />{" "}
            {one}
          </label>
        ))}
      </div>
    </fieldset>
  );
}

/** Start a benchmark as a job, with the chosen drive, instrumentation and deviation. */
function Compare() {
  const found = choices.value;
  if (!found) return null;
  const begin = () =>
    attempting(notBegun)(async () => {
      const references = [...along.value, ...(other.value.trim() ? [other.value] : [])];
      const asked = {
        drive: drive.value,
        laws: laws.value,
        references,
        setup: setup.value,
        count: count.value,
        name: name.value,
      };
      const { number } = await ask<{ number: number }>("/api/comparisons", {
        ...asked,
        ...(spread.value ? { spread: spread.value } : { mismatch: mismatch.value }),
      });
      await follow(number);
    });
  return (
    <section aria-label="Compare laws">
      <h2>Compare laws</h2>
      <p class="note">
        With the drive, the setup and the true drive chosen above
        {Object.keys(gains.value).length > 0 &&
          ", not with the gains changed there: the copied command writes these to a controller file, which can be compared"}
        .
      </p>
      <Checks
        legend="Laws"
        of={[...found.laws, ...filesOf("controller")]}
        chosen={laws.value}
        put={(one) => (laws.value = one)}
      />
      <Checks
        legend="Standard references"
        of={found.references.map((one) => one.name)}
        chosen={along.value}
        put={(one) => (along.value = one)}
      />
      <label class="choice">
        And along{" "}
        <input
          value={other.value}
          placeholder="a reference of your own"
          onInput={(event) => (other.value = event.currentTarget.value)}
        />
      </label>
      <Choice
        label="Spread of drives"
        value={spread.value}
        put={(one) => (spread.value = one)}
        of={found.spreads}
        none="none: seeds of noise"
      />
      <p class="row">
        <label>
          {spread.value ? "Members" : "Seeds"}{" "}
          <NumberField low={1} whole value={count.value} put={(one) => (count.value = one)} />
        </label>
        <label>
          Into results/{" "}
          <input size={12} value={name.value} onInput={(event) => (name.value = event.currentTarget.value)} />
        </label>
        <button type="button" onClick={() => void begin()}>
          Compare
        </button>
      </p>
      <Problems of={notBegun.value} />
      <JobList kinds={["control"]} />
    </section>
  );
}
