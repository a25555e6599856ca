/** The folder as a tree: files by kind, the catalogue, and starting points. */

import { signal } from "@preact/signals";
import { link, route } from "../routes";
import { viewOf } from "../views";
import { filesOf, GROUPS, list, nameOf, studies, take, taking } from "./files";

const MOST = 200; // rows of a group; the search finds the others

const search = signal("");
const closed = signal<string[]>(["Catalogue"]);
/** Whether the tree lies above the view, not beside it. */
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

function Row({ path, view, title = "" }: { path: string; view: string | undefined; title?: string }) {
  const isHere = route.value.path === path;
  return (
    <li>
      {view ? (
        <a href={link(view, path)} aria-current={isHere ? "page" : undefined} title={title || path}>
          <PathName path={path} />
        </a>
      ) : (
        <span title={path}>
          <PathName path={path} />
        </span>
      )}
    </li>
  );
}

function Group({
  title,
  view,
  rows,
}: {
  title: string;
  view: string;
  rows: { path: string; view: string | undefined; title?: string }[];
}) {
  const isOpen = Boolean(search.value) || !closed.value.includes(title);
  const toggle = () => (closed.value = isOpen ? [...closed.value, title] : closed.value.filter((one) => one !== title));
  return (
    <li class="group">
      <div class="head">
        {rows.length ? (
          <button type="button" class="fold" aria-expanded={isOpen} aria-label={`Files: ${title}`} onClick={toggle}>
            {isOpen ? "▾" : "▸"}
          </button>
        ) : (
          <span class="fold" />
        )}
        {view ? (
          <a href={link(view)} aria-current={route.value.view === view && !route.value.path ? "page" : undefined}>
            {title}
          </a>
        ) : (
          <span>{title}</span>
        )}
        <span class="count">{rows.length || ""}</span>
      </div>
      {isOpen && rows.length > 0 && (
        <ul class={title === "Catalogue" ? "" : "files"}>
          {rows.slice(0, MOST).map((one) => (
            <Row key={one.path} {...one} />
          ))}
          {rows.length > MOST && <li class="note">{rows.length - MOST} more: search for them.</li>}
        </ul>
      )}
    </li>
  );
}

export function Tree() {
  const found = studies.value;
  if (!isShown.value) return null;
  const word = search.value.toLowerCase();
  const isIn = (...texts: string[]) => texts.some((one) => one.toLowerCase().includes(word));
  return (
    <nav class="tree" aria-label="Folder">
      <p class="top">
        <a class="home" href={link("studies")} aria-current={route.value.view === "studies" ? "page" : undefined}>
          Overview
        </a>
        <button type="button" class="icon" title="Read the folder again" onClick={() => void list()}>
          <span aria-hidden="true">↻</span>
          <span class="hidden">Read the folder again</span>
        </button>
      </p>
      <input
        type="search"
        aria-label="Search files"
        placeholder="Search"
        value={search.value}
        onInput={(event) => (search.value = event.currentTarget.value)}
      />
      <ul>
        {GROUPS.map(({ title, view, kinds }) => {
          const rows = filesOf(...kinds)
            .filter((one) => isIn(one.path))
            .map(({ path, kind }) => ({ path, view: viewOf(kind) }));
          return (rows.length > 0 || (view && !word)) && <Group key={title} title={title} view={view} rows={rows} />;
        })}
        {found && (
          <Group
            title="Catalogue"
            view=""
            rows={found.catalogue
              .filter((one) => isIn(one.path, one.title))
              .map((one) => ({ ...one, view: "simulate" }))}
          />
        )}
      </ul>
      <label class="drop">
        <span class="button">Add own data</span> or drop it anywhere
        <input
          type="file"
          multiple
          class="hidden"
          onChange={({ currentTarget: own }) => (void take([...(own.files ?? [])]), (own.value = ""))}
        />
      </label>
      <p class="note" role="status">
        {taking.value}
      </p>
      {found && (
        <p class="note">
          {found.files.length} files{found.left_out > 0 && `; ${found.left_out} names are not UTF-8 and are left out`}
          {found.is_cut && "; those beyond are not listed: start pneudrive web in a folder below"}
        </p>
      )}
    </nav>
  );
}
