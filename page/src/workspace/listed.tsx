/** Lists of files, each with what it holds, its verdict and its actions. */
import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { isUnsaved } from "../drive/opened";
import { count, pretty } from "../plots/looks";
import { inCatalogue, route } from "../routes";
import type { Listed } from "../server/generated";
import { ask, attempting } from "../server/server";
import { viewOf } from "../views";
import { Button, Fold, Tick, toggled } from "./fields";
import { folderOf, list, refused, studies } from "./files";
import { stale, trace, useHeadlines } from "./lineage";
import { day } from "./parts";
import { ObjectLink } from "./tree";

const MOST = 200; // rows of a list; the search of the tree finds the others

/** Kinds that can be compared in pairs, and kinds that carry or supply hashes of inputs. */
const CHAINED = ["drive", "circuit", "recording", "friction map", "fit", "validation", "comparison", "campaign"];
const [ALIKE, TRACED] = [
  [...CHAINED, "sizing"],
  [...CHAINED, "rig"],
];
const FOLDERS = ["campaign", "comparison", "sizing"]; // objects that are a folder
/** Files that are compared. */
export const pair = signal<string[]>([]);

/** Select a file for the comparison. The newest two count. */
const tick = (path: string): void => void (pair.value = toggled(pair.value, path).slice(-2));

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

interface FilesProps {
  title: ComponentChildren;
  kinds: string[];
  view?: string; // that opens them; absent: the first one of each
}

/** Files of some kinds; the files of a characterisation or a validation stand below its row. */
export function Files({ title, kinds, view }: FilesProps) {
  const all = studies.value?.files ?? [];
  const parts = partsOf(all);
  const rows = all.filter((file) => kinds.includes(file.kind) && !parts.has(file.path));
  if (!rows.length) return null;
  const hasDates = new Set(rows.map((file) => day(file.changed))).size > 1;
  return (
    <section class="group">
      <h3>{title}</h3>
      <ul class="files listed">
        {rows.slice(0, MOST).map((file) => {
          const own = all.filter((part) => parts.get(part.path) === file.path);
          return <FileRow key={file.path} file={file} view={view} hasDate={hasDates} parts={own} />;
        })}
      </ul>
      {rows.length > MOST && <p class="note">{rows.length - MOST} more: search for them in the tree.</p>}
    </section>
  );
}

const VERDICTS: Record<string, string> = { "in order": "good", open: "open", "needs you": "bad" };

interface RowProps {
  file: Listed;
  view?: string | undefined;
  hasDate: boolean;
  parts: Listed[];
}

/** A file with its line, its verdict and its actions. Comparison and origin of a file stand in the overview. */
function FileRow({ file: { path, kind, changed }, view = viewOf(kind), hasDate, parts }: RowProps) {
  const isOverview = route.value.view === "studies";
  const [, line = "", verdict] = /^(.*?)(?:: (needs you|open|in order))?$/.exec(useHeadlines()[path] ?? "") ?? [];
  const old = stale.value.stale[path];
  return (
    <li>
      <ObjectLink path={path} view={view} name={MAIN.test(path) && folderOf(path) ? folderOf(path) : path} />
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
        {isOverview && ALIKE.includes(kind) && (
          <Tick label="compare" name={`Compare ${path}`} value={pair.value.includes(path)} put={() => tick(path)} />
        )}
        {isOverview && TRACED.includes(kind) && (
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
