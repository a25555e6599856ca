/** The folder: its files, their kinds, and copies into it. */
import { signal } from "@preact/signals";
import { inCatalogue, link } from "../routes";
import type { Listed, Problem, Studies } from "../server/generated";
import { drop, isAnswering, pause, problemsOf, Refused, read } from "../server/server";

/** Kinds of files, and the view that lists them. */
export const GROUPS: { title: string; view: string; kinds: string[] }[] = [
  { title: "Drives", view: "drive", kinds: ["drive", "circuit"] },
  { title: "Recordings", view: "recording", kinds: ["recording"] },
  { title: "Friction", view: "friction", kinds: ["friction map", "fit"] },
  { title: "Validations", view: "validation", kinds: ["validation"] },
  { title: "Sizings", view: "sizing", kinds: ["task", "sizing"] },
  { title: "Campaigns", view: "campaign", kinds: ["campaign", "protocol"] },
  { title: "Controllers", view: "control", kinds: ["comparison", "controller", "setup"] },
  { title: "Exports", view: "handover", kinds: ["fmu"] },
  { title: "Other files", view: "", kinds: ["layout", "rig", "formula", "tank", "regulator", "other", "unreadable"] },
];
declare const __BUILD__: string;

export const studies = signal<Studies | null>(null);
export const isOld = signal(false);

let listing: Promise<void> | null = null;

/** Read the folder. */
export function list(): Promise<void> {
  const reading = readFolder("").finally(() => (listing = listing === reading ? null : listing));
  return (listing = reading);
}

/** Wait until the folder is read, without a second reading. */
export const listed = (): Promise<void> => listing ?? list();

let [readings, shown] = [0, 0]; // numbers of the last reading, and of that which is shown

/** Read the folder, unless it still has the known state. An older answer does not replace a newer one. */
async function readFolder(state: string): Promise<void> {
  const reading = ++readings;
  try {
    const folder = await read<Studies>("/api/studies", { state });
    if (folder.state === state || reading < shown) return;
    shown = reading;
    countChanges(folder.files);
    studies.value = folder;
    isOld.value = folder.build !== __BUILD__;
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    if (error.status) refused.value = error.problems; // a server that is gone has a line of its own
  }
}

const changes = signal<Record<string, number>>({});

/** Return how often a file has changed since the page read the folder first. */
export const changesOf = (path: string): number => changes.value[path] ?? 0;

function countChanges(files: Listed[]): void {
  const before = new Map(studies.peek()?.files.map((file) => [file.path, file]));
  const isOther = ({ path, changed, size }: Listed) =>
    before.has(path) && (before.get(path)!.changed !== changed || before.get(path)!.size !== size);
  const others = files.filter(isOther).map(({ path }) => [path, (changes.peek()[path] ?? 0) + 1]);
  if (others.length) changes.value = { ...changes.peek(), ...Object.fromEntries(others) };
}

const WATCH_MS = 2000;
const REST = 10; // pause per time of an answer: a folder of very many files is read less often

/** Follow the folder while this tab is visible. */
export async function watchFolder(): Promise<void> {
  for (let rest = WATCH_MS; ; ) {
    await pause(rest);
    if (document.visibilityState !== "visible" || !isAnswering() || listing) continue;
    const start = performance.now();
    await readFolder(studies.peek()?.state ?? "");
    rest = Math.max(WATCH_MS, REST * (performance.now() - start));
  }
}

export const taking = signal("");
export const refused = signal<Problem[]>([]);

let copying = Promise.resolve();

/** Copy files into the folder one after the other, including files that arrive meanwhile. */
export function take(files: File[]): Promise<void> {
  if (!taking.value) refused.value = [];
  return (copying = copying.then(() => copyIn(files)));
}

/** Copy files into the folder. A single recording is opened. */
async function copyIn(files: File[]): Promise<void> {
  if (!files.length) return;
  for (const [index, file] of files.entries()) {
    taking.value = `Copying ${file.name} (${index + 1} of ${files.length}).`;
    await drop(file).catch((error) => (refused.value = [...refused.value, ...problemsOf(error)]));
  }
  taking.value = "";
  await list();
  const own = studies.value?.files.find((one) => one.path === files[0]!.name);
  if (files.length === 1 && own?.kind === "recording" && !refused.value.length)
    location.hash = link("recording", own.path);
  else location.hash = link("studies");
}

/** Accept files that are dropped anywhere on the page. */
export function takeDrops(): void {
  const isFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
  addEventListener("dragover", (event) => isFiles(event) && event.preventDefault());
  addEventListener("drop", (event) => {
    if (!isFiles(event)) return;
    event.preventDefault();
    void take([...event.dataTransfer!.files]);
  });
}

/** Files of some kinds in the folder. */
export const filesOf = (...kinds: string[]): Listed[] =>
  (studies.value?.files ?? []).filter((one) => kinds.includes(one.kind));

export const pathsOf = (...kinds: string[]): string[] => filesOf(...kinds).map((one) => one.path);

export const cataloguePaths = (): string[] => (studies.value?.catalogue ?? []).map((one) => one.path);

/** Return a name that is not in use: the name itself, or with the next number. */
export function freeName(name: string, used: (string | undefined)[]): string {
  if (!used.includes(name)) return name;
  const base = name.replace(/-\d+$/, "");
  for (let number = 2; ; number++) if (!used.includes(`${base}-${number}`)) return `${base}-${number}`;
}

/** Return the kind of an object. Empty while the folder is not read, or for a missing file. */
export const kindOf = (path: string): string =>
  inCatalogue(path) ? "drive" : (studies.value?.files.find((one) => one.path === path)?.kind ?? "");

/** The name of a file in its folder. */
export const nameOf = (path: string): string => path.slice(path.lastIndexOf("/") + 1);

/** The folder of a file. Empty for a file of the workspace itself. */
export const folderOf = (path: string): string => path.slice(0, Math.max(path.lastIndexOf("/"), 0));
