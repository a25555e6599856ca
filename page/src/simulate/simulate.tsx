/** Sliders on a running simulation. */

import { computed, effect, signal } from "@preact/signals";
import { useEffect, useMemo } from "preact/hooks";
import { Circuit } from "../drive/circuit";
import { MovingCircuit } from "../drive/moving";
import { type Field, opened, said, set, problems as textProblems, useDrawing, valid } from "../drive/opened";
import { count, digits, isSevere, sentence } from "../plots/looks";
import { type Curve, curveOf, Plot, zooming } from "../plots/plot";
import { route } from "../routes";
import type { Frame, Numbers } from "../server/frame";
import type { SentValue } from "../server/generated";
import { ask, Live, type Problem, Refused } from "../server/server";
import { undoable } from "../undo";
import { Choose } from "../workspace/choose";
import { withFile } from "../workspace/command";
import { studies } from "../workspace/files";
import { Copied, KINDS, Leading, Problems, SliderRow } from "../workspace/parts";
import {
  BesideChoices,
  type BesideHead,
  bandOf,
  besides,
  Differences,
  Energy,
  forget,
  Loops,
  otherCurves,
  pointAt,
  timeCursor,
} from "./beside";

interface Panel {
  title: string;
  unit: string;
  size: number;
  curves: { column: string; label: string }[];
  left_out: number; // curves
}

interface Head extends BesideHead {
  number: number;
  path: string;
  problems?: Problem[];
  panels?: Panel[];
  warnings?: string[];
  impacts?: { time_s: number; end: string; cylinder?: string; speed_m_s: number; energy_j: number }[];
  more_impacts?: number;
  leading?: SentValue[];
  events?: { time_s: number; what: string }[];
  assumed?: number;
  samples?: number;
  ends?: Record<string, number>;
}

interface Trace {
  run: string; // what was simulated, in words
  label: string;
  time: Numbers;
  columns: Map<string, Numbers>;
}

const command = undoable(signal("0 s: 1, 1 s: -1"));
const duration = undoable(signal("2 s"));
const initial = undoable(signal(""));
/** Values that have a slider. */
export const pinned = undoable(signal<string[]>([]));
export const pin = (key: string): void =>
  void (pinned.value = pinned.value.includes(key) ? pinned.value.filter((one) => one !== key) : [...pinned.value, key]);
const moved = undoable(signal<Record<string, number>>({})); // by `placeOf` a value
const ranges = signal<Record<string, [number, number]>>({});
const frozen = signal<Trace[]>([]);
const answer = signal<Frame<Head> | null>(null);
const wrong = signal<Problem[]>([]);
/** Shown time span; null: the whole run. */
const zoom = signal<[number, number] | null>(null);

const fields = computed(() => new Map((valid.value?.values ?? []).map((one) => [one.key, one])));

/**
 * The number of a slider belongs to its unit. The same number in another unit, such as absolute instead of gauge,
 * is another pressure.
 */
const placeOf = ({ key, unit = "" }: Field): string => `${key} ${unit}`;

/** Numbers of the sliders that were moved, by the keys of their values. */
const numbers = computed(() =>
  Object.fromEntries(
    [...fields.value.values()].flatMap((one) =>
      placeOf(one) in moved.value ? [[one.key, moved.value[placeOf(one)]!]] : [],
    ),
  ),
);

const changes = computed(() => {
  const out: Record<string, string | number> = {};
  for (const [key, value] of Object.entries(numbers.value)) {
    const field = fields.value.get(key);
    if (field?.number !== undefined && value !== field.number) out[key] = field.unit ? `${value} ${field.unit}` : value;
  }
  return out;
});

export function request(pixels = 1000): Record<string, unknown> | null {
  const now = opened.value;
  if (!now || !valid.value) return null;
  const lines = command.value.split("\n");
  return {
    path: now.path,
    text: now.sha256 || now.text !== now.saved ? now.text : null, // what is shown, whatever stands on disk by now
    changes: changes.value,
    command: valid.value.kind === "circuit" ? lines : command.value,
    duration: duration.value,
    initial: initial.value,
    pixels,
    ...besides(fields.value, pinned.value, numbers.value),
    ...(valid.value.kind === "circuit" && { motion: true }),
  };
}

/** Template of a new file. */
let begun = "";
effect(() => {
  const now = valid.value;
  const path = opened.value?.path;
  if (!now || !path || begun === path) return;
  begun = path;
  zoom.value = null;
  answer.value = null;
  wrong.value = [];
  pinned.value = now.sliders ?? [];
  moved.value = {};
  ranges.value = {};
  frozen.value = [];
  forget();
  initial.value = "";
  command.value =
    now.kind === "circuit"
      ? Object.entries(now.valves ?? {})
          .map(([one, lowest]) => `${one}: 0 s: 1, 1 s: ${lowest}`)
          .join("\n")
      : "0 s: 1, 1 s: -1";
});

const copied = signal<{ command: string; python: string } | null>(null);
/** The copied lines hold for these values only. */
effect(() => {
  request();
  copied.value = null;
});

async function copy(): Promise<void> {
  const asked = request();
  if (!asked) return;
  try {
    const columns = answer.peek()?.head.panels?.flatMap((panel) => panel.curves.map((one) => one.column)) ?? [];
    copied.value = await ask("/api/copy", { ...asked, columns });
  } catch (error) {
    if (error instanceof Refused) wrong.value = error.problems;
  }
}

function freeze(): void {
  const now = answer.value;
  if (!now) return;
  const changed =
    Object.entries(changes.value)
      .map(([key, value]) => `${key} ${value}`)
      .join(", ") || "as described";
  const run = `${changed}; ${command.value.trim().replace(/\s*\n\s*/g, "; ")}${initial.value && `; ${initial.value}`}`;
  const again = frozen.value.filter((one) => one.run === run).length;
  const label = again ? `${run}; ${again + 1}` : run;
  frozen.value = [...frozen.value.slice(-6), { run, label, time: now.arrays.get("time_s")!, columns: now.arrays }];
}

/** Frame of the view. It does not depend on answers, so that an answer redraws only curves and numbers. */
export function SimulateView() {
  if (route.value.path) return <Simulated />;
  return (
    <Choose
      title="Simulate"
      hint="Open a drive or a circuit to run it. Each slider changes the run while you drag it."
      view="simulate"
      kinds={["drive", "circuit"]}
      catalogue
    />
  );
}

function Simulated() {
  useEffect(() => {
    const live = new Live<Head>((frame) => {
      if (frame.head.path !== opened.value?.path) return;
      wrong.value = frame.head.problems ?? [];
      if (!frame.head.problems) answer.value = frame;
      const page = document.documentElement.dataset;
      page.sent = String(live.sent);
      page.drawn = String(frame.head.number);
      page.mostOnTheWay = String(live.mostOnTheWay);
    });
    const end = effect(() => {
      const asked = request();
      if (asked) live.request(asked);
    });
    return () => {
      end();
      live.close();
    };
  }, []);
  if (textProblems.value.length && !valid.value) return <Problems of={textProblems.value} />;
  if (!valid.value) return null;
  return (
    <div class="simulate">
      <section class="controls" aria-label="What is simulated">
        <h2>{valid.value.name}</h2>
        {said.value && (
          <p class="note" role="status">
            {said.value}
          </p>
        )}
        <Sliders />
        <AddSlider />
        <Run />
        <BesideChoices />
        <Buttons />
        <Notes />
      </section>
      <div class="shown">
        <Refusal />
        {hasPlatform.value ? <Drawn /> : <Answers />}
        <Plots />
        <Below />
        <Beside />
      </div>
    </div>
  );
}

function Buttons() {
  return (
    <>
      <p class="row">
        <button type="button" onClick={freeze}>
          Freeze the curves
        </button>
        {frozen.value.length > 0 && (
          <button type="button" onClick={() => (frozen.value = [])}>
            Remove frozen curves
          </button>
        )}
        <button type="button" onClick={() => void copy()}>
          Copy as command or Python
        </button>
      </p>
      {copied.value && <Copied {...copied.value} />}
    </>
  );
}

/** Reason why the newest values cannot be simulated. The curves shown next to it belong to earlier values. */
function Refusal() {
  if (!wrong.value.length) return null;
  return (
    <>
      <Problems of={wrong.value} />
      {answer.value && <p class="banner">Curves and numbers below belong to the last run.</p>}
    </>
  );
}

/** Leading values of the run, and findings that endanger people or the machine, above the curves. */
function Answers() {
  const head = answer.value?.head;
  if (!head?.leading) return null;
  return (
    <div class="panel answer-card">
      <Leading of={head.leading} />
      {head.warnings?.filter(isSevere).map((one) => (
        <p class="problem severe" role="alert" key={one}>
          {sentence(one)}
        </p>
      ))}
    </div>
  );
}

function Notes() {
  const head = answer.value?.head;
  const notes = head?.warnings?.filter((one) => !isSevere(one)) ?? [];
  return (
    <>
      {head?.assumed !== undefined && (
        <p class="note">
          Simulated{head.assumed > 0 && `, with ${count(head.assumed, "assumed value")}: Drive lists them`}.
        </p>
      )}
      {notes.length > 0 && (
        <ul class="warnings">
          {notes.map((one) => (
            <li key={one}>{sentence(one)}</li>
          ))}
        </ul>
      )}
      {head?.impacts && head.impacts.length > 0 && (
        <details class="note">
          <summary>{count(head.impacts.length + (head.more_impacts ?? 0), "impact")} on the end stops</summary>
          <ul>
            {head.impacts.map((one, index) => (
              <li key={index}>
                {digits(one.time_s)} s, end of chamber {one.end}
                {one.cylinder && ` of ${one.cylinder}`}: {digits(one.speed_m_s, 3)} m/s, {digits(one.energy_j, 3)} J
              </li>
            ))}
            {Boolean(head.more_impacts) && <li>More impacts: {head.more_impacts}.</li>}
          </ul>
        </details>
      )}
      {head?.panels?.map(
        ({ title, curves, left_out: count }) =>
          count > 0 && (
            <p class="note" key={title}>
              {title}: {curves.length} of {curves.length + count} curves are drawn; the file of the command has all.
            </p>
          ),
      )}
    </>
  );
}

function Plots() {
  const head = answer.value?.head;
  return (
    <section class="plots" aria-label="Curves" data-samples={head?.samples}>
      {head?.panels?.map((panel, k, all) => (
        <PanelPlot key={panel.title} panel={panel} isLast={k === all.length - 1} />
      ))}
    </section>
  );
}

function Beside() {
  const now = answer.value;
  if (!now) return null;
  return (
    <>
      <Differences head={now.head} panels={now.head.panels ?? []} ends={now.head.ends ?? {}} />
      <div class="plots">
        {now.head.loops && <Loops now={now} />}
        {now.head.energy && <Energy found={now.head.energy} />}
      </div>
    </>
  );
}

const isMoving = computed(() => answer.value?.head.cylinders !== undefined);

const hasPlatform = computed(() => Boolean(answer.value?.head.platforms?.length));

const isAnswered = computed(() => answer.value !== null);

/** Parts of the view that come after the first curves. */
function Below() {
  if (!isAnswered.value) return null;
  return (
    <div class="below">
      {!hasPlatform.value && <Drawn />}
      <Ends />
    </div>
  );
}

/** Circuit, drawn once unless its pistons move. */
function Drawn() {
  const shapes = useDrawing();
  if (!shapes) return <div />;
  if (!isMoving.value) return <Circuit drawing={shapes} />;
  return (
    <MovingCircuit now={answer.value!} drawing={shapes}>
      {(motion) => <Circuit drawing={shapes} motion={motion} />}
    </MovingCircuit>
  );
}

function PanelPlot({ panel, isLast }: { panel: Panel; isLast: boolean }) {
  const now = answer.value!;
  const time = now.arrays.get("time_s")!;
  const curves: Curve[] = panel.curves.map((one) => curveOf(now.arrays, time, one.column, one.label));
  for (const one of panel.curves) curves.push(...otherCurves(now, one.column, one.label));
  for (const trace of frozen.value)
    for (const one of panel.curves)
      if (trace.columns.has(one.column))
        curves.push(curveOf(trace.columns, trace.time, one.column, `${one.label} (${trace.label})`));
  const bands = panel.curves.flatMap((one, index) => {
    const band = bandOf(now, one.column);
    return band ? [{ ...band, look: index }] : [];
  });
  const events = useMemo(() => now.head.events?.map((one) => ({ at: one.time_s, what: one.what })), [now]);
  return (
    <Plot
      title={panel.title}
      unit={panel.unit}
      size={panel.size}
      curves={curves}
      bands={bands}
      events={events}
      bare={!isLast}
      {...zooming(zoom)}
      cursors={timeCursor.value}
      onHover={pointAt}
    />
  );
}

const REST = 1e-4; // of a unit: rounding of the solver
const settled = (value: number): number => (Math.abs(value) < REST ? 0 : value);

/** Last value of each curve as a number, for screen readers and tests. */
function Ends() {
  const head = answer.value?.head;
  if (!head?.ends) return null;
  return (
    <section class="ends">
      <h2>At the end</h2>
      <table>
        <tbody>
          {head.panels?.flatMap((panel) =>
            panel.curves.map((one) => (
              <tr key={one.column}>
                <th scope="row">{one.label}</th>
                <td data-end={one.column} data-si={head.ends![one.column]}>
                  {digits(settled((head.ends![one.column] ?? Number.NaN) / panel.size))} {panel.unit}
                </td>
              </tr>
            )),
          )}
        </tbody>
      </table>
    </section>
  );
}

export function Sliders() {
  return (
    <>
      {pinned.value.map((key) => {
        const field = fields.value.get(key);
        return field?.number === undefined ? null : <Slider key={key} field={field} />;
      })}
    </>
  );
}

function AddSlider() {
  const free = [...fields.value.values()].filter((one) => one.number !== undefined && !pinned.value.includes(one.key));
  return (
    <p>
      <label>
        Slider for{" "}
        <select
          value=""
          onChange={(event) => {
            if (event.currentTarget.value) pinned.value = [...pinned.value, event.currentTarget.value];
            event.currentTarget.value = "";
          }}>
          <option value="">any value</option>
          {free.map((one) => (
            <option key={one.key} value={one.key}>
              {one.key} = {one.text}
            </option>
          ))}
        </select>
      </label>
    </p>
  );
}

function Slider({ field }: { field: Field }) {
  const [low, high] = ranges.value[field.key] ?? [field.low!, field.high!];
  const value = numbers.value[field.key] ?? field.number!;
  const isChanged = value !== field.number;
  const put = (next: number) => (moved.value = { ...moved.value, [placeOf(field)]: next });
  const unit = field.unit ?? "";
  const kind = isChanged ? "changed" : field.kind;
  return (
    <SliderRow
      id={`slider-${field.key}`}
      label={field.key.replace(/^components\./, "")}
      name={field.key}
      title={field.origin}
      value={value}
      ends={[low, high]}
      unit={unit}
      kind={kind}
      state={isChanged ? "changed" : KINDS[field.kind]!}
      put={put}>
      <button
        type="button"
        class="icon"
        title="Remove this slider"
        aria-label={`Remove the slider of ${field.key}`}
        onClick={() => {
          put(field.number!);
          pinned.value = pinned.value.filter((one) => one !== field.key);
        }}>
        ×
      </button>
      {isChanged && (
        <span class="row">
          <button type="button" class="link" onClick={() => put(field.number!)}>
            back to {field.text}
          </button>
          <button type="button" class="link" onClick={() => void set(field.key, unit ? `${value} ${unit}` : value)}>
            put into the text{field.copies && `, of ${field.copies.join(", ")} together`}
          </button>
        </span>
      )}
    </SliderRow>
  );
}

/** Menu that selects a CSV file of the folder as the command of a valve. */
function FileCommand({ valve }: { valve: string }) {
  const files = (studies.value?.files ?? []).filter((one) => /\.csv$/i.test(one.path));
  if (!files.length) return null;
  return (
    <label>
      Command{valve && ` of ${valve}`} from a file (time_s, command){" "}
      <select
        value=""
        onChange={(event) => {
          if (event.currentTarget.value) command.value = withFile(command.value, valve, event.currentTarget.value);
          event.currentTarget.value = "";
        }}>
        <option value="">choose</option>
        {files.map((one) => (
          <option key={one.path}>{one.path}</option>
        ))}
      </select>
    </label>
  );
}

function Run() {
  const isCircuit = valid.value?.kind === "circuit";
  const valves = valid.value?.valves ?? {};
  const oneWay = Object.keys(valves).filter((one) => valves[one] === 0);
  return (
    <div class="run">
      <label for="command">
        Command, -1 to 1{isCircuit ? ", a line for each valve" : ""}
        {oneWay.length > 0 && `; 0 to 1 for ${oneWay.join(", ")}`}
        {isCircuit ? (
          <textarea
            id="command"
            rows={3}
            value={command.value}
            onInput={(event) => (command.value = event.currentTarget.value)}
          />
        ) : (
          <input id="command" value={command.value} onInput={(event) => (command.value = event.currentTarget.value)} />
        )}
      </label>
      {isCircuit ? (
        <details>
          <summary>Commands from files</summary>
          {Object.keys(valves).map((valve) => (
            <FileCommand key={valve} valve={valve} />
          ))}
        </details>
      ) : (
        <FileCommand valve="" />
      )}
      <label>
        Duration
        <input value={duration.value} onInput={(event) => (duration.value = event.currentTarget.value)} />
      </label>
      <label>
        Start
        <input
          value={initial.value}
          placeholder={isCircuit ? "NAME.position = 50 mm" : "position = 50 mm"}
          onInput={(event) => (initial.value = event.currentTarget.value)}
        />
      </label>
    </div>
  );
}
