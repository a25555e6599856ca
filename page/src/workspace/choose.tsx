/** Lists of the files that a view opens, and the starting points. */

import { signal, useSignal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { link } from "../routes";
import { ask, attempting, type Problem, Refused, read, write } from "../server/server";
import { filesOf, list, studies, take, taking } from "./files";
import { useHeadlines } from "./lineage";
import { day, Problems } from "./parts";
import { PathName } from "./tree";

export const EXAMPLE = "catalogue:reference";
const wrong = signal<Problem[]>([]);
const attempt = attempting(wrong);

/** Copy the shipped recordings into the folder, and open the first. */
export const openExample = () =>
  attempt(async () => {
    const { path } = await ask<{ path: string }>("/api/example", {});
    await list();
    location.hash = link("recording", path);
  });

/** Write a text into a new file, and open it. A name that is there already gets a number. */
async function begin(name: string, text: string, view: string): Promise<void> {
  for (let number = 1; ; number++) {
    const path = `${name}${number > 1 ? `-${number}` : ""}.toml`;
    try {
      await write(path, text, "");
    } catch (error) {
      if (error instanceof Refused && error.status === 412) continue; // it is there already
      throw error;
    }
    await list();
    location.hash = link(view, path);
    return;
  }
}

export const openTask = () =>
  attempt(async () => begin("task", (await ask<{ text: string }>("/api/task", {})).text, "sizing"));

/** Start of a platform on three legs, named first. */
function NewPlatform({ isFirst = false }: { isFirst?: boolean }) {
  const name = useSignal("tripod");
  const open = async () => {
    const { text } = await read<{ text: string }>("/api/platform");
    await begin(
      name.value,
      text.replace(/^name = .*$/m, () => `name = ${JSON.stringify(name.value)}`),
      "simulate",
    );
  };
  return (
    <form class="row" onSubmit={(event) => (event.preventDefault(), void attempt(open))}>
      <label>
        Name{" "}
        <input required size={12} value={name.value} onInput={(event) => (name.value = event.currentTarget.value)} />
      </label>
      <button type="submit" class={isFirst ? "primary" : ""}>
        Start with a platform
      </button>
    </form>
  );
}

const OwnFiles = ({ children }: { children: ComponentChildren }) => (
  <label class="button primary">
    {children}
    <input
      type="file"
      multiple
      class="hidden"
      onChange={({ currentTarget: own }) => (void take([...(own.files ?? [])]), (own.value = ""))}
    />
  </label>
);

/** Starting points, each at most two clicks from its first curve. */
export function Starts({ isEmpty }: { isEmpty: boolean }) {
  const examples = (
    <button type="button" onClick={() => void openExample()}>
      Use example recordings
    </button>
  );
  if (!isEmpty)
    return (
      <section class="starts" aria-label="Begin">
        <Problems of={wrong.value} />
        <p class="row">
          <OwnFiles>Add recordings</OwnFiles>
          {examples}
          <a class="button" href={link("simulate", EXAMPLE)}>
            Open an example drive
          </a>
          <button type="button" onClick={() => void openTask()}>
            Start with a task
          </button>
        </p>
        <NewPlatform />
      </section>
    );
  return (
    <section class="starts" aria-label="Begin">
      <p class="lead">This folder is empty. Choose where to begin.</p>
      <Problems of={wrong.value} />
      <div class="cards">
        <article class="panel">
          <h3>Simulate a drive</h3>
          <p>Move the sliders of a drive. The curves follow at once. Save it as a file to keep your changes.</p>
          <p class="row">
            <a class="button primary" href={link("simulate", EXAMPLE)}>
              Open an example drive
            </a>
          </p>
        </article>
        <article class="panel">
          <h3>Read recordings</h3>
          <p>
            Add your CSV, Parquet, MAT, TDMS or MF4 files. The page proposes which column is what. Then it finds strokes
            and friction.
          </p>
          <p class="row">
            <OwnFiles>Add recordings</OwnFiles> {examples}
          </p>
        </article>
        <article class="panel">
          <h3>Size a drive</h3>
          <p>
            State mass, stroke and time. The catalogue is simulated over given spreads. Candidates are ranked by air and
            margin.
          </p>
          <p class="row">
            <button type="button" class="primary" onClick={() => void openTask()}>
              Start with a task
            </button>
          </p>
        </article>
        <article class="panel">
          <h3>Move a platform</h3>
          <p>Three legs under a plate that heaves and tilts. See its workspace, its path and the forces of its legs.</p>
          <NewPlatform isFirst />
        </article>
      </div>
    </section>
  );
}

/** Files that a view opens; `example` comes first. */
export function Choose({
  title,
  hint,
  view,
  kinds,
  catalogue = false,
  recordings = false,
}: {
  title: string;
  hint: string;
  view: string;
  kinds: string[];
  catalogue?: boolean;
  recordings?: boolean;
}) {
  const files = filesOf(...kinds);
  const lines = useHeadlines();
  return (
    <section class="choose" aria-label={title}>
      <h2>{title}</h2>
      <p class="lead">{hint}</p>
      <Problems of={wrong.value} />
      <p class="row">
        {catalogue && (
          <a class="button primary" href={link(view, EXAMPLE)}>
            Open an example drive
          </a>
        )}
        {recordings && (
          <>
            <OwnFiles>Add recordings</OwnFiles>{" "}
            <button type="button" onClick={() => void openExample()}>
              Use example recordings
            </button>
          </>
        )}
        <span role="status" class="note">
          {taking.value}
        </span>
      </p>
      {catalogue && <NewPlatform />}
      {files.length > 0 && (
        <>
          <h3>In the folder</h3>
          <ul class="cards">
            {files.map((one) => (
              <li key={one.path}>
                <a class="panel" href={link(view, one.path)}>
                  <b>
                    <PathName path={one.path} />
                  </b>
                  <span class="note">{lines[one.path] ?? one.kind}</span>
                  <span class="note">{day(one.changed)}</span>
                </a>
              </li>
            ))}
          </ul>
        </>
      )}
      {catalogue && (
        <>
          <h3>In the catalogue</h3>
          <ul class="cards">
            {studies.value?.catalogue.map((one) => (
              <li key={one.path}>
                <a class="panel" href={link(view, one.path)}>
                  <b>{one.path.replace("catalogue:", "")}</b>
                  <span class="note">{one.title}</span>
                </a>
              </li>
            ))}
          </ul>
        </>
      )}
    </section>
  );
}
