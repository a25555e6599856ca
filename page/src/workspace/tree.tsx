/** The folder as a tree: files by kind, the catalogue, and starting points. */

import { signal } from "@preact/signals";
import { link, route } from "../routes";
import { viewOf } from "../views";
import { Button } from "./fields";
import { filesOf, GROUPS, kindOf, list, nameOf, studies, take, taking } from "./files";

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
