/** View of a description: circuit, fields and text side by side, each for changes. The text is the truth. */

import { signal, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { count } from "../plots/looks";
import { future, past, route, step } from "../routes";
import type { Frame } from "../server/frame";
import type { Field, RunHead as Head, Kinds, Part, Problem } from "../server/generated";
import { ask, attempts, isShowable, typed, useLive, useRequest } from "../server/server";
import { pin, pinned, request, Sliders } from "../simulate/simulate";
import { Breakable, Button, Fold, Options, Remarks, Table, Tick } from "../workspace/fields";
import { Problems, TextField } from "../workspace/parts";
import { type Drawing, endsOf, type Motion, MovingCircuit, type PortChoice, whole, ZoomedCircuit } from "./circuit";
import { opened, problems, restructure, set, takePart, useDrawing, valid } from "./opened";
import { useOpenText } from "./text";

const name = signal("");
const isEditing = signal(false); // components are added, joined and removed in the drawing, and the text follows
/** Selected component and selected port. */
const chosen = signal("");
const port = signal("");
const kind = signal(""); // of the component to add; empty: the first one

const forget = (component = ""): void => void ([port.value, chosen.value] = ["", component]);

/** Change the structure; nothing is selected after it. */
const act = (change: Parameters<typeof restructure>[0]): void => restructure(change, () => forget());
const remove = (one: string): void => act({ act: "remove", one });

/** The ports of the drawing while it is edited: the first one is selected, and the second one is joined with it. */
function portChoice(): PortChoice | undefined {
  if (!isEditing.value || valid.value?.kind !== "circuit") return undefined;
  return {
    port: port.value,
    onPort: (one) => {
      if (port.value === one) port.value = "";
      else if (port.value) act({ act: "join", one: port.value, other: one });
      else port.value = one;
    },
  };
}

/** Keys of the drawing while it is edited. */
function keys(event: KeyboardEvent): void {
  if (event.key === "Escape") port.value = "";
  else if (event.key === "Delete" && isEditing.value && chosen.value && valid.value?.kind === "circuit")
    remove(chosen.value);
}

const isNarrow = globalThis.matchMedia?.("(max-width: 40rem)").matches;
const belongs = (field: Field): boolean => !chosen.value || field.component === chosen.value;

const WIDE = 1.5; // width over height of a drawing that gets the whole width of the page

const isRun = signal(false);
const line = signal(-1); // that the pointer is on

const HOW_LINES = "Lines: the stronger the colour, the higher the pressure. Point at a line for its pressure and flow.";

/** Buttons below the drawing. */
function Structure() {
  useEffect(() => forget(), [opened.value?.path]);
  const kinds = useRequest<Kinds>("/api/kinds", isEditing.value ? {} : null)[0]?.kinds ?? [];
  const toAdd = kind.value || (kinds[0]?.[0] ?? "");
  const isCircuit = valid.value?.kind === "circuit";
  const blocked = problems.value.length > 0;
  return (
    <div role="group" aria-label="Edit the circuit">
      <p class="row">
        <Button
          aria-pressed={isRun.value}
          title="With the command, the duration and the sliders of Simulate"
          act={() => (isRun.value = !isRun.value)}
          words="Run in the drawing"
        />
        <Button aria-pressed={isEditing.value} act={() => ((isEditing.value = !isEditing.value), (port.value = ""))}>
          Edit the circuit
        </Button>
        <Button disabled={!past.value.length} act={() => step(past, future)} words="Undo" />
        <Button disabled={!future.value.length} act={() => step(future, past)} words="Redo" />
        {isEditing.value && isCircuit && chosen.value && (
          <Button disabled={blocked} act={() => remove(chosen.value)} words={`Remove ${chosen.value}`} />
        )}
      </p>
      {isEditing.value && !isCircuit && (
        <p class="row">
          <span>A drive has a fixed structure. As a circuit, each component can be added, joined and removed.</span>
          <Button disabled={blocked} act={() => act({ act: "open" })} words="Open it as a circuit" />
        </p>
      )}
      {isEditing.value && isCircuit && !port.value && (
        <p class="note">
          Click a port to add a component there or to join it with another port. Click a symbol to remove it.
        </p>
      )}
      {isEditing.value && isCircuit && port.value && (
        <p class="row">
          <b>Port {port.value}</b>
          <select
            aria-label="Component to add"
            value={toAdd}
            onChange={(event) => (kind.value = event.currentTarget.value)}>
            <Options of={kinds} />
          </select>
          <Button
            class="primary"
            disabled={blocked}
            act={() => restructure({ act: "add", one: port.value, kind: toAdd }, forget)}
            words="Add here"
          />
          <Button disabled={blocked} act={() => act({ act: "cut", one: port.value })} words="Cut its line" />
          <span class="note">Click another port to join it.</span>
        </p>
      )}
      {isEditing.value && blocked && (
        <p class="note">The drawing shows the last valid text: undo, or correct the text.</p>
      )}
    </div>
  );
}

/** The drawing, at rest or in a run. The run follows each change of the text. */
function Running({ shapes }: { shapes: Drawing }) {
  const answer = useSignal<Frame<Head> | null>(null);
  const wrong = useSignal<Problem[]>([]);
  useLive<Head>(
    () => {
      const run = isRun.value && request();
      return run ? { ...run, others: [], spreads: {}, loops: false, energy: false, motion: true } : null;
    },
    (frame) => {
      if (frame.head.path !== opened.value?.path) return;
      if (isShowable(frame, wrong)) answer.value = frame;
    },
    [isRun.value],
  );
  const now = isRun.value ? answer.value : null;
  const props = {
    drawing: shapes,
    chosen: chosen.value,
    ports: portChoice(),
    onChoose: (one: string) => void (chosen.value = chosen.value === one ? "" : one),
    onLine: (net: number) => void (line.value = net),
  };
  const pins = shapes.nets[line.value];
  const atRest = pins ? endsOf(pins) : "Click a symbol to see only its values.";
  const shown = (motion?: Motion) => (
    <>
      <ZoomedCircuit {...props} motion={motion} />
      <p class="note pointed">{motion ? (motion.lines[line.value]?.said ?? HOW_LINES) : atRest}</p>
    </>
  );
  return (
    <>
      {now ? <MovingCircuit now={now} drawing={shapes} children={shown} /> : shown()}
      {isRun.value && <Problems of={wrong.value} />}
      <Structure />
      {isRun.value && pinned.value.length > 0 && (
        <div class="pinned">
          <Sliders />
        </div>
      )}
    </>
  );
}

export default function DriveView() {
  const now = opened.value;
  const shapes = useDrawing();
  const [editor, state] = useOpenText(route.value.path, name);
  if (!now || now.isTask) return problems.value.length ? <Problems of={problems.value} /> : null;
  const [, , wide, high] = shapes ? whole(shapes) : [0, 0, 1, 1];
  return (
    <div class={wide > WIDE * high ? "drive wide-drawing" : "drive"}>
      <section aria-label="Circuit" onKeyDown={keys}>
        <h2>{valid.value?.name ?? now.path}</h2>
        {!shapes && !problems.value.length && (
          <p class="canvas waits" role="status">
            Drawing the circuit.
          </p>
        )}
        {shapes && <Running key={now.path} shapes={shapes} />}
        <p class="note">{shapes?.words.slice(1).join(" ")}</p>
        <Remarks of={valid.value?.notes ?? []} />
      </section>
      <div>
        <section aria-label="Name and state">{state}</section>
        <section aria-label="Values of the drive">
          <Fields />
        </section>
        <section aria-label="Text">
          <Fold class="text" open={!isNarrow} title={<h2>{now.sha256 ? now.path : "Text of a new file"}</h2>}>
            {editor}
          </Fold>
        </section>
      </div>
    </div>
  );
}

/** Menu of the units of a field. A new unit converts the value in the text. */
function Units({ field }: { field: Field }) {
  return (
    <select
      aria-label={`Unit of ${field.key}`}
      value={field.unit}
      onChange={(event) => void set(field.key, field.text, event.currentTarget.value)}>
      <Options of={field.units!} />
    </select>
  );
}

/** Return the table of a key, and the key within it: `components.valve_1.overlap` is `overlap` of `valve_1`. */
function split(key: string): [table: string, own: string] {
  const [, table = "", own = key] = /^(?:components\.(?=[^.]+\.))?([^.]+)\.(.+)$/.exec(key) ?? [];
  return [table, own];
}

/** Text of a value without its unit if a menu shows the unit. */
const bare = ({ text, unit, units }: Field): string =>
  units && units.length > 1 && unit && text.endsWith(` ${unit}`) ? text.slice(0, -unit.length - 1) : text;

/** Put a typed value into the text. A number alone has the unit of the menu. */
function put({ key, unit }: Field, value: string): void {
  const isNumber = value.trim() && Number.isFinite(Number(value));
  if (unit === "") void attempts(problems)[1](async () => set(key, typed(key, value)));
  else void set(key, unit && isNumber ? `${value.trim()} ${unit}` : value);
}

/** Values that matter first: end of the key, and name. */
const MAIN: [end: string, name: string][] = [
  ["bore", "Bore"],
  ["stroke", "Stroke"],
  ["mass", "Load"],
  ["moving_mass", "Moving mass"],
  ["incline", "Incline"],
  ["pressure", "Supply"],
  ["conductance", "Valve size C"],
  ["length", "Tube"],
  ["law", "Friction law"],
  ["coulomb", "Friction"],
];

/** Return the first value of each of the main names. The pressure of the surroundings is not the supply. */
function mainOf(fields: Field[]): Map<string, string> {
  const own = fields.map((field) => field.key).filter((key) => !key.startsWith("ambient."));
  const found = MAIN.map(([end, name]) => [own.find((key) => `.${key}`.endsWith(`.${end}`)) ?? "", name] as const);
  return new Map(found.filter(([key]) => key));
}

function Fields() {
  const fields = (valid.value?.values ?? []).filter(belongs);
  const main = mainOf(fields);
  const rest = fields.filter((field) => !main.has(field.key));
  const assumed = rest.filter((field) => field.kind === "assumed").length;
  const badge = <span class="pill open">{assumed} assumed</span>;
  return (
    <>
      <h2>
        {chosen.value ? `Values of ${chosen.value}.` : "Values"}{" "}
        {chosen.value && <Button class="link" act={() => (chosen.value = "")} words="Show all" />}
      </h2>
      <Parts />
      {chosen.value ? (
        <FieldTable fields={fields} />
      ) : (
        <>
          <FieldTable fields={fields.filter((field) => main.has(field.key))} names={main} />
          {rest.length > 0 && (
            <Fold title={[`${count(rest.length, "other value")} `, assumed > 0 && badge]}>
              <FieldTable fields={rest} />
            </Fold>
          )}
        </>
      )}
    </>
  );
}

/** Menus that take cylinder and valve from the catalogue. */
function Parts() {
  const keyOf = (family: string) =>
    valid.value?.kind === "drive"
      ? `${family}.kind`
      : valid.value?.values?.find(({ key, text }) => key.endsWith(".kind") && text.startsWith(`${family}/`))?.key;
  return (
    <div class="twin">
      {["cylinder", "valve"].map((family) => {
        const key = keyOf(family);
        return key && <PartMenu key={family} family={family} table={key.slice(0, -".kind".length)} />;
      })}
    </div>
  );
}

/** Parts of the catalogue that fit a table of the text. They are asked for when the menu is reached. */
function PartMenu({ family, table }: { family: string; table: string }) {
  const parts = useSignal<Part[]>([]);
  const look = async () => {
    const { path, text } = opened.value!;
    parts.value = (await ask<{ parts: Part[] }>("/api/parts", { path, text, table, family })).parts;
  };
  return (
    <label class="choice">
      {family[0]!.toUpperCase() + family.slice(1)} of the catalogue{" "}
      <input
        list={`parts-${family}`}
        placeholder="type or choose"
        onFocus={() => void look()}
        onChange={({ currentTarget: field }) => {
          const part = parts.value.find(({ title }) => title === field.value);
          if (part) takePart(table, part.name);
        }}
      />
      <datalist id={`parts-${family}`}>
        {parts.value.map((part) => (
          <option key={part.name} value={part.title} />
        ))}
      </datalist>
    </label>
  );
}

/** Return where a value comes from. */
const originOf = ({ kind, origin, copies }: Field): string =>
  [kind, origin.replace(/^assumed: /, ""), copies && `one value for ${copies.join(", ")}`].filter(Boolean).join(", ");

/** Rows of values: their names, or their keys under the names of their tables. */
function FieldTable({ fields, names }: { fields: Field[]; names?: Map<string, string> }) {
  const rows = fields.map((field) => [
    <span title={field.key}>
      {names?.get(field.key) ?? <Breakable words={split(field.key)[1]} />}{" "}
      <span class={`kind ${field.kind}`}>{originOf(field)}</span>
    </span>,
    <TextField key={field.key} aria-label={field.key} value={bare(field)} put={(value) => put(field, value)} />,
    field.units && field.units.length > 1 && <Units field={field} />,
    field.low !== undefined && (
      <Tick
        label=""
        name={`Slider for ${field.key} in Simulate`}
        value={pinned.value.includes(field.key)}
        put={() => pin(field.key)}
      />
    ),
  ]);
  const tables = fields.map(({ key }) => (names ? "" : split(key)[0]));
  const headed = rows.flatMap((row, k) => (tables[k] === (tables[k - 1] ?? "") ? [row] : [[tables[k]], row]));
  const heads = ["Key", "Value", "Unit", { text: "Slider", data: { title: "Slider in Simulate" } }];
  return (
    <Table class="fields" frame="wide" label={names ? "Main values" : "Other values"} heads={heads} rows={headed} />
  );
}
