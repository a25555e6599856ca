/** View of a description: circuit, fields and text side by side. The text is the truth. */
import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { Choose } from "../workspace/choose";
import { ZoomedCircuit } from "./circuit";
import type { Editor } from "./editor";
import { change, drawing, onDisk, opened, problems, said, save, set, setNumber, takeFromDisk, valid, type Field } from "./opened";
import { isIn, KINDS, Problems, SaveButton } from "../workspace/parts";
import { route } from "../routes";
import { pin, pinned } from "../simulate/simulate";

const chosen = signal("");
const name = signal("");
const belongs = (field: Field): boolean => !chosen.value || field.component === chosen.value;

export function DriveView() {
  if (route.value.path) return <Described />;
  return <Choose title="Drives" hint="A drive or a circuit is a TOML file. Open one to see its drawing, its values and its text." view="drive" kinds={["drive", "circuit"]} catalogue />;
}

function Described() {
  const place = useRef<HTMLDivElement>(null);
  const editor = useRef<Editor | null>(null);
  const now = opened.value;
  useEffect(() => {
    let gone = false;
    if (place.current && now)
      void import("./editor").then(({ edit }) => {
        if (!gone && place.current && opened.value) editor.current = edit(place.current, opened.value.text, (text) => void change(text));
      });
    return () => {
      gone = true;
      editor.current?.end();
      editor.current = null;
    };
  }, [now?.path]);
  const own = now?.sha256 ? now.path.slice(now.path.lastIndexOf("/") + 1) : "unnamed.toml"; // as the server calls a new text
  useEffect(() => editor.current?.show(opened.value?.text ?? "", problems.value.filter((one) => isIn(one, own))), [now?.text, problems.value]);
  if (!now) return problems.value.length ? <Problems of={problems.value} /> : null;
  const isNew = !now.sha256;
  return (
    <div class="drive">
      <section aria-label="Circuit">
        <h2>{valid.value?.name ?? now.path}</h2>
        {!drawing.value && !problems.value.length && <p class="canvas waits" role="status">Drawing the circuit.</p>}
        {drawing.value && (
          <ZoomedCircuit key={now.path} drawing={drawing.value} chosen={chosen.value} onChoose={(one) => (chosen.value = chosen.value === one ? "" : one)} />
        )}
        {valid.value?.notes?.map((note) => <p class="note" key={note}>{note}</p>)}
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
                File <input value={name.value} placeholder="axis.toml" onInput={(event) => (name.value = event.currentTarget.value)} />
              </label>
              <button type="button" disabled={!name.value} onClick={() => void save(name.value)}>Save as a new file</button>
            </>
          ) : (
            <SaveButton isSaved={now.text === now.saved} save={() => save(now.path)} />
          )}
          <span role="status">{said.value || (now.text !== now.saved ? "Not saved." : "")}</span>
        </p>
        {onDisk.value && (
          <p class="row">
            <span role="status">The file has changed on disk since you opened it.</span>
            <button type="button" onClick={takeFromDisk}>Drop these changes and show the file</button>
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
    <select aria-label={`Unit of ${field.key}`} value={field.unit} onChange={(event) => void set(field.key, field.text, event.currentTarget.value)}>
      {field.units!.map((one) => <option key={one}>{one}</option>)}
    </select>
  );
}

function Fields() {
  const fields = (valid.value?.values ?? []).filter(belongs);
  return (
    <>
      <h2>
        {chosen.value ? `Values of ${chosen.value}.` : "Values"}{" "}
        {chosen.value ? <button type="button" class="link" onClick={() => (chosen.value = "")}>Show all</button> : <span class="note">Click a symbol to see its values alone.</span>}
      </h2>
    <div class="scroll" tabIndex={0} role="region" aria-label="Values">
      <table class="fields">
        <thead>
          <tr>
            <th scope="col">Key</th>
            <th scope="col">Value</th>
            <th scope="col">Unit</th>
            <th scope="col">Slider</th>
          </tr>
        </thead>
        <tbody>
          {fields.map((one) => (
            <tr key={one.key}>
              <th scope="row">
                {one.key.split(/(?<=[._])/).map((part) => <>{part}<wbr /></>)}
                <span class={`kind ${one.kind}`}>{[KINDS[one.kind], one.origin.replace(/^assumed: /, ""), one.copies && `one value for ${one.copies.join(", ")}`].filter(Boolean).join(", ")}</span>
              </th>
              <td>
                <input
                  aria-label={one.key}
                  value={one.text}
                  onChange={({ currentTarget: { value } }) => void (one.unit === "" ? setNumber(one.key, value) : set(one.key, value))}
                />
              </td>
              <td>{one.units && one.units.length > 1 && <Units field={one} />}</td>
              <td>{one.low !== undefined && <input type="checkbox" aria-label={`Slider for ${one.key} in Simulate`} checked={pinned.value.includes(one.key)} onChange={() => pin(one.key)} />}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
    </>
  );
}
