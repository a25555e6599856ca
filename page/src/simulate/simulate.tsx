/** Sliders on a running simulation. */

import { computed, effect, signal } from "@preact/signals";
import { useMemo } from "preact/hooks";
import { Circuit } from "../drive/circuit";
import { MovingCircuit, pointAt, TimeRange, timeAt } from "../drive/moving";
import {
  type Field,
  opened,
  restructure,
  said,
  set,
  problems as textProblems,
  useDrawing,
  valid,
} from "../drive/opened";
import { count, digits, instant, isSevere, sentence } from "../plots/looks";
import { type Curve, curveOf, indexAt, Plot, zooming } from "../plots/plot";
import { route } from "../routes";
import type { Frame, Numbers } from "../server/frame";
import type { RunHead as Head, RunPanel as Panel } from "../server/generated";
import { attempting, type Problem } from "../server/server";
import { undoable } from "../undo";
import { useLive } from "../workspace/answers";
import { Choose } from "../workspace/choose";
import { withFile } from "../workspace/command";
import { Button, Pick, TextInput } from "../workspace/fields";
import { studies } from "../workspace/files";
import { Leading, Problems, SliderRow, useCopied } from "../workspace/parts";
import { isOverMain } from "../workspace/tree";
import {
  BesideChoices,
  bandOf,
  besides,
  Differences,
  Energy,
  forget,
  Loops,
  motion,
  otherCurves,
  settled,
} from "./beside";
import { braked, StepsPane, stepsOf, written } from "./steps";

interface Trace {
  run: string; // what was simulated, in words
  label: string;
  time: Numbers;
  columns: Map<string, Numbers>;
}

const isNarrow = globalThis.matchMedia?.("(max-width: 60rem)").matches;
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
  if (!now || !valid.value?.kind) return null;
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
  if (!now?.kind || !path || begun === path) return;
  begun = path;
  zoom.value = null;
  answer.value = null;
  wrong.value = [];
  pinned.value = now.sliders ?? [];
  moved.value = {};
  ranges.value = {};
  frozen.value = [];
  forget();
  motion.value = now.kind === "circuit" && !isNarrow;
  initial.value = "";
  command.value =
    now.kind === "circuit"
      ? Object.entries(now.valves ?? {})
          .map(([one, lowest]) => `${one}: 0 s: 1, 1 s: ${lowest}`)
          .join("\n")
      : "0 s: 1, 1 s: -1";
});

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
  useLive<Head>(request, (frame) => {
    if (frame.head.path !== opened.value?.path) return;
    wrong.value = frame.head.problems ?? [];
    if (frame.head.problems) return;
    const [hardest] = [...(frame.head.impacts ?? [])].sort((a, b) => b.energy_j - a.energy_j);
    if (!answer.value) timeAt.value = hardest?.time_s ?? 0;
    answer.value = frame;
  });
  if (textProblems.value.length && !valid.value) return <Problems of={textProblems.value} />;
  if (!valid.value?.kind) return null;
  return (
    <div class="simulate">
      <div class="top">
        <Refusal />
        {hasPlatform.value ? <Drawn /> : <Answers />}
      </div>
      <section class="controls" aria-label="What is simulated">
        {said.value && (
          <p class="note" role="status">
            {said.value}
          </p>
        )}
        <Sliders />
        <AddSlider />
        <Run />
        <BesideChoices />
        <Actions />
        <Notes />
      </section>
      <div class="shown">
        <section class="plots" aria-label="Curves" data-samples={answer.value?.head.samples}>
          {!hasPlatform.value && <Pistons />}
          <Plots />
          <Commands />
        </section>
        <Below />
        <Beside />
      </div>
    </div>
  );
}

const drawnColumns = computed(() =>
  (answer.value?.head.panels ?? []).flatMap((panel) => panel.curves.map((one) => one.column)).join("\n"),
);

/** Buttons of the run, and the lines that are copied: they hold for these values only. */
function Actions() {
  const asked = request();
  const [copy, copied] = useCopied(
    asked && { ...asked, columns: drawnColumns.value.split("\n").filter(Boolean) },
    attempting(wrong),
    "",
    "/api/copy",
  );
  return (
    <>
      <p class="row">
        <Button act={freeze}>Freeze the curves</Button>
        {frozen.value.length > 0 && <Button act={() => (frozen.value = [])}>Remove frozen curves</Button>}
        {copy}
      </p>
      {copied}
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

/** Name and state of the run, its leading values, and findings that endanger people or the machine, with remedies. */
function Answers() {
  const head = answer.value?.head;
  const severe = head?.warnings?.filter(isSevere) ?? [];
  return (
    <div class="panel answer-card" data-state={severe.length ? "bad" : "good"}>
      <div class="row title">
        <div>
          <h2>{valid.value!.name}</h2>
          <span class={`pill ${severe.length ? "bad" : ""}`}>{severe.length ? "needs you" : "simulated"}</span>{" "}
          <span class="note">{head?.assumed ? `${count(head.assumed, "assumed value")}: Drive lists them` : ""}</span>
        </div>
        <Leading of={head?.leading ?? []} />
      </div>
      {severe.map((finding) => (
        <div class="problem severe row" role="alert" key={finding}>
          <span>{sentence(finding)}</span>
          {finding.includes("impact") && <Remedies impacts={head?.impacts ?? []} />}
        </div>
      ))}
    </div>
  );
}

/** Remedies of hard impacts: a brake in the command, and cushions in the text of the description. */
function Remedies({ impacts }: { impacts: NonNullable<Head["impacts"]> }) {
  const lines = command.value.split("\n").map(lineOf);
  const times = impacts.map((impact) => impact.time_s);
  const brake = () =>
    (command.value = lines
      .map(({ name, steps, text }) => (steps ? lineText(name, written(braked(steps, times))) : text))
      .join("\n"));
  const bare = answer.value?.head.cylinders?.map((cylinder) => cylinder.name) ?? [];
  return (
    <>
      {lines.some(({ steps }) => steps) && <Button act={brake}>Brake the command</Button>}
      {bare.length > 0 && <Button act={() => addCushions(bare)}>Add a cushion</Button>}
    </>
  );
}

/** Dimensions of a new cushion: of usual cylinders of this bore. */
const CUSHION = {
  length: "20 mm",
  plunger_diameter: "16 mm",
  needle_conductance: "0.1 dm3/(s bar)",
  port_volume: "6 cm3",
};

/** Give each cylinder cushions at both ends. Only a circuit has cushions, so a drive becomes one. */
function addCushions(cylinders: string[]): void {
  const add = () => {
    for (const name of cylinders)
      for (const end of ["a", "b"])
        for (const [key, value] of Object.entries(CUSHION)) void set(`components.${name}.cushion.${end}.${key}`, value);
  };
  if (valid.value?.kind === "circuit") {
    add();
    return;
  }
  const before = command.value;
  restructure({ act: "open" }, () => {
    command.value = lineText("valve", before);
    add();
  });
}

/** A line of the command: its valve, and its steps unless it has another form. */
function lineOf(text: string): { name: string; text: string; steps: ReturnType<typeof stepsOf> } {
  const [, name = "", rest = text] = /^\s*([A-Za-z_][\w.-]*)\s*:\s*(.*)$/.exec(text) ?? [];
  return { name, text, steps: stepsOf(rest) };
}

const lineText = (name: string, steps: string): string => (name ? `${name}: ${steps}` : steps);

const MOST_COMMANDS = 3;

/** The command of each valve under the axis of time. */
function Commands() {
  const time = answer.value?.arrays.get("time_s");
  if (!time) return null;
  const lines = command.value.split("\n").map(lineOf);
  const span = zoom.value ?? ([time[0]!, time[time.length - 1]!] as [number, number]);
  return (
    <>
      {lines
        .slice(0, MOST_COMMANDS)
        .map(
          ({ name, steps }, k) =>
            steps && (
              <StepsPane
                key={name}
                name={name ? `Command of ${name}` : "Command"}
                steps={steps}
                span={span}
                low={valid.value?.valves?.[name] ?? -1}
                put={(next) =>
                  (command.value = lines
                    .map((line, other) => (other === k ? lineText(name, written(next)) : line.text))
                    .join("\n"))
                }
              />
            ),
        )}
    </>
  );
}

/** The pistons at the time of the cursor, with position, speed and pressures. */
function Pistons() {
  const now = answer.value;
  const time = now?.arrays.get("time_s");
  if (!now || !time) return null;
  const end = time[time.length - 1]!;
  const row = indexAt(time, Math.min(timeAt.value, end));
  const at = (column: string) => (now.arrays.get(`${column}/at`) ?? now.arrays.get(column))?.[row];
  const cylinders = (now.head.cylinders ?? []).filter((one) => now.arrays.has(one.position)).slice(0, MOST_PISTONS);
  if (!cylinders.length) return null;
  return (
    <div class="pistons">
      <TimeRange
        label={`At ${instant(time[row], end / time.length)} s`}
        name="Time of the pistons"
        end={end}
        at={time[row]!}
        words={`${instant(time[row], end / time.length)} s`}
      />
      <div>
        {cylinders.map((one) => (
          <Piston
            key={one.name}
            name={cylinders.length > 1 ? one.name : ""}
            share={at(one.position)! / one.stroke_m}
            position={at(one.position)!}
            speed={at(one.position.replace("position_m", "velocity_m_s"))}
            pressures={one.pressures.map(at)}
          />
        ))}
      </div>
    </div>
  );
}

const MOST_PISTONS = 3;
const [BAR, MM] = [1e5, 1e-3];

interface PistonProps {
  name: string;
  share: number; // of the stroke
  position: number;
  speed: number | undefined;
  pressures: (number | undefined)[];
}

function Piston({ name, share, position, speed, pressures }: PistonProps) {
  const x = 4 + 380 * Math.min(Math.max(share, 0), 1);
  const words = pressures.map((value) => (value === undefined ? "" : `${digits(value / BAR)} bar`));
  const most = Math.max(...pressures.map((value) => value ?? 0), BAR);
  const tint = (k: number) => (0.6 * (pressures[k] ?? 0)) / most;
  return (
    <div class="piston" data-piston-at={position}>
      <span>
        {name} a {words[0]}
      </span>
      <svg
        viewBox="0 0 400 40"
        role="img"
        aria-label={`Piston at ${digits(position / MM)} mm, a ${words[0]}, b ${words[1]}`}>
        <rect class="air" x={4} y={8} width={Math.max(x - 4, 0)} height={24} fill-opacity={tint(0)} />
        <rect class="air" x={x + 12} y={8} width={Math.max(384 - x, 0)} height={24} fill-opacity={tint(1)} />
        <rect class="barrel" x={3} y={7} width={394} height={26} />
        <rect class="body" x={x} y={8} width={12} height={24} />
      </svg>
      <span>b {words[1]}</span>
      <b>
        {digits(position / MM)} mm{speed === undefined ? "" : `, ${digits(settled(speed))} m/s`}
      </b>
    </div>
  );
}

function Notes() {
  const head = answer.value?.head;
  const notes = head?.warnings?.filter((one) => !isSevere(one)) ?? [];
  return (
    <>
      {notes.length > 0 && (
        <details class="note" open={!isNarrow}>
          <summary>{count(notes.length, "more note")}</summary>
          <ul class="warnings">
            {notes.map((one) => (
              <li key={one}>{sentence(one)}</li>
            ))}
          </ul>
        </details>
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
        ({ title, curves, left_out: count = 0 }) =>
          count > 0 && (
            <p class="note" key={title}>
              {title}: {curves.length} of {curves.length + count} curves are drawn; the file of the command has all.
            </p>
          ),
      )}
    </>
  );
}

/** Heights of the curves, so that four panes, the command and the piston fit on one screen. */
const HEIGHTS = [92, 64, 64, 62];

function Plots() {
  const head = answer.value?.head;
  return (
    <>
      {head?.panels?.map((panel, k, all) => (
        <PanelPlot key={panel.title} panel={panel} height={HEIGHTS[k] ?? 62} isLast={k === all.length - 1} />
      ))}
    </>
  );
}

function Beside() {
  const now = answer.value;
  if (!now) return null;
  return (
    <div class="plots">
      {now.head.loops && <Loops now={now} />}
      {now.head.energy && <Energy found={now.head.energy} />}
    </div>
  );
}

const hasPlatform = computed(() => Boolean(answer.value?.head.platforms?.length));

const isAnswered = computed(() => answer.value !== null);

/** Parts of the view that come after the first curves. */
function Below() {
  if (!isAnswered.value) return null;
  return (
    <div class="below">
      {!hasPlatform.value && (
        <details
          class="panel"
          open={motion.value}
          onToggle={(event) => (motion.value = (event.currentTarget as HTMLDetailsElement).open)}>
          <summary>Circuit, as it moves</summary>
          {motion.value && <Drawn />}
        </details>
      )}
      <details open={!isOverMain() || !hasPlatform.value}>
        <summary>Values at the end</summary>
        <Differences head={answer.value!.head} panels={answer.value!.head.panels ?? []} />
      </details>
    </div>
  );
}

/** Circuit at the time of the cursor. */
function Drawn() {
  const shapes = useDrawing();
  if (!shapes) return <div />;
  if (!answer.value!.arrays.has("motion/time_s")) return <Circuit drawing={shapes} />;
  return (
    <MovingCircuit
      now={answer.value!}
      drawing={shapes}
      remedy={({ text }) => text.includes("impact") && <Remedies impacts={answer.value?.head.impacts ?? []} />}>
      {(motion) => <Circuit drawing={shapes} motion={motion} />}
    </MovingCircuit>
  );
}

function PanelPlot({ panel, height, isLast }: { panel: Panel; height: number; isLast: boolean }) {
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
      height={height}
      curves={curves}
      bands={bands}
      events={events}
      bare={!isLast}
      {...zooming(zoom)}
      cursors={[timeAt.value]}
      onHover={pointAt}
    />
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
    <Pick
      label="Slider for"
      hint="any value"
      options={free.map((one): [string, string] => [one.key, `${one.key} = ${one.text}`])}
      put={pin}
    />
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
      state={isChanged ? "changed" : field.kind}
      put={put}>
      <Button
        class="icon"
        title="Remove this slider"
        aria-label={`Remove the slider of ${field.key}`}
        act={() => {
          put(field.number!);
          pinned.value = pinned.value.filter((one) => one !== field.key);
        }}>
        ×
      </Button>
      {isChanged && (
        <span class="row">
          <Button class="link" act={() => put(field.number!)}>
            back to {field.text}
          </Button>
          <Button class="link" act={() => set(field.key, unit ? `${value} ${unit}` : value)}>
            put into the text{field.copies && `, of ${field.copies.join(", ")} together`}
          </Button>
        </span>
      )}
    </SliderRow>
  );
}

/** Menu that selects a CSV file of the folder as the command of a valve. */
function FileCommand({ valve }: { valve: string }) {
  const files = (studies.value?.files ?? []).map((one) => one.path).filter((path) => /\.csv$/i.test(path));
  if (!files.length) return null;
  return (
    <Pick
      label={`Command${valve && ` of ${valve}`} from a file (time_s, command)`}
      hint="choose"
      options={files}
      put={(path) => (command.value = withFile(command.value, valve, path))}
    />
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
      <div class="twin">
        <TextInput label="Duration" of={duration} />
        <TextInput label="Start" of={initial} hint={isCircuit ? "NAME.position = 50 mm" : "position = 50 mm"} />
      </div>
    </div>
  );
}
