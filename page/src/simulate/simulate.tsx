/** Sliders on a running simulation. */

import { computed, effect, signal } from "@preact/signals";
import { Circuit, type Moved, MovingCircuit, moveTo, pistonsAt, pointAt, timeAt } from "../drive/circuit";
import { opened, restructure, said, set, problems as textProblems, useDrawing, valid } from "../drive/opened";
import { changed, count, digits, instant, isSevere, MM, sentence, withUnit } from "../plots/looks";
import { type Curve, curvesOf, indexAt, Plot, zooming } from "../plots/plot";
import { undoable } from "../routes";
import type { Frame, Numbers } from "../server/frame";
import type { Field, RunHead as Head } from "../server/generated";
import { attempts, isShowable, useLive } from "../server/server";
import { withFile } from "../workspace/command";
import { Button, Fold, Range, Remarks, Select, TextInput, toggled } from "../workspace/fields";
import { studies } from "../workspace/files";
import { isOverMain } from "../workspace/listed";
import { Leading, Problems, SliderRow, useCopied } from "../workspace/parts";
import { Notes, Values } from "../workspace/result";
import * as beside from "./beside";
import { braked, type Step, StepsPane, stepsOf, written } from "./steps";

const command = undoable(signal("0 s: 1, 1 s: -1"));
const duration = undoable(signal("2 s"));
const initial = undoable(signal(""));
/** Values that have a slider. */
export const pinned = undoable(signal<string[]>([]));
export const pin = (key: string): void => void (pinned.value = toggled(pinned.value, key));
const moved = undoable(signal<Record<string, number>>({})); // by `placeOf` a value
/** Frozen curves, with a description of their run. */
const frozen = signal<(Pick<Frame<Head>, "arrays"> & { label: string })[]>([]);
const answer = signal<Frame<Head> | null>(null);
const [wrong, attempt] = attempts();
/** Shown time span; null: the whole run. */
const zoom = signal<[number, number] | null>(null);

const fields = computed(() => new Map((valid.value?.values ?? []).map((one) => [one.key, one])));

/**
 * The number of a slider belongs to its unit. The same number in another unit, such as absolute instead of gauge,
 * is another pressure.
 */
const placeOf = ({ key, unit = "" }: Field): string => `${key} ${unit}`;

/** Numbers of the sliders that were moved, by the keys of their values. */
const numbers = computed(() => {
  const own = [...fields.value.values()].filter((one) => placeOf(one) in moved.value);
  return Object.fromEntries(own.map((one) => [one.key, moved.value[placeOf(one)]!]));
});

const changes = computed(() => changed(fields.value.values(), numbers.value));

export function request(pixels = 1000): Record<string, unknown> | null {
  const now = opened.value;
  if (!now || !valid.value?.kind) return null;
  const isCircuit = valid.value.kind === "circuit";
  return {
    path: now.path,
    text: now.sha256 || now.text !== now.saved ? now.text : null, // what is shown, whatever stands on disk by now
    changes: changes.value,
    duration: duration.value,
    initial: initial.value,
    pixels,
    command: isCircuit ? command.value.split("\n") : command.value,
    ...beside.besides(fields.value, pinned.value, numbers.value),
    ...(isCircuit && { motion: true }),
  };
}

/** Template of a new file. */
let begun = "";
effect(() => {
  const now = valid.value;
  const path = opened.value?.path;
  if (!now?.kind || !path || begun === path) return;
  begun = path;
  [zoom.value, answer.value, wrong.value] = [null, null, []];
  [pinned.value, moved.value, frozen.value] = [now.sliders ?? [], {}, []];
  beside.forget();
  beside.motion.value = now.kind === "circuit" && !beside.isNarrow;
  initial.value = "";
  const lines = Object.entries(now.valves ?? {}).map(([valve, lowest]) => `${valve}: 0 s: 1, 1 s: ${lowest}`);
  command.value = now.kind === "circuit" ? lines.join("\n") : "0 s: 1, 1 s: -1";
});

function freeze(): void {
  const now = answer.value;
  if (!now) return;
  const changed = Object.entries(changes.value).map(([key, value]) => `${key} ${value}`);
  const run = `${changed.join(", ") || "as described"}; ${command.value.trim().replace(/\s*\n\s*/g, "; ")}${initial.value && `; ${initial.value}`}`;
  const again = frozen.value.filter((one) => one.label.startsWith(run)).length;
  const label = again ? `${run}; ${again + 1}` : run;
  frozen.value = [...frozen.value.slice(-6), { label, arrays: now.arrays }];
}

/** Frame of the view. It does not depend on answers, so that an answer redraws only curves and numbers. */
export default function SimulateView() {
  useLive<Head>(request, (frame) => {
    if (frame.head.path !== opened.value?.path) return;
    if (!isShowable(frame, wrong)) return;
    const [hardest] = [...(frame.head.impacts ?? [])].sort((a, b) => b.energy_j - a.energy_j);
    if (!answer.value) timeAt.value = hardest?.time_s ?? 0;
    answer.value = frame;
  });
  if (textProblems.value.length && !valid.value) return <Problems of={textProblems.value} />;
  if (!valid.value?.kind) return null;
  return (
    <div class="simulate">
      <div class="top">
        {wrong.value.length > 0 && <Problems of={wrong.value} />}
        {wrong.value.length > 0 && answer.value && (
          <p class="banner">Curves and numbers below belong to the last run.</p>
        )}
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
        <beside.BesideChoices />
        <Actions />
        <Remarked />
      </section>
      <div class="shown">
        <Curves />
        <Below />
      </div>
    </div>
  );
}

/** Buttons of the run, and the lines that are copied: they hold for these values only. */
function Actions() {
  const asked = request();
  const columns = (answer.value?.head.panels ?? []).flatMap((panel) => panel.curves.map((one) => one.column));
  const [copy, copied] = useCopied(asked && { ...asked, columns }, attempt, "", "/api/copy");
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
  const times = impacts.map((impact) => impact.time_s);
  const brake = () => putSteps((steps) => braked(steps, times));
  const bare = answer.value?.head.cylinders?.map((cylinder) => cylinder.name) ?? [];
  return (
    <>
      {commandLines().some(({ steps }) => steps) && <Button act={brake}>Brake the command</Button>}
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
  const before = command.value;
  if (valid.value?.kind === "circuit") add();
  else restructure({ act: "open" }, () => ((command.value = lineText("valve", before)), add()));
}

/** A line of the command: its valve, and its steps unless it has another form. */
function lineOf(text: string): { name: string; text: string; steps: ReturnType<typeof stepsOf> } {
  const [, name = "", rest = text] = /^\s*([A-Za-z_][\w.-]*)\s*:\s*(.*)$/.exec(text) ?? [];
  return { name, text, steps: stepsOf(rest) };
}

const lineText = (name: string, steps: string): string => (name ? `${name}: ${steps}` : steps);

const commandLines = () => command.value.split("\n").map(lineOf);

/** Write the command with other steps. A line of another form stays. */
function putSteps(next: (steps: Step[], line: number) => Step[]): void {
  const texts = commandLines().map(({ name, text, steps }, k) => {
    const changed = steps && next(steps, k);
    return changed && changed !== steps ? lineText(name, written(changed)) : text;
  });
  command.value = texts.join("\n");
}

const MOST_COMMANDS = 3;

/** Heights of the curves, so that four panes, the command and the piston fit on one screen. */
const HEIGHTS = [92, 64, 64, 62];

/** The pistons, the curves, and the command of each valve, on one axis of time. */
function Curves() {
  const now = answer.value;
  const time = now?.arrays.get("time_s");
  if (!now || !time) return <section class="plots" aria-label="Curves" />;
  const { panels = [], samples } = now.head;
  const events = now.head.events?.map((one) => one.time_s);
  const panes = commandLines().slice(0, MOST_COMMANDS);
  const span = zoom.value ?? ([time[0]!, time[time.length - 1]!] as [number, number]);
  return (
    <section class="plots" aria-label="Curves" data-samples={samples}>
      {!hasPlatform.value && <Pistons now={now} time={time} />}
      {panels.map((panel, k) => {
        const curves: Curve[] = [
          ...curvesOf(now, panel),
          ...beside.otherCurves(now, panel),
          ...frozen.value.flatMap((trace) => curvesOf(trace, panel, trace.label)),
        ];
        return (
          <Plot
            key={panel.title}
            {...panel}
            height={HEIGHTS[k] ?? 62}
            curves={curves}
            bands={panel.curves.flatMap(({ column }, index) => beside.bandOf(now, column, index))}
            events={events}
            bare={k < panels.length - 1}
            {...zooming(zoom)}
            cursors={[timeAt.value]}
            onHover={pointAt}
          />
        );
      })}
      {panes.map(
        ({ name, steps }, k) =>
          steps && (
            <StepsPane
              key={name}
              name={name ? `Command of ${name}` : "Command"}
              steps={steps}
              span={span}
              low={valid.value?.valves?.[name] ?? -1}
              put={(next) => putSteps((others, line) => (line === k ? next : others))}
            />
          ),
      )}
    </section>
  );
}

const MOST_PISTONS = 3;

/** The pistons at the time of the cursor, with position, speed and pressures. */
function Pistons({ now, time }: { now: Frame<Head>; time: Numbers }) {
  const end = time[time.length - 1]!;
  const row = indexAt(time, Math.min(timeAt.value, end));
  const pistons = pistonsAt(now, row);
  const shown = (now.head.cylinders ?? []).filter(({ name }) => pistons[name]).slice(0, MOST_PISTONS);
  if (!shown.length) return null;
  const words = `${instant(time[row], end / time.length)} s`;
  return (
    <div class="pistons">
      <Range
        label={`At ${words}`}
        name="Time of the pistons"
        value={time[row]!}
        ends={[0, end]}
        words={words}
        steps={1000}
        put={moveTo}
      />
      <div>
        {shown.map(({ name }) => (
          <Piston key={name} name={shown.length > 1 ? name : ""} at={pistons[name]!} />
        ))}
      </div>
    </div>
  );
}

function Piston({ name, at }: { name: string; at: Moved }) {
  const { share, position, speed, pressures, tints, said } = at;
  const x = 4 + 380 * Math.min(Math.max(share, 0), 1);
  return (
    <div class="piston" data-piston-at={position}>
      <span>
        {name} a {pressures[0]}
      </span>
      <svg viewBox="0 0 400 40" role="img" aria-label={said}>
        <rect class="air" x={4} y={8} width={Math.max(x - 4, 0)} height={24} fill-opacity={tints[0]} />
        <rect class="air" x={x + 12} y={8} width={Math.max(384 - x, 0)} height={24} fill-opacity={tints[1]} />
        <rect class="barrel" x={3} y={7} width={394} height={26} />
        <rect class="body" x={x} y={8} width={12} height={24} />
      </svg>
      <span>b {pressures[1]}</span>
      <b>
        {digits(position / MM)} mm{speed === undefined ? "" : `, ${digits(beside.settled(speed))} m/s`}
      </b>
    </div>
  );
}

/** Notes without danger, impacts, and curves that are not drawn. */
function Remarked() {
  const { warnings = [], panels = [], impacts = [], more_impacts: more = 0 } = answer.value?.head ?? {};
  const notes = warnings.filter((one) => !isSevere(one)).map(sentence);
  const hits = impacts.map(({ time_s, end, cylinder, speed_m_s, energy_j }) => {
    const place = `end of chamber ${end}${cylinder ? ` of ${cylinder}` : ""}`;
    return `${digits(time_s)} s, ${place}: ${digits(speed_m_s, 3)} m/s, ${digits(energy_j, 3)} J`;
  });
  const cut = panels.flatMap(({ title, curves: { length }, left_out = 0 }) =>
    left_out ? `${title}: ${length} of ${length + left_out} curves are drawn; the file of the command has all.` : [],
  );
  return (
    <>
      {notes.length > 0 && (
        <Fold class="note" open={!beside.isNarrow} title={count(notes.length, "more note")}>
          <Notes of={notes} />
        </Fold>
      )}
      {hits.length > 0 && (
        <Fold class="note" title={`${count(hits.length + more, "impact")} on the end stops`}>
          <Notes of={[...hits, ...(more ? [`More impacts: ${more}.`] : [])]} />
        </Fold>
      )}
      <Remarks of={cut} />
    </>
  );
}

const hasPlatform = computed(() => Boolean(answer.value?.head.platforms?.length));

/** Parts of the view that come after the first curves. */
function Below() {
  const now = answer.value;
  if (!now) return null;
  return (
    <div class="below">
      {!hasPlatform.value && (
        <Fold
          class="panel"
          title="Circuit, as it moves"
          open={beside.motion.value}
          onToggle={({ currentTarget }) => (beside.motion.value = (currentTarget as HTMLDetailsElement).open)}>
          {beside.motion.value && <Drawn />}
        </Fold>
      )}
      <Fold open={!isOverMain() || !hasPlatform.value} title="Values at the end">
        <beside.Differences head={now.head} panels={now.head.panels ?? []} />
      </Fold>
      {now.head.loops && <beside.Loops now={now} />}
      {now.head.energy && (
        <section class="energy" aria-label="Energy">
          <h2>{now.head.energy.title}</h2>
          <Values view={now.head.energy} />
        </section>
      )}
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

export const Sliders = () => (
  <>
    {pinned.value.map((key) => (
      <Slider key={key} of={key} />
    ))}
  </>
);

function AddSlider() {
  const free = [...fields.value.values()].filter((one) => one.number !== undefined && !pinned.value.includes(one.key));
  return (
    <Select
      class=""
      value=""
      label="Slider for"
      hint="any value"
      options={free.map((one): [string, string] => [one.key, `${one.key} = ${one.text}`])}
      put={pin}
    />
  );
}

/** Slider of a value, which the description may have no more. */
function Slider({ of }: { of: string }) {
  const field = fields.value.get(of);
  if (field?.number === undefined) return null;
  const value = numbers.value[field.key] ?? field.number;
  const isChanged = value !== field.number;
  const put = (next: number) => (moved.value = { ...moved.value, [placeOf(field)]: next });
  return (
    <SliderRow
      of={field}
      id={`slider-${field.key}`}
      label={field.key.replace(/^components\./, "")}
      title={field.origin}
      value={value}
      kind={isChanged ? "changed" : field.kind}
      put={put}>
      <Button
        class="icon"
        title="Remove this slider"
        aria-label={`Remove the slider of ${field.key}`}
        act={() => (put(field.number!), pin(field.key))}
        words="×"
      />
      {isChanged && (
        <span class="row">
          <Button class="link" act={() => put(field.number!)} words={`back to ${field.text}`} />
          <Button class="link" act={() => set(field.key, withUnit(value, field.unit))}>
            put into the text{field.copies && `, of ${field.copies.join(", ")} together`}
          </Button>
        </span>
      )}
    </SliderRow>
  );
}

/** Menu that selects a CSV file of the folder as the command of a valve. The valve of a drive has no name. */
function FileCommand({ valves }: { valves: string[] }) {
  const files = (studies.value?.files ?? []).map((one) => one.path).filter((path) => /\.csv$/i.test(path));
  const lines = valves.flatMap((valve) => files.map((file) => [lineText(valve, file), valve, file] as const));
  const put = (chosen: string) => {
    const [, valve, file] = lines.find(([words]) => words === chosen)!;
    command.value = withFile(command.value, valve, file);
  };
  if (!files.length) return null;
  const label = "Command from a file (time_s, command)";
  return <Select class="" value="" label={label} hint="choose" options={lines.map(([words]) => words)} put={put} />;
}

function Run() {
  const isCircuit = valid.value?.kind === "circuit";
  const valves = valid.value?.valves ?? {};
  const type = ({ currentTarget }: { currentTarget: { value: string } }) => (command.value = currentTarget.value);
  const field = { id: "command", value: command.value, onInput: type };
  const oneWay = Object.keys(valves).filter((one) => valves[one] === 0);
  return (
    <div class="run">
      <label for="command">
        Command, -1 to 1{isCircuit ? ", a line for each valve" : ""}
        {oneWay.length > 0 && `; 0 to 1 for ${oneWay.join(", ")}`}
        {isCircuit ? <textarea {...field} rows={3} /> : <input {...field} />}
      </label>
      <FileCommand valves={isCircuit ? Object.keys(valves) : [""]} />
      <div class="twin">
        <TextInput label="Duration" of={duration} />
        <TextInput label="Start" of={initial} placeholder={isCircuit ? "NAME.position = 50 mm" : "position = 50 mm"} />
      </div>
    </div>
  );
}
