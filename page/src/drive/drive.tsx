/** View of a description: circuit, fields and text side by side. The text is the truth. */

import { effect, signal, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { route } from "../routes";
import type { Frame } from "../server/frame";
import { Live, type Problem } from "../server/server";
import { pin, pinned, request, Sliders } from "../simulate/simulate";
import { Choose } from "../workspace/choose";
import { list } from "../workspace/files";
import { isIn, KINDS, Problems, SaveButton, TextField } from "../workspace/parts";
import { notesOf, whole, ZoomedCircuit } from "./circuit";
import type { Editor } from "./editor";
import { endsOf, type MotionHead, MovingCircuit } from "./moving";
import {
  change,
  drawing,
  type Field,
  onDisk,
  opened,
  problems,
  said,
  save,
  set,
  setNumber,
  takeFromDisk,
  useDrawing,
  valid,
} from "./opened";
import { chosen, keys, portChoice, Structure } from "./structure";

const name = signal("");
const belongs = (field: Field): boolean => !chosen.value || field.component === chosen.value;

export function DriveView() {
  if (route.value.path) return <Described />;
  return (
    <Choose
      title="Drives"
      hint="A drive or a circuit is a TOML file. Open one to see its drawing, its values and its text."
      view="drive"
      kinds={["drive", "circuit"]}
      catalogue
    />
  );
}

const WIDE = 1.5; // width over height of a drawing that gets the whole width of the page

interface Head extends MotionHead {
  number: number;
  path: string;
  problems?: Problem[];
}

const isRun = signal(false);
const line = signal(-1); // that the pointer is on

/** The drawing, at rest or in a run. The run follows each change of the text. */
function Running() {
  const answer = useSignal<Frame<Head> | null>(null);
  const wrong = useSignal<Problem[]>([]);
  useEffect(() => {
    if (!isRun.value) return;
    const live = new Live<Head>((frame) => {
      if (frame.head.path !== opened.value?.path) return;
      wrong.value = frame.head.problems ?? [];
      if (!frame.head.problems) answer.value = frame;
    });
    const end = effect(() => {
      const asked = request();
      if (asked) live.request({ ...asked, others: [], spreads: {}, loops: false, energy: false, motion: true });
    });
    return () => {
      end();
      live.close();
    };
  }, [isRun.value]);
  const shapes = drawing.value;
  if (!shapes) return null;
  const now = isRun.value ? answer.value : null;
  const props = {
    drawing: shapes,
    chosen: chosen.value,
    ports: portChoice(),
    onChoose: (one: string) => void (chosen.value = chosen.value === one ? "" : one),
    onLine: (net: number) => void (line.value = net),
  };
  const pins = shapes.nets[line.value];
  return (
    <>
      {now ? (
        <MovingCircuit now={now} drawing={shapes}>
          {(motion) => (
            <>
              <ZoomedCircuit {...props} motion={motion} />
              <p class="note pointed">
                {motion.lines[line.value]?.said ??
                  "Lines: the stronger the colour, the higher the pressure. Point at a line for its pressure and flow."}
              </p>
            </>
          )}
        </MovingCircuit>
      ) : (
        <>
          <ZoomedCircuit {...props} />
          <p class="note pointed">{pins ? endsOf(pins) : "Click a symbol to see only its values."}</p>
        </>
      )}
      {isRun.value && <Problems of={wrong.value} />}
      <Structure>
        <button
          type="button"
          aria-pressed={isRun.value}
          title="With the command, the duration and the sliders of Simulate"
          onClick={() => (isRun.value = !isRun.value)}>
          Run in the drawing
        </button>
      </Structure>
      {isRun.value && pinned.value.length > 0 && (
        <div class="pinned">
          <Sliders />
        </div>
      )}
    </>
  );
}

function Described() {
  const place = useRef<HTMLDivElement>(null);
  const editor = useRef<Editor | null>(null);
  const now = opened.value;
  const shapes = useDrawing();
  useEffect(() => {
    let gone = false;
    if (place.current && now)
      void import("./editor").then(({ edit }) => {
        if (!gone && place.current && opened.value)
          editor.current = edit(place.current, opened.value.text, (text) => void change(text, true));
      });
    return () => {
      gone = true;
      editor.current?.end();
      editor.current = null;
    };
  }, [now?.path]);
  const own = now?.sha256 ? now.path.slice(now.path.lastIndexOf("/") + 1) : "unnamed.toml"; // as the server calls a new text
  useEffect(
    () =>
      editor.current?.show(
        opened.value?.text ?? "",
        problems.value.filter((one) => isIn(one, own)),
      ),
    [now?.text, problems.value],
  );
  if (!now) return problems.value.length ? <Problems of={problems.value} /> : null;
  const isNew = !now.sha256;
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
        <Running key={now.path} />
        {shapes && <p class="note">{notesOf(shapes)}</p>}
        {valid.value?.notes?.map((note) => (
          <p class="note" key={note}>
            {note}
          </p>
        ))}
      </section>
      <div>
        <section aria-label="Values of the drive">
          <Fields />
        </section>
        <section aria-label="Text">
          <h2>{isNew ? "Text of a new file" : now.path}</h2>
          <div ref={place} class="editor" />
          <p class="row">
            {isNew ? (
              <>
                <label>
                  File{" "}
                  <input
                    value={name.value}
                    placeholder="axis.toml"
                    onInput={(event) => (name.value = event.currentTarget.value)}
                  />
                </label>
                <button type="button" disabled={!name.value} onClick={() => void save(name.value).then(list)}>
                  Save as a new file
                </button>
              </>
            ) : (
              <SaveButton isSaved={now.text === now.saved} save={() => save(now.path)} />
            )}
            <span role="status">{said.value || (now.text !== now.saved ? "Not saved." : "")}</span>
          </p>
          {onDisk.value && (
            <p class="row">
              <span role="status">The file has changed on disk since you opened it.</span>
              <button type="button" onClick={takeFromDisk}>
                Drop these changes and show the file
              </button>
            </p>
          )}
          <Problems of={problems.value} own={own} onLine={(line) => editor.current?.go(line)} />
          {!problems.value.length && <p class="note">No problems.</p>}
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
      {field.units!.map((one) => (
        <option key={one}>{one}</option>
      ))}
    </select>
  );
}

/** Return the table of a key, and the key within it: `components.valve_1.overlap` is `overlap` of `valve_1`. */
function split(key: string): [table: string, own: string] {
  const parts = key.split(".");
  const at = parts[0] === "components" && parts.length > 2 ? 2 : Math.min(1, parts.length - 1);
  return [parts.slice(at === 2 ? 1 : 0, at).join("."), parts.slice(at).join(".")];
}

/** Text of a value without its unit if a menu shows the unit. */
const bare = ({ text, unit, units }: Field): string =>
  units && units.length > 1 && unit && text.endsWith(` ${unit}`) ? text.slice(0, -unit.length - 1) : text;

/** Put a typed value into the text. A number alone has the unit of the menu. */
function put(field: Field, value: string): void {
  if (field.unit === "") void setNumber(field.key, value);
  else
    void set(
      field.key,
      field.unit && value.trim() && Number.isFinite(Number(value)) ? `${value.trim()} ${field.unit}` : value,
    );
}

function Fields() {
  const fields = (valid.value?.values ?? []).filter(belongs);
  return (
    <>
      <h2>
        {chosen.value ? `Values of ${chosen.value}.` : "Values"}{" "}
        {chosen.value ? (
          <button type="button" class="link" onClick={() => (chosen.value = "")}>
            Show all
          </button>
        ) : null}
      </h2>
      <div class="scroll" tabIndex={0} role="region" aria-label="Values">
        <table class="fields">
          <thead>
            <tr>
              <th scope="col">Key</th>
              <th scope="col">Value</th>
              <th scope="col">Unit</th>
              <th scope="col" title="Slider in Simulate">
                Slider
              </th>
            </tr>
          </thead>
          <tbody>
            {fields.map((one, k) => [
              split(one.key)[0] !== (k ? split(fields[k - 1]!.key)[0] : "") && (
                <tr class="table" key={`table ${split(one.key)[0]}`}>
                  <th colSpan={4} scope="rowgroup">
                    {split(one.key)[0]}
                  </th>
                </tr>
              ),
              <tr key={one.key}>
                <th scope="row">
                  {split(one.key)[1]
                    .split(/(?<=[._])/)
                    .map((part) => (
                      <>
                        {part}
                        <wbr />
                      </>
                    ))}{" "}
                  <span class={`kind ${one.kind}`}>
                    {[
                      KINDS[one.kind],
                      one.origin.replace(/^assumed: /, ""),
                      one.copies && `one value for ${one.copies.join(", ")}`,
                    ]
                      .filter(Boolean)
                      .join(", ")}
                  </span>
                </th>
                <td>
                  <TextField label={one.key} value={bare(one)} put={(value) => put(one, value)} />
                </td>
                <td>{one.units && one.units.length > 1 && <Units field={one} />}</td>
                <td>
                  {one.low !== undefined && (
                    <input
                      type="checkbox"
                      aria-label={`Slider for ${one.key} in Simulate`}
                      checked={pinned.value.includes(one.key)}
                      onChange={() => pin(one.key)}
                    />
                  )}
                </td>
              </tr>,
            ])}
          </tbody>
        </table>
      </div>
    </>
  );
}
