/** Ctrl K: one field finds files, values and actions, and runs the chosen entry. */
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { opened, save, valid } from "../drive/opened";
import { future, link, past, route, step } from "../routes";
import { verbsOf, viewOf } from "../views";
import { EXAMPLE, openExample, openTask } from "./choose";
import { GROUPS, kindOf, list, studies } from "./files";

interface Entry {
  kind: "File" | "Value" | "Action";
  title: string;
  note?: string;
  run: () => unknown;
}

const MOST_SHOWN = 50;
const WAIT_MS = 5000; // for a view that is loaded, and its answer

const go =
  (view: string, path = "") =>
  () =>
    (location.hash = link(view, path));

type Named = [title: string, run: () => unknown];

function actions(): Entry[] {
  const { view, path } = route.value;
  const description = opened.value;
  const verbs = path ? verbsOf(view, kindOf(path)) : [];
  const all: [title: string, run: () => unknown, isShown?: boolean][] = [
    ...verbs.map((one): Named => [`${one.title}: ${path}`, go(one.name, path)]),
    [`Save ${path}`, () => save(path), description?.path === path && description.text !== description.saved],
    ["Undo", () => step(past, future), past.value.length > 0],
    ["Redo", () => step(future, past), future.value.length > 0],
    ["Copy the address of this view", () => navigator.clipboard.writeText(location.href)],
    ["New study: start with a task", openTask],
    ["New study: use example recordings", openExample],
    ["New study: open an example drive", go("simulate", EXAMPLE)],
    ["Read the folder again", list],
    ["Reload the page", () => location.reload()],
    ["Overview", go("studies")],
    ...GROUPS.filter((one) => one.view).map((one): Named => [`All ${one.title.toLowerCase()}`, go(one.view)]),
  ];
  return all.flatMap(([title, run, isShown = true]) => (isShown ? { kind: "Action" as const, title, run } : []));
}

/** Values of the open description, and the leading values of the shown result. */
function values(): Entry[] {
  const { view, path } = route.value;
  const fields = opened.value?.path === path && !opened.value.isTask ? (valid.value?.values ?? []) : [];
  const leading = [...document.querySelectorAll<HTMLElement>("main [data-leading]")];
  const textOf = (of: HTMLElement, part: string) => of.querySelector(part)?.textContent ?? "";
  return [
    ...fields.map(({ key, text }): Entry => {
      const slider = view === "simulate" && document.getElementById(`slider-${key}`);
      const inDrive = () => (go("drive", path)(), void showLater(`main [aria-label="${key}"]`));
      return { kind: "Value", title: key, note: text, run: slider ? () => show(slider) : inDrive };
    }),
    ...leading.map((one): Entry => {
      return { kind: "Value", title: textOf(one, "dt"), note: textOf(one, "dd"), run: () => show(one) };
    }),
  ];
}

function files(): Entry[] {
  const entry = (path: string, note: string, view: string): Entry => {
    return { kind: "File", title: path, note, run: go(view, path) };
  };
  const listed = (studies.value?.files ?? []).filter((one) => viewOf(one.kind));
  return [
    ...listed.map(({ path, kind }) => entry(path, kind, viewOf(kind)!)),
    ...(studies.value?.catalogue ?? []).map(({ path, title }) => entry(path, title, "simulate")),
  ];
}

/** Move to an element, and unfold the sections around it. */
function show(element: HTMLElement): void {
  for (let at = element.closest("details"); at; at = at.parentElement!.closest("details")) at.open = true;
  if (element.tabIndex < 0) element.tabIndex = -1;
  element.focus({ preventScroll: true });
  element.scrollIntoView({ block: "center" });
}

async function showLater(selector: string): Promise<void> {
  for (const end = performance.now() + WAIT_MS; performance.now() < end; ) {
    await new Promise(requestAnimationFrame);
    const element = document.querySelector<HTMLElement>(selector);
    if (element) return show(element);
  }
}

/** Return the entries with all words of a text, first those whose name begins with it. */
export function matching<T extends { title: string; note?: string }>(entries: T[], text: string): T[] {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const places = entries.flatMap((entry) => {
    const [title, all] = [entry.title.toLowerCase(), `${entry.title} ${entry.note ?? ""}`.toLowerCase()];
    if (!words.every((word) => all.includes(word))) return [];
    const at = title.lastIndexOf("/") + 1;
    return { entry, rank: title.startsWith(words[0] ?? "", at) ? 0 : title.includes(words[0]!) ? 1 : 2 };
  });
  return places.sort((a, b) => a.rank - b.rank).map(({ entry }) => entry);
}

export default function Palette({ close }: { close: () => void }) {
  const dialog = useRef<HTMLDialogElement>(null);
  const [text, setText] = useState("");
  const [at, setAt] = useState(0);
  const entries = useMemo(() => [...actions(), ...values(), ...files()], []);
  const found = matching(entries, text);
  const shown = found.slice(0, MOST_SHOWN);
  useEffect(() => dialog.current!.showModal(), []);
  useEffect(() => document.getElementById(`found-${at}`)?.scrollIntoView({ block: "nearest" }), [at]);
  const run = (entry: Entry | undefined) => {
    if (!entry) return;
    dialog.current!.close();
    void entry.run();
  };
  const keys = (event: KeyboardEvent) => {
    const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (by && shown.length) setAt((at + by + shown.length) % shown.length);
    else if (event.key === "Enter") run(shown[at]);
    else return;
    event.preventDefault();
  };
  return (
    <dialog ref={dialog} class="palette" aria-label="Find files, values and actions" onClose={close}>
      <input
        role="combobox"
        aria-label="Find files, values and actions"
        aria-expanded="true"
        aria-controls="found"
        aria-autocomplete="list"
        aria-activedescendant={shown.length ? `found-${at}` : undefined}
        placeholder="Find a file, a value or an action"
        value={text}
        onInput={(event) => (setText(event.currentTarget.value), setAt(0))}
        onKeyDown={keys}
      />
      <div id="found" role="listbox" aria-label="Found">
        {shown.map((entry, index) => (
          <div
            key={`${entry.kind} ${entry.title}`}
            id={`found-${index}`}
            role="option"
            tabIndex={-1}
            aria-selected={index === at}
            onKeyDown={keys}
            onClick={() => run(entry)}>
            <span class="kind">{entry.kind}</span> <b>{entry.title}</b> <span class="note">{entry.note}</span>
          </div>
        ))}
        {!shown.length && (
          <div role="option" aria-selected="false" aria-disabled="true" tabIndex={-1}>
            Nothing has these words.
          </div>
        )}
      </div>
      <p class="note" role="status">
        {found.length > MOST_SHOWN ? `The first ${MOST_SHOWN} of ${found.length}.` : `${found.length} found.`} Arrow
        keys select, Enter opens, Escape closes.
      </p>
    </dialog>
  );
}
