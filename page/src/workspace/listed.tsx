/** Files in lists with their contents, verdicts and actions, and the lineage of a file by the hashes that it carries. */

import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { isUnsaved } from "../drive/opened";
import { count, pretty } from "../plots/looks";
import { inCatalogue, route } from "../routes";
import type { Lineage, Listed, Made, Stale } from "../server/generated";
import { ask, attempting, attempts, problemsOf, read, useRequest } from "../server/server";
import { viewOf } from "../views";
import { Button, Fold, Tick, toggled } from "./fields";
import { folderOf, kindOf, list, refused, studies } from "./files";
import { follow } from "./jobs";
import { day, Problems, useCopied } from "./parts";
import { ObjectLink } from "./tree";

/** Text of each state of an input. */
const STATES: Record<Made["state"], string> = {
  same: "unchanged",
  changed: "changed since the file was made",
  differs: "its values changed, or values were set for this run",
  missing: "not in the folder any more, or renamed",
  named: "known only by name: the result does not contain its hash",
  unread: "not checked: too long, or no longer readable",
};

const QUIET_MS = 1000; // after the list: what is opened at once does not wait for the content of files

/** Return what the server says of the files, and the hook that reads it after each list, while a view shows it. */
function aboutFiles<T>(address: string, none: T) {
  const found = signal(none);
  let of: unknown = null; // the list that it was read for
  const use = (): T => {
    const now = studies.value;
    useEffect(() => {
      const look = () => {
        if (now === of) return; // another part of the view has asked
        of = now;
        void read<T>(address).then((next) => (found.value = next), problemsOf);
      };
      const timer = now && now !== of ? setTimeout(look, QUIET_MS) : 0;
      return () => clearTimeout(timer);
    }, [now]);
    return found.value;
  };
  return [found, use] as const;
}

/** Contents of the files, in a line each. */
export const [, useHeadlines] = aboutFiles<Record<string, string>>("/api/headlines", {});
/** Results that are older than their inputs. */
export const [stale, useStale] = aboutFiles<Stale>("/api/stale", { stale: {}, unchecked: 0 });

const traced = signal("");
const [wrong, attempt] = attempts();

/** Show the lineage of a file. */
export const trace = (path: string): void => void (traced.value = path);

function Inputs({ of }: { of: Made[] }) {
  if (!of.length) return null;
  return (
    <ul class="lineage">
      {of.map((one, index) => (
        <li key={index} data-input={one.path || one.name} data-state={one.state}>
          {one.kind}: {one.path ? <ObjectLink path={one.path} /> : one.name}{" "}
          <span class={one.state === "changed" ? "missed" : "note"}>
            {STATES[one.state]}
            {one.digest && `, SHA-256 ${one.digest}…`}
          </span>
          <Inputs of={one.inputs} />
        </li>
      ))}
    </ul>
  );
}

/** Lineage of the requested file. */
export function Chain() {
  const { value: path } = traced;
  const [now, problems] = useRequest<Lineage>("/api/lineage", path ? { path } : null, [stale.value]);
  useEffect(() => {
    if (now) document.getElementById("lineage")?.scrollIntoView({ block: "nearest" });
  }, [now?.path]);
  const [copy, copied] = useCopied(now?.again ?? null, attempt, "making it again");
  const again = async () => follow((await ask<{ number: number }>("/api/jobs", now!.again)).number);
  return (
    <section id="lineage" aria-label="Where a result comes from">
      <Problems of={[...problems, ...wrong.value]} />
      {now && (
        <>
          <h2>Where {now.path} comes from</h2>
          {now.stale.length > 0 && (
            <p class="banner" role="status">
              Out of date: {now.stale.join(", ")} {now.stale.length > 1 ? "are" : "is"} no longer what it was made from.
            </p>
          )}
          {!now.inputs.length && <p>It does not list any input.</p>}
          <Inputs of={now.inputs} />
          {now.made.length > 0 && <h3>Made from it</h3>}
          <ul class="lineage">
            {now.made.map((one) => (
              <li key={one} data-made={one}>
                <ObjectLink path={one} />
              </li>
            ))}
          </ul>
          <p class="row">
            {now.again && (
              <>
                <Button act={() => attempt(again)}>Make it again under a new name</Button>
                {copy}
              </>
            )}
            <Button act={() => trace("")}>Close</Button>
          </p>
          {now.again && copied}
        </>
      )}
    </section>
  );
}

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

const renamed = signal(""); // the file whose new name is being typed

/** Give a file another name. An existing file is never overwritten. */
export function Rename({ path }: { path: string }) {
  const to = useRef<HTMLInputElement>(null);
  const rename = attempting(refused);
  const submit = (event: Event) => {
    event.preventDefault();
    void rename(async () => {
      await ask("/api/rename", { path, to: to.current!.value });
      renamed.value = "";
      await list();
    });
  };
  if (renamed.value !== path)
    return (
      <Button class="link" aria-label={`Rename ${path}`} disabled={isUnsaved(path)} act={() => (renamed.value = path)}>
        rename
      </Button>
    );
  return (
    <form class="row" onSubmit={submit}>
      <input ref={to} aria-label={`New name of ${path}`} defaultValue={path} />
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
  /* What belongs to an object of another kind stands in the list of a view, not in the overview. */
  const isPart = (main = "") => main && (!view || kinds.includes(kindOf(main)));
  const rows = all.filter((file) => kinds.includes(file.kind) && !isPart(parts.get(file.path)));
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
