/**
 * The folder: its tree, its files in lists with contents, verdicts and actions, and the lineage of a file by the hashes that
 * it carries.
 */

import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { isUnsaved } from "../drive/opened";
import { count, pretty } from "../plots/looks";
import { inCatalogue, link, route } from "../routes";
import type { Lineage, Listed, Made, Stale } from "../server/generated";
import { ask, attempts, problemsOf, read, useRequest } from "../server/server";
import { viewOf } from "../views";
import { Button, Fold, Tick, toggled } from "./fields";
import { filesOf, folderOf, GROUPS, kindOf, list, nameOf, refused, studies, take, taking } from "./files";
import { follow } from "./jobs";
import { day, Problems, useCopied } from "./parts";

const MOST = 200; // rows of a list; the search of the tree finds the others
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
  const [, rename] = attempts(refused);
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

/**
 * Files of some kinds, which open in `view` or in the first one of each. The files of a characterisation or a validation
 * stand below its row.
 */
export function Files({ title, kinds, view }: { title: ComponentChildren; kinds: string[]; view?: string }) {
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

/** A file with its line, its verdict and its actions. The overview shows comparison and origin of a file. */
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

const search = signal("");
const closed = signal<string[]>(["Catalogue"]);
/** True if the tree is above the view, as on a narrow screen. */
export const isOverMain = (): boolean => typeof matchMedia !== "undefined" && !matchMedia("(min-width: 60rem)").matches;
export const isShown = signal(!isOverMain());

/** A path, with its folders in a paler colour. */
export function PathName({ path }: { path: string }) {
  const name = nameOf(path);
  return (
    <>
      {path.length > name.length && <span class="dir">{path.slice(0, -name.length)}</span>}
      {name}
    </>
  );
}

/** Field of a label that copies files of this machine into the folder. */
export const AddFiles = () => (
  <input
    type="file"
    multiple
    class="hidden"
    onChange={({ currentTarget: field }) => (void take([...(field.files ?? [])]), (field.value = ""))}
  />
);

/** Link to an object in its first view, or in the named one. An object without a view has its name only. */
export function ObjectLink({ path, view = viewOf(kindOf(path)), title = path, name = path }: ListedObject) {
  const shown = <PathName path={name} />;
  if (!view) return <span title={title}>{shown}</span>;
  return (
    <a href={link(view, path)} aria-current={route.value.path === path ? "page" : undefined} title={title}>
      {shown}
    </a>
  );
}

interface ListedObject {
  path: string;
  view?: string | undefined;
  title?: string;
  name?: string; // that is shown
}

/** Objects of one kind, with a link to the list of the view that opens them. */
function Group({ title, view, rows }: { title: string; view: string; rows: ListedObject[] }) {
  const isOpen = Boolean(search.value) || !closed.value.includes(title);
  const toggle = () => (closed.value = isOpen ? [...closed.value, title] : closed.value.filter((one) => one !== title));
  const isHere = route.value.view === view && !route.value.path;
  return (
    <li class="group">
      <div class="head">
        {rows.length ? (
          <Button class="fold" aria-expanded={isOpen} aria-label={`Files: ${title}`} act={toggle}>
            {isOpen ? "▾" : "▸"}
          </Button>
        ) : (
          <span class="fold" />
        )}
        {view ? (
          <a href={link(view)} aria-current={isHere ? "page" : undefined}>
            {title}
          </a>
        ) : (
          <span>{title}</span>
        )}
        <span class="count">{rows.length || ""}</span>
      </div>
      {isOpen && rows.length > 0 && (
        <ul class={title === "Catalogue" ? "" : "files"}>
          {rows.slice(0, MOST).map((row) => (
            <li key={row.path}>
              <ObjectLink {...row} />
            </li>
          ))}
          {rows.length > MOST && <li class="note">{rows.length - MOST} more: search for them.</li>}
        </ul>
      )}
    </li>
  );
}

export function Tree() {
  const folder = studies.value;
  if (!isShown.value) return null;
  const word = search.value.toLowerCase();
  const isIn = ({ path, title = "" }: ListedObject) => `${path}\n${title}`.toLowerCase().includes(word);
  const groups = GROUPS.map(({ title, view, kinds }) => ({ title, view, rows: filesOf(...kinds).filter(isIn) }));
  const catalogue = folder?.catalogue.filter(isIn).map((one) => ({ ...one, view: "simulate" }));
  return (
    <nav class="tree" aria-label="Folder">
      <p class="top">
        <a class="home" href={link("studies")} aria-current={route.value.view === "studies" ? "page" : undefined}>
          Overview
        </a>
        <Button class="icon" title="Read the folder again" act={() => list()}>
          <span aria-hidden="true">↻</span>
          <span class="hidden">Read the folder again</span>
        </Button>
      </p>
      <input
        type="search"
        aria-label="Search files"
        placeholder="Search"
        value={search.value}
        onInput={(event) => (search.value = event.currentTarget.value)}
      />
      <ul>
        {groups.map(
          (group) => (group.rows.length > 0 || (group.view && !word)) && <Group key={group.title} {...group} />,
        )}
        {catalogue && <Group title="Catalogue" view="" rows={catalogue} />}
      </ul>
      <label class="drop">
        <span class="button">Add own data</span> or drop it anywhere
        <AddFiles />
      </label>
      <p class="note" role="status">
        {taking.value}
      </p>
      {folder && (
        <p class="note">
          {folder.files.length} files
          {folder.left_out > 0 && `; ${folder.left_out} names are not UTF-8 and are left out`}
          {folder.is_cut && "; those beyond are not listed: start pneudrive web in a folder below"}
        </p>
      )}
    </nav>
  );
}
