/** View of recordings: any part at any length, shaded strokes, and a wizard for the layout. */

import { batch, computed, signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { type Curve, curveOf, Plot, pixelsOfPlots } from "../plots/plot";
import { link, route } from "../routes";
import type { Frame, Numbers } from "../server/frame";
import type { WindowHead as Head, OpenedRecording as Opened, Problem, Proposal, Strokes } from "../server/generated";
import { ask, attempts, frame, problemsOf, read, useAnswer, useLive, write } from "../server/server";
import { Button, Remarks, Table, Tick, Ticks } from "../workspace/fields";
import { folderOf, list, nameOf, studies } from "../workspace/files";
import { JobForm } from "../workspace/jobs";
import { Problems } from "../workspace/parts";
import { Answer, useView } from "../workspace/result";
import * as measure from "./measure";

const MOST_PLOTS = 4; // to begin with
const MOST_ANSWERED = 500_000; // samples of a recording that is read once more for its answer
const LOOK_MS = 1000; // at one that is shown
const MOST_LOAD = 0.2; // fraction of the time for reading a file that keeps changing

const about = signal<Opened | null>(null); // the version that is shown
const file = signal<Opened>({}); // the file as it is now: as far as it is read, or with problems
const { moved } = measure;
const shown = signal<string[]>([]);
const span = signal<[number, number]>([0, 1]);
const views = signal<Frame<Head> | null>(null);
const wrong = signal<Problem[]>([]); // with the view that was asked for
const proposals = signal<Record<string, Proposal | undefined>>({}); // the last one of each recording, with what was typed into it
const [refused, attempt] = attempts(); // of a layout: said beside its button

const marks = computed(() => measure.marksOf(moved.value.faults));

let wake = () => {};
const rested = (ms: number) => new Promise<void>((resolve) => setTimeout((wake = resolve), ms));

/** Open a recording, and check its file again while it is shown. The file may grow, be replaced, or be half written. */
async function open(path: string, isGone: () => boolean): Promise<void> {
  batch(() => {
    about.value = views.value = null;
    file.value = {};
    moved.value = measure.UNMOVED;
    wrong.value = refused.value = [];
    measure.forgetBeside();
  });
  for (let began = performance.now(); !isGone(); ) {
    const now = await read<Opened>("/api/recording", { path }).catch(problemsOf);
    if (isGone()) return;
    file.value = Array.isArray(now) ? { problems: now } : now;
    if (Array.isArray(now)) return;
    if (now.channels && now.key !== about.value?.key) await put(now, path, isGone);
    else if (now.channels && (wrong.value.length || isOwed)) about.value = now; // the same view is asked for again
    if (now.share !== undefined) await rested(measure.READ_MS);
    else {
      await rested(Math.max(LOOK_MS, (performance.now() - began) / MOST_LOAD));
      began = performance.now();
    }
  }
}

/** Show a version with its strokes and faults. The first one appears at once, later ones together with both. */
async function put(found: Opened, path: string, isGone: () => boolean): Promise<void> {
  if (!about.value) show(found);
  const { UNMOVED } = measure;
  const unread = (error: unknown) => ({ ...UNMOVED, problems: problemsOf(error) });
  const isMoved = found.layout !== null || found.time;
  const strokes = isMoved ? await read<Strokes>("/api/strokes", { path }).catch(unread) : UNMOVED;
  if (isGone()) return;
  batch(() => {
    show(found);
    moved.value = strokes;
  });
}

/** Show a version over its whole duration. A recording that has grown keeps its view. */
function show(version: Opened): void {
  const before = about.value;
  const [[from, to], [low, high]] = [span.value, version.span!];
  const names = (of: Opened | null) => JSON.stringify([of?.time, of?.channels]);
  const isAlike = names(before) === names(version);
  const isZoomed = isAlike && (from > before!.span![0] || to < before!.span![1]) && from < high && to > low;
  batch(() => {
    about.value = version;
    wrong.value = [];
    if (!isAlike) {
      const named = version.channels!.filter((one) => one.unit); // by the layout, or by the file itself
      shown.value = (named.length ? named : version.channels!).slice(0, MOST_PLOTS).map((one) => one.column);
      views.value = null;
      measure.forgetBeside();
    }
    look(isZoomed ? [from, to] : [low, high]);
  });
}

/** Show another part of the recording. */
function look(next: [number, number]): void {
  const [low, high] = about.value!.span!;
  const width = Math.min(next[1] - next[0], high - low);
  const from = Math.min(Math.max(next[0], low), high - width);
  span.value = [from, from + width];
}

/** Request for the server. It uses the socket, because a separate HTTP request costs some ms more. */
const asked = computed(() => {
  if (!about.value) return null;
  const [from, to] = span.value;
  return {
    what: "window",
    path: route.value.path,
    key: about.value.key,
    from,
    to,
    pixels: pixelsOfPlots(innerWidth), // the first view comes before its plots
    columns: shown.value.join("\n"),
    ...measure.besideAsked(),
  };
});

let isOwed = false; // a view that was asked for

function take(frame: Frame<Head>): void {
  const { head } = frame;
  isOwed = head.key === null;
  if (head.problems) wrong.value = head.problems;
  else if (isOwed)
    wake(); // another file has its name now
  else if (head.path === asked.value?.path && head.key === asked.value.key) {
    wrong.value = [];
    views.value = frame;
    document.documentElement.dataset.points = String(frame.arrays.get("time")!.length);
  }
}

/** Show a part as wide as the present one times a factor, moved by a share of it. */
function move(factor: number, share = 0): void {
  const [from, to] = span.value;
  const [middle, half] = [0.5 * (from + to) + share * (to - from), 0.5 * factor * (to - from)];
  look([middle - half, middle + half]);
}

export default function RecordingView() {
  const { path } = route.value;
  useLive<Head>(() => asked.value, take);
  const found = about.value;
  const view = useView(found?.layout && found.samples! < MOST_ANSWERED ? path : "", found?.key);
  useEffect(() => {
    let isGone = false;
    void open(path, () => isGone);
    return () => void (isGone = true);
  }, [path]);
  const unread = file.value.problems ?? [];
  const why = foreignTo(found);
  const wizard = <Wizard path={path} foreignTo={why} />;
  return (
    <div class="recording">
      <h2>{path}</h2>
      <Problems of={[...unread, ...wrong.value, ...(why ? [] : (moved.value.problems ?? []))]} />
      {why && wizard}
      {!found && !unread.length && (
        <p role="status">
          The file is read for the first time.{" "}
          <progress aria-label="Read so far" value={file.value.share ?? 0} max={1} />
        </p>
      )}
      {found && (
        <>
          {view && <Answer view={view} />}
          <Controls found={found} />
          <div class="result">
            <div>
              <Plots found={found} />
              <Spectrum found={found} path={path} />
            </div>
            <aside class="panel">
              <Remarks of={[...(why ? [] : found.notes!), moved.value.note ?? ""].filter(Boolean)} />
              <Ticks
                legend="Channels"
                options={found.channels!.map((one): [string, string] => [one.column, one.label])}
                chosen={shown.value}
                put={(columns) => (shown.value = columns)}
              />
              <measure.FaultsLine span={span.value} whole={found.span!} onShow={look} />
              <measure.BesideRecording path={path} onShow={look} />
              <measure.Measuring
                path={path}
                version={found.key!}
                columns={shown.value}
                span={span.value}
                isTimed={found.time!}
              />
            </aside>
          </div>
        </>
      )}
      {(found || unread.length > 0) && !why && wizard}
      {found?.layout === "rig" && !why && (
        <section aria-label="Friction">
          <h2>Friction of this recording</h2>
          <JobForm kind="characterise" start={{ recordings: [path], name: nameOf(path).replace(/\..*$/, "") }} />
        </section>
      )}
    </div>
  );
}

const FOREIGN = /^the layout does not fit this file: (.*?)(; |$)/;

/** Return why the layout of the folder belongs to other files; empty if it fits. */
const foreignTo = (found: Opened | null): string =>
  found?.notes?.flatMap((one) => FOREIGN.exec(one)?.[1] ?? [])[0] ?? "";

function Controls({ found }: { found: Opened }) {
  const [from, to] = span.value;
  const head = views.value?.head;
  const { strokes } = moved.value;
  const again = file.value.share; // of the file as it is now, where another one is shown
  return (
    <p class="row" role="group" aria-label="View">
      <Button act={() => look(found.span!)}>Whole recording</Button>
      <Button act={() => move(0.5)}>Closer</Button>
      <Button act={() => move(2)}>Wider</Button>
      <Button act={() => move(1, -0.5)}>Earlier</Button>
      <Button act={() => move(1, 0.5)}>Later</Button>
      <span role="status" data-from={from} data-to={to}>
        {found.time
          ? `${measure.told(from, span.value)} s to ${measure.told(to, span.value)} s`
          : `sample ${Math.round(from)} to ${Math.round(to)}`}
        {head && `, ${head.samples.toLocaleString("en")} of ${found.samples!.toLocaleString("en")} samples`}
        {head && !head.raw && ", lowest and highest of each pixel"}
        {head && head.missing > 0 && `, ${head.missing} values are not numbers, or beyond 3e38`}
        {again !== undefined && `, the file was replaced: ${Math.round(100 * again)} % read`}
        {strokes.length > 0 && `, ${strokes.length} strokes (darker: towards +x)`}
      </span>
    </p>
  );
}

const isSpectral = signal(false);
const QUIET_MS = 200; // without a change of the view, before its spectra are requested

/** Spectra of the shown channels within the view. They are not requested while the view moves. */
function Spectrum({ found, path }: { found: Opened; path: string }) {
  const [from, to] = span.value;
  const columns = shown.value.join("\n");
  const [spectra, problems] = useAnswer(
    isSpectral.value ? path : "",
    () => frame("/api/spectrum", { path, from: String(from), to: String(to), columns }),
    [found.key, from, to, columns],
    QUIET_MS,
  );
  const drawn = spectra?.arrays;
  const channels = found.channels!.filter(({ column }) => drawn?.has(`hz/${column}`));
  return (
    <section aria-label="Spectrum">
      <p class="row">
        <Tick label="spectrum of the view" of={isSpectral} />
        {isSpectral.value && (
          <span class="note">
            Amplitude density, Welch, Hann windows of at most 16384 samples; its square, integrated over frequency, is
            the variance.
          </span>
        )}
      </p>
      <Problems of={problems} />
      {drawn && (
        <div class="plots">
          {channels.map(({ column, label, unit }) => (
            <Plot
              key={column}
              title={`Spectrum of ${label}`}
              unit={`${unit || "1"}/√Hz`}
              xUnit="Hz"
              size={1}
              curves={[{ label, x: drawn.get(`hz/${column}`)!, y: drawn.get(`density/${column}`)! }]}
            />
          ))}
        </div>
      )}
    </section>
  );
}

/** Read all samples of a channel in the view, and save them. */
function saveSamples(column: string, save: (all: Map<string, Numbers>) => void): Promise<void> {
  const [from, to] = span.value;
  const given = { path: route.value.path, from: String(from), to: String(to), columns: column };
  return attempts(wrong)[1](async () => save((await frame("/api/samples", given)).arrays));
}

function Plots({ found }: { found: Opened }) {
  const now = views.value;
  if (!now) return null;
  const [from, to] = span.value;
  const { head, arrays } = now;
  const drawn = found.channels!.filter(({ column }) => arrays.has(column) && shown.value.includes(column));
  return (
    <div class="plots" data-plots aria-busy={head.from !== from || head.to !== to}>
      {drawn.map((one, k) => {
        const curves: Curve[] = [curveOf(arrays, arrays.get("time")!, one.column, one.label)];
        if (measure.beside.value && arrays.has(`beside/${one.column}`)) {
          const label = `${one.label} (${measure.beside.value.path})`;
          curves.push(curveOf(arrays, arrays.get("beside/time")!, `beside/${one.column}`, label));
        }
        return (
          <Plot
            key={one.column}
            title={one.label}
            unit={one.unit}
            xUnit={found.time ? "s" : "samples"}
            size={1}
            curves={curves}
            bare={k < drawn.length - 1}
            range={[head.from, head.to]}
            onReset={from > found.span![0] || to < found.span![1] ? () => look(found.span!) : undefined}
            shades={moved.value.strokes}
            marks={marks.value}
            cursors={measure.cursors.value ?? undefined}
            onPick={measure.pick}
            extreme={!head.raw}
            samples={(save) => saveSamples(one.column, save)}
            onZoom={(from, to) => look([from, to])}
          />
        );
      })}
    </div>
  );
}

/**
 * Form that proposes a layout, lets the user correct it, and writes it next to the recording. If the layout of the folder
 * belongs to other files, `foreignTo` says why.
 */
function Wizard({ path, foreignTo: why }: { path: string; foreignTo: string }) {
  const place = [folderOf(path), "layout.toml"].filter(Boolean).join("/");
  const now = proposals.value[path];
  const own = nameOf(path).replace(/\..*$/, "");
  const isOther = why !== ""; // its layout goes into a folder of its own
  const others = studies.value?.files.find((one) => one.kind === "layout" && path.startsWith(folderOf(one.path)));
  const layout = about.value?.layout;
  if (layout === "own names") return <p class="note">Its columns have the names of pneudrive: it needs no layout.</p>;
  if (layout && !isOther)
    return <p class="note">The layout of the folder names its columns: a recording of a {layout.replace("-", " ")}.</p>;
  const put = (one?: Proposal) => (proposals.value = { ...proposals.value, [path]: one });
  const propose = () => attempt(async () => put(await read<Proposal>("/api/propose", { path })));
  const accept = () =>
    attempt(async () => {
      const { text } = now!;
      const own = isOther
        ? await ask<{ path: string }>("/api/own-layout", { path, text })
        : await write(place, text, "");
      put();
      await list();
      if ("path" in own) location.hash = link("recording", own.path);
      else wake(); // the file has a layout now
    });
  return (
    <section class={isOther ? "problem" : ""} aria-label={isOther ? "Layout of other files" : "Layout"}>
      {isOther && (
        <p>
          The layout in this folder belongs to other files: {why}.{" "}
          {others && (
            <>
              If it should hold for this file too, <a href={link("drive", others.path)}>edit {others.path}</a>.
            </>
          )}
        </p>
      )}
      <p class="row">
        <Button class={isOther ? "primary" : ""} act={() => propose()}>
          {isOther ? "Propose a layout for this file" : "Propose a layout"}
        </Button>
        <span>
          A layout gives the meaning, unit and sign of each column. With a layout, strokes are found and friction can be
          characterised.
        </span>
      </p>
      <Problems of={refused.value} />
      {now && (
        <>
          <p>
            {now.problem
              ? `Not read yet: ${now.problem}. Correct the lines marked guess.`
              : `A recording of a ${now.kind}: ${now.strokes} strokes.`}
          </p>
          <Table
            label="Columns"
            heads={["Channel", "Column", "Unit", "Why"]}
            rows={now.guesses.map((one) => [one.role, one.column, one.unit, one.why])}
          />
          <label>
            Text of the layout; lines marked guess are to be checked
            <textarea
              class="text"
              rows={16}
              value={now.text}
              onInput={(event) => put({ ...now, text: event.currentTarget.value })}
            />
          </label>
          <p>
            <Button act={() => accept()}>
              {isOther ? `Accept: move the file into ${own}/ with this layout` : `Accept: write ${place}`}
            </Button>
          </p>
        </>
      )}
    </section>
  );
}
