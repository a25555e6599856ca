/** Lists of the files that a view opens, and the starting points. */

import { useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { link } from "../routes";
import { ask, attempts, read, write } from "../server/server";
import { Button, TextInput } from "./fields";
import { freeName, GROUPS, list, listed, studies, taking } from "./files";
import { AddFiles, Files } from "./listed";
import { Problems } from "./parts";

export const EXAMPLE = "catalogue:reference";
const [wrong, attempt] = attempts();

/** Copy the shipped recordings into the folder, and open the first. */
export const openExample = () =>
  attempt(async () => {
    const { path } = await ask<{ path: string }>("/api/example", {});
    await list();
    location.hash = link("recording", path);
  });

/** Write a text into a new file of a free name, and open it. */
async function begin(name: string, text: string, view: string): Promise<void> {
  await listed();
  const used = (studies.value?.files ?? []).map((file) => file.path.replace(/\.toml$/i, ""));
  const path = `${freeName(name, used)}.toml`;
  await write(path, text, "");
  await list();
  location.hash = link(view, path);
}

export const openTask = () =>
  attempt(async () => begin("task", (await ask<{ text: string }>("/api/task", {})).text, "sizing"));

/** Start of a platform on three legs, named first. */
function NewPlatform({ isFirst }: { isFirst: boolean }) {
  const name = useSignal("tripod");
  const open = async () => {
    const { text } = await read<{ text: string }>("/api/platform");
    const named = text.replace(/^name = .*$/m, () => `name = ${JSON.stringify(name.value)}`);
    await begin(name.value, named, "simulate");
  };
  return (
    <form class="row" onSubmit={(event) => (event.preventDefault(), void attempt(open))}>
      <TextInput label="Name" of={name} required size={12} />
      <button type="submit" class={isFirst ? "primary" : ""}>
        Start with a platform
      </button>
    </form>
  );
}

/** Buttons that begin with a drive in a view, and with recordings. */
const exampleDrive = (view: string, look: string) => (
  <a class={look} href={link(view, EXAMPLE)}>
    Open an example drive
  </a>
);
const recordings = (
  <>
    <label class="button primary">
      Add recordings <AddFiles />
    </label>{" "}
    <Button act={() => openExample()}>Use example recordings</Button>
  </>
);

/** Starting points: a sentence and buttons, at most two clicks from the first curve. */
const STARTS = (isEmpty: boolean): [title: string, words: string, buttons: ComponentChildren][] => [
  [
    "Simulate a drive",
    "Move the sliders of a drive. The curves follow at once. Save it as a file to keep your changes.",
    exampleDrive("simulate", isEmpty ? "button primary" : "button"),
  ],
  [
    "Read recordings",
    "Add your CSV, Parquet, MAT, TDMS or MF4 files. The page proposes which column is what. Then it finds strokes and friction.",
    recordings,
  ],
  [
    "Size a drive",
    "State mass, stroke and time. The catalogue is simulated over given spreads. Candidates are ranked by air and margin.",
    <Button class={isEmpty ? "primary" : ""} act={() => openTask()} words="Start with a task" />,
  ],
  [
    "Move a platform",
    "Three legs under a plate that heaves and tilts. See its workspace, its path and the forces of its legs.",
    <NewPlatform isFirst={isEmpty} />,
  ],
];

/** Ways to begin: explained in an empty folder, in one row otherwise. */
export function Starts({ isEmpty }: { isEmpty: boolean }) {
  return (
    <section class="starts" aria-label="Begin">
      {isEmpty && <p class="lead">This folder is empty. Choose where to begin.</p>}
      <Problems of={wrong.value} />
      <div class={isEmpty ? "cards" : "row"}>
        {STARTS(isEmpty).map(([title, words, buttons]) =>
          isEmpty ? (
            <article class="panel" key={title}>
              <h3>{title}</h3>
              <p>{words}</p>
              <div class="row">{buttons}</div>
            </article>
          ) : (
            buttons
          ),
        )}
      </div>
    </section>
  );
}

/** Text of each view that begins with a choice of a file. */
export const ENTRIES: Record<string, string> = {
  drive: "A drive or a circuit is a TOML file. Open one to see its drawing, its values and its text.",
  simulate: "Open a drive or a circuit to run it. Each slider changes the run while you drag it.",
  recording:
    "A recording is a table of channels over time: CSV, Parquet, MAT, TDMS or MF4. Add your own, or look at two shipped ones.",
  friction:
    "A friction map holds the measured points, a fit holds the law. Characterise a recording to get both: open it, accept a layout, then press Characterise.",
};

/** Files that a view opens, after an example. */
export function Choose({ view }: { view: string }) {
  const { title, kinds } = GROUPS.find((one) => one.view === view) ?? { ...GROUPS[0]!, title: "Simulate" };
  const hasDrives = kinds.includes("drive");
  const catalogue = hasDrives ? (studies.value?.catalogue ?? []) : [];
  return (
    <section class="choose" aria-label={title}>
      <h2>{title}</h2>
      <p class="lead">{ENTRIES[view]}</p>
      <Problems of={wrong.value} />
      <p class="row">
        {hasDrives ? exampleDrive(view, "button primary") : recordings}
        <span role="status" class="note">
          {taking.value}
        </span>
      </p>
      <Files title="In the folder" kinds={kinds} view={view} />
      {catalogue.length > 0 && <h3>In the catalogue</h3>}
      <ul class="cards">
        {catalogue.map((one) => (
          <li key={one.path}>
            <a class="panel" href={link(view, one.path)}>
              <b>{one.path.replace("catalogue:", "")}</b>
              <span class="note">{one.title}</span>
            </a>
          </li>
        ))}
      </ul>
    </section>
  );
}
