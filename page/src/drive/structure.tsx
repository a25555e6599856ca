/** Editing in the drawing: components are added, joined and removed there, and the text beside it follows. */
import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect } from "preact/hooks";
import type { Kinds } from "../server/generated";
import { future, past, step } from "../undo";
import { useRequest } from "../workspace/answers";
import { Button, type Option, Options } from "../workspace/fields";
import type { PortChoice } from "./circuit";
import { opened, problems, restructure, valid } from "./opened";

export const isEditing = signal(false);
/** Selected component and selected port. */
export const chosen = signal("");
const port = signal("");
const kind = signal(""); // of the component to add; empty: the first one

const forget = (component = ""): void => void ([port.value, chosen.value] = ["", component]);

/** Change the structure; nothing is selected after it. */
const act = (change: Parameters<typeof restructure>[0]): void => restructure(change, () => forget());
const remove = (one: string): void => act({ act: "remove", one });

/** The ports of the drawing while it is edited: the first one is selected, and the second one is joined with it. */
export function portChoice(): PortChoice | undefined {
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
export function keys(event: KeyboardEvent): void {
  if (event.key === "Escape") port.value = "";
  else if (event.key === "Delete" && isEditing.value && chosen.value && valid.value?.kind === "circuit")
    remove(chosen.value);
}

/** Buttons below the drawing. */
export function Structure({ children }: { children: ComponentChildren }) {
  useEffect(() => forget(), [opened.value?.path]);
  const [found] = useRequest<Kinds>("/api/kinds", isEditing.value ? {} : null);
  const kinds = found?.kinds ?? [];
  const toAdd = kind.value || (kinds[0]?.kind ?? "");
  const isCircuit = valid.value?.kind === "circuit";
  const blocked = problems.value.length > 0;
  return (
    <div role="group" aria-label="Edit the circuit">
      <p class="row">
        {children}
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
            <Options of={kinds.map((one): Option => [one.kind, one.title])} />
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
