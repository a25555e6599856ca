/** Start page: ways to begin, files by kind, origin of results. */

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { isUnsaved } from "../drive/opened";
import { count, pretty } from "../plots/looks";
import { inCatalogue, link } from "../routes";
import type { Listed } from "../server/generated";
import { ask, attempting, connection } from "../server/server";
import { viewOf } from "../views";
import { Starts } from "./choose";
import { Button, Fold, Tick, toggled } from "./fields";
import { folderOf, GROUPS, type Kinds, list, listed, refused, studies } from "./files";
import { Chain, stale, trace, useHeadlines } from "./lineage";
import { day, Problems } from "./parts";
import { ObjectLink } from "./tree";

const MOST = 200; // rows of a group on the page; the search of the tree finds the others

export default function StudiesView() {
  useEffect(() => void listed(), [connection.value === "open"]); // what the page reads as it begins is read once
  useEffect(() => void import("../measured/overview").then((loaded) => (overview.value = loaded)), []);
  const found = studies.value;
  const Recordings = overview.value?.Recordings;
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
      {GROUPS.map((group) =>
        group.view === "recording" ? (
          Recordings && <Recordings key={group.title} files={found.files} />
        ) : (
          <Files key={group.title} group={group} all={found.files} />
        ),
      )}
    </>
  );
}

/** Kinds that can be compared in pairs, and kinds that carry or supply hashes of inputs. */
const CHAINED = ["drive", "circuit", "recording", "friction map", "fit", "validation", "comparison", "campaign"];
const [ALIKE, TRACED] = [
  [...CHAINED, "sizing"],
  [...CHAINED, "rig"],
];
const FOLDERS = ["campaign", "comparison", "sizing"]; // objects that are a folder
const pair = signal<string[]>([]);
const differences = signal<typeof import("../measured/differences") | null>(null);
const overview = signal<typeof import("../measured/overview") | null>(null);

/** Compare two files. */
export const comparePair = (paths: string[]): void => void (pair.value = paths);

/** Select a file for the comparison. The newest two count. */
const tick = (path: string): void => void (pair.value = toggled(pair.value, path).slice(-2));

/** Comparison of the two selected files in their current state. */
function Compare() {
  const [before, after] = pair.value;
  useEffect(() => {
    if (after) void import("../measured/differences").then((loaded) => (differences.value = loaded));
  }, [after]);
  if (!before) return null;
  const Comparison = differences.value?.Comparison;
  return (
    <section class="panel" aria-label="Compare two">
      <h2>{after ? `${before} and ${after}` : `Compare ${before} with another of its kind: tick its box`}</h2>
      {after && Comparison && <Comparison before={before} after={after} again={studies.value} />}
    </section>
  );
}

const renaming = signal({ path: "", to: "" });

/** Give a file another name. An existing file is never overwritten. */
const rename = (): Promise<void> =>
  attempting(refused)(async () => {
    await ask("/api/rename", renaming.value);
    renaming.value = { path: "", to: "" };
    await list();
  });

export function Rename({ path }: { path: string }) {
  const now = renaming.value;
  if (now.path !== path)
    return (
      <Button
        class="link"
        aria-label={`Rename ${path}`}
        disabled={isUnsaved(path)}
        act={() => (renaming.value = { path, to: path })}
        words="rename"
      />
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

/** Names of a result that is one object of several files: its folder is shown by this file. */
const MAIN = /(^|\/)(map\.parquet|validation\.toml)$/;

/** Return the files that belong to a characterisation or a validation, with the file that stands for each. */
export function partsOf(files: Listed[]): Map<string, string> {
  const mains = files.filter((file) => MAIN.test(file.path) && folderOf(file.path));
  const mainOf = new Map(mains.map(({ path }) => [folderOf(path), path]));
  const pairs = files.map(({ path }) => [path, mainOf.get(folderOf(path))] as const);
  return new Map(pairs.filter((pair): pair is [string, string] => Boolean(pair[1]) && pair[0] !== pair[1]));
}

/** Results and descriptions of some kinds; the files of a characterisation or a validation stand below its row. */
function Files({ group: { title, view, kinds }, all }: { group: Kinds; all: Listed[] }) {
  const parts = partsOf(all);
  const rows = all.filter((file) => kinds.includes(file.kind) && !parts.has(file.path));
  if (!rows.length) return null;
  const hasDates = new Set(rows.map((file) => day(file.changed))).size > 1;
  return (
    <section class="group">
      <h3>{view ? <a href={link(view)}>{title}</a> : title}</h3>
      <ul class="files listed">
        {rows.slice(0, MOST).map((file) => {
          const own = all.filter((part) => parts.get(part.path) === file.path);
          return <FileRow key={file.path} file={file} hasDate={hasDates} parts={own} />;
        })}
      </ul>
      {rows.length > MOST && <p class="note">{rows.length - MOST} more: search for them in the tree.</p>}
    </section>
  );
}

const VERDICTS: Record<string, string> = { "in order": "good", open: "open", "needs you": "bad" };

function FileRow({ file, hasDate, parts }: { file: Listed; hasDate: boolean; parts: Listed[] }) {
  const { path, kind, changed } = file;
  const [, line = "", verdict] = /^(.*?)(?:: (needs you|open|in order))?$/.exec(useHeadlines()[path] ?? "") ?? [];
  const old = stale.value.stale[path];
  return (
    <li>
      <ObjectLink path={path} view={viewOf(kind)} name={MAIN.test(path) && folderOf(path) ? folderOf(path) : path} />
      <span class="holds">
        {pretty(line)} {verdict && <span class={`pill ${VERDICTS[verdict]}`}>{verdict}</span>}
      </span>
      <span class="note">
        {parts.length > 0 && kind === "friction map" ? "characterisation" : kind}
        {hasDate && `, ${day(changed)}`}
        {old && (
          <b class="missed" data-stale={path}>
            {` out of date: made from another ${old.join(", ")}`}
          </b>
        )}
      </span>
      <span class="row">
        {ALIKE.includes(kind) && (
          <Tick label="compare" name={`Compare ${path}`} value={pair.value.includes(path)} put={() => tick(path)} />
        )}
        {TRACED.includes(kind) && (
          <Button class="link" aria-label={`Made from: ${path}`} act={() => trace(path)} words="made from" />
        )}
        {!FOLDERS.includes(kind) && !inCatalogue(path) && <Rename path={path} />}
      </span>
      {parts.length > 0 && (
        <Fold title={`${count(parts.length, "file")} of ${folderOf(path)}`}>
          <ul class="files listed">
            {parts.slice(0, MOST).map((part) => (
              <FileRow key={part.path} file={part} hasDate={false} parts={[]} />
            ))}
          </ul>
        </Fold>
      )}
    </li>
  );
}
