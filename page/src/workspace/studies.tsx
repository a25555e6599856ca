/** Start page: ways to begin, files by kind, origin of results. */

import { effect, signal, untracked } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { isUnsaved } from "../drive/opened";
import type { Compared } from "../measured/differences";
import { count, pretty } from "../plots/looks";
import { inCatalogue, link } from "../routes";
import { ask, connection, type Listed, type Problem, Refused } from "../server/server";
import { viewOf } from "../views";
import { questions } from "./answers";
import { Starts } from "./choose";
import { folderOf, GROUPS, list, listed, nameOf, refused, size, studies } from "./files";
import { Chain, stale, trace, useHeadlines } from "./lineage";
import { Copied, day, Problems } from "./parts";
import { PathName } from "./tree";

const MOST = 200; // rows of a group on the page; the search of the tree finds the others

export function StudiesView() {
  useEffect(() => void listed(), [connection.value === "open"]); // what the page reads as it begins is read once
  const found = studies.value;
  if (!found) return refused.value.length ? <Problems of={refused.value} /> : <p>Reading the folder.</p>;
  return (
    <>
      <h2>{found.folder}</h2>
      <Problems of={refused.value} />
      <Starts isEmpty={!found.files.length} />
      <Compare />
      <Chain />
      {stale.value.unchecked > 0 && (
        <p class="note">{stale.value.unchecked} older results were not checked against their inputs.</p>
      )}
      <Chosen files={found.files} />
      {GROUPS.map(({ title, view, kinds }) => {
        const files = found.files.filter((one) => kinds.includes(one.kind));
        return view === "recording" ? (
          <Recordings key={title} title={title} files={files} />
        ) : (
          <Files key={title} title={title} view={view} files={files} />
        );
      })}
    </>
  );
}

/** Kinds that can be compared in pairs, and kinds that carry or supply hashes of inputs. */
const ALIKE = [
  "drive",
  "circuit",
  "fit",
  "friction map",
  "recording",
  "validation",
  "comparison",
  "sizing",
  "campaign",
];
const TRACED = ["drive", "circuit", "recording", "friction map", "fit", "validation", "comparison", "campaign", "rig"];
const FOLDERS = ["campaign", "comparison", "sizing"]; // objects that are a folder
const pair = signal<string[]>([]);
const compared = signal<Compared | null>(null);
const differences = signal<typeof import("../measured/differences") | null>(null);
const apart = signal<Problem[]>([]);

/** Select a file for the comparison. The newest two count. */
const tick = (path: string): void => {
  pair.value = pair.value.includes(path) ? pair.value.filter((one) => one !== path) : [...pair.value, path].slice(-2);
  compared.value = null;
  compare();
};

const comparing = questions();

/** Compare the two selected files in their current state. */
function compare(): void {
  const [before, after] = pair.value;
  const answer = comparing(); // others may be ticked meanwhile
  apart.value = [];
  if (!before || !after) return;
  answer(ask<Compared>("/api/compare", { before, after })).then(
    async (found) => {
      differences.value ??= await answer(import("../measured/differences"));
      compared.value = found;
    },
    (error: unknown) => {
      if (!(error instanceof Refused)) throw error;
      [compared.value, apart.value] = [null, error.problems];
    },
  );
}

effect(() => {
  if (studies.value) untracked(compare); // the files may be others by now
});

function Compare() {
  if (!pair.value.length) return null;
  const Differences = differences.value?.Differences;
  return (
    <section class="panel" aria-label="Compare two">
      <h2>
        {pair.value.length < 2
          ? `Compare ${pair.value[0]} with another of its kind: tick its box`
          : pair.value.join(" and ")}
      </h2>
      <Problems of={apart.value} />
      {compared.value && Differences && (
        <Differences {...compared.value} names={pair.value.map((path) => path.replace(/\.toml$/, ""))} />
      )}
      {compared.value && <Copied {...compared.value} />}
    </section>
  );
}

const renaming = signal({ path: "", to: "" });

/** Give a file another name. An existing file is never overwritten. */
async function rename(): Promise<void> {
  const { path, to } = renaming.value;
  refused.value = [];
  try {
    await ask("/api/rename", { path, to });
    renaming.value = { path: "", to: "" };
    await list();
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    refused.value = error.problems;
  }
}

function Rename({ path }: { path: string }) {
  const now = renaming.value;
  if (now.path !== path)
    return (
      <button
        type="button"
        class="link"
        aria-label={`Rename ${path}`}
        disabled={isUnsaved(path)}
        onClick={() => (renaming.value = { path, to: path })}>
        rename
      </button>
    );
  return (
    <form class="row" onSubmit={(event) => (event.preventDefault(), void rename())}>
      <input
        aria-label={`New name of ${path}`}
        value={now.to}
        onInput={(event) => (renaming.value = { path, to: event.currentTarget.value })}
      />
      <button type="submit">Rename</button>
    </form>
  );
}

const chosen = signal<string[]>([]);
const verb = signal(""); // command whose form is open for the chosen recordings
const form = signal<typeof import("./form") | null>(null);

const choose = (paths: string[], isIn: boolean): void => {
  const others = chosen.value.filter((one) => !paths.includes(one));
  chosen.value = isIn ? [...others, ...paths] : others;
};

/** Actions on all chosen recordings. */
function Chosen({ files }: { files: Listed[] }) {
  const paths = chosen.value.filter((path) => files.some((one) => one.path === path));
  const open = async (kind: string) => {
    form.value ??= await import("./form");
    verb.value = kind;
  };
  if (!paths.length) return null;
  const JobForm = form.value?.JobForm;
  const name = verb.value === "characterise" ? nameOf(folderOf(paths[0]!)) || "friction" : verb.value;
  return (
    <section class="panel chosen" aria-label="Chosen recordings">
      <p class="row">
        <b>{paths.length} chosen</b>
        <button type="button" class="primary" onClick={() => void open("characterise")}>
          {paths.length > 1 ? `Characterise ${paths.length} together` : "Characterise"}
        </button>
        <button type="button" onClick={() => void open("validate")}>
          Validate a drive on {paths.length}
        </button>
        <button type="button" onClick={() => ([chosen.value, verb.value] = [[], ""])}>
          Clear
        </button>
      </p>
      {verb.value && JobForm && (
        <JobForm key={verb.value} kind={verb.value} given={{ recordings: paths }} start={{ name }} />
      )}
    </section>
  );
}

/** Recordings by folder, many in a row, with a box to choose each or all. */
function Recordings({ title, files }: { title: string; files: Listed[] }) {
  if (!files.length) return null;
  const folders = [...new Set(files.map((one) => folderOf(one.path)))];
  return (
    <section class="group">
      <h3>
        <a href={link("recording")}>{title}</a>
      </h3>
      {folders.map((folder) => {
        const own = files.filter((one) => folderOf(one.path) === folder);
        const paths = own.map((one) => one.path);
        return (
          <div class="panel" key={folder}>
            <label class="folder-head">
              <input
                type="checkbox"
                aria-label={`Choose all of ${folder || "the folder"}`}
                checked={paths.every((path) => chosen.value.includes(path))}
                onChange={(event) => choose(paths, event.currentTarget.checked)}
              />{" "}
              <b>{folder || "Recordings here"}</b>{" "}
              <span class="note">
                {count(own.length, "recording")}, {size(own.reduce((sum, one) => sum + one.size, 0))}
              </span>
            </label>
            <ul class="files chips">
              {own.slice(0, MOST).map(({ path, size: bytes, changed }) => (
                <li key={path}>
                  <input
                    type="checkbox"
                    aria-label={`Choose ${path}`}
                    checked={chosen.value.includes(path)}
                    onChange={(event) => choose([path], event.currentTarget.checked)}
                  />
                  <a href={link("recording", path)} title={`${path}, ${size(bytes)}, ${day(changed)}`}>
                    {nameOf(path)}
                  </a>
                  {stale.value.stale[path] && (
                    <b class="missed" data-stale={path}>
                      out of date
                    </b>
                  )}
                  <details class="chip-menu">
                    <summary aria-label={`More of ${path}`}>⋯</summary>
                    <button
                      type="button"
                      class="link"
                      aria-label={`Made from: ${path}`}
                      onClick={() => void trace(path)}>
                      made from
                    </button>{" "}
                    <Rename path={path} />
                  </details>
                </li>
              ))}
            </ul>
            {own.length > MOST && <p class="note">{own.length - MOST} more: search for them in the tree.</p>}
          </div>
        );
      })}
    </section>
  );
}

function Files({ title, view, files }: { title: string; view: string; files: Listed[] }) {
  const lines = useHeadlines();
  if (!files.length) return null;
  return (
    <section class="group">
      <h3>{view ? <a href={link(view)}>{title}</a> : title}</h3>
      <ul class="files listed">
        {files.slice(0, MOST).map((one) => (
          <li key={one.path}>
            {viewOf(one.kind) ? (
              <a href={link(viewOf(one.kind)!, one.path)}>
                <PathName path={one.path} />
              </a>
            ) : (
              <span>
                <PathName path={one.path} />
              </span>
            )}
            <span class="holds">{pretty(lines[one.path] ?? "")}</span>
            <span class="note">
              {one.kind}, {day(one.changed)}
              {stale.value.stale[one.path] && (
                <b class="missed" data-stale={one.path}>
                  {" "}
                  out of date: made from another {stale.value.stale[one.path]!.join(", ")}
                </b>
              )}
            </span>
            <span class="row">
              {ALIKE.includes(one.kind) && (
                <label>
                  <input
                    type="checkbox"
                    aria-label={`Compare ${one.path}`}
                    checked={pair.value.includes(one.path)}
                    onChange={() => tick(one.path)}
                  />{" "}
                  compare
                </label>
              )}
              {TRACED.includes(one.kind) && (
                <button
                  type="button"
                  class="link"
                  aria-label={`Made from: ${one.path}`}
                  onClick={() => void trace(one.path)}>
                  made from
                </button>
              )}
              {!FOLDERS.includes(one.kind) && !inCatalogue(one.path) && <Rename path={one.path} />}
            </span>
          </li>
        ))}
      </ul>
      {files.length > MOST && <p class="note">{files.length - MOST} more: search for them in the tree.</p>}
    </section>
  );
}
