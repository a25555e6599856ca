/** View of recordings: any part at any length, shaded strokes, and a wizard for the layout. */

import { batch, computed, signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { digits } from "../plots/looks";
import type { Shade } from "../plots/paint";
import { type Curve, Plot, pixelsOfPlots } from "../plots/plot";
import { link, route } from "../routes";
import type { Frame, Numbers } from "../server/frame";
import type { WindowHead as Head, OpenedRecording as Opened, Problem, Proposal, Strokes } from "../server/generated";
import { ask, attempts, frame, problemsOf, Refused, read, useAnswer, useLive, write } from "../server/server";
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

const about = signal<Opened | null>(null);
const shown = signal<string[]>([]);
const span = signal<[number, number]>([0, 1]);
const pixels = signal(1000);
const views = signal<{ head: Head; time: Numbers; channels: Map<string, Numbers> } | null>(null);
const NONE: Strokes = { strokes: [], faults: {} };
const moved = signal(NONE); // strokes and faults, with a note why neither is shown
const unmoved = signal<Problem[]>([]); // why they could not be read
const wrong = signal<Problem[]>([]); // with the view that was asked for
const unread = signal<Problem[]>([]); // with the file as it is now
const again = signal<number | null>(null); // share that is read of the file as it is now, where another one is shown
const turn = signal(0); // of asking for the same view
const proposal = signal<Proposal | null>(null);
const proposals = new Map<string, Proposal>(); // of each recording the last one, with what was typed into it
const said = signal("");
const [refused, attempt] = attempts(); // of a layout or of what is to be characterised: said beside its button

const shades = computed<Shade[]>(() =>
  moved.value.strokes.map(({ from, to, direction }) => ({ from, to, strong: direction > 0 })),
);

const marks = computed(() => measure.marksOf(moved.value.faults));

let generation = 0;
let wake = () => {};
const rested = (ms: number) => new Promise<void>((resolve) => setTimeout((wake = resolve), ms));

/** Open a recording, and check its file again while it is shown. The file may grow, be replaced, or be half written. */
async function open(path: string): Promise<void> {
  const mine = ++generation;
  const isGone = () => mine !== generation;
  about.value = views.value = again.value = null;
  proposal.value = proposals.get(path) ?? null;
  moved.value = NONE;
  unread.value = wrong.value = refused.value = unmoved.value = [];
  said.value = "";
  measure.forgetBeside();
  for (let began = performance.now(), rest = 0; !isGone(); ) {
    try {
      const found = await read<Opened>("/api/recording", { path });
      if (isGone()) return;
      if (found.channels && found.key !== keyShown()) await put(found, path, isGone);
      else stay(found);
      rest = found.share === undefined ? Math.max(LOOK_MS, (performance.now() - began) / MOST_LOAD) : measure.READ_MS;
    } catch (error) {
      const problems = problemsOf(error);
      if (!isGone()) unread.value = problems;
      return;
    }
    await rested(rest);
    if (rest !== measure.READ_MS) began = performance.now();
  }
}

const keyShown = () => about.value?.key;

/** Keep the recording that is shown, and report the state of its file. */
function stay(found: Opened): void {
  unread.value = found.problems ?? [];
  if (keyShown()) again.value = found.share ?? null;
  else if (!found.problems) about.value = found;
  if (found.channels && (wrong.value.length || isOwed)) turn.value += 1;
}

/** Show a recording with its strokes and faults. The first recording appears at once, later ones together with both. */
async function put(found: Opened, path: string, isGone: () => boolean): Promise<void> {
  const before = keyShown() ? about.value! : undefined;
  if (!before) show(found);
  const isMoved = found.layout !== null || found.time;
  const answer = isMoved ? await read<Strokes>("/api/strokes", { path }).catch(problemsOf) : NONE;
  if (isGone()) return;
  batch(() => {
    if (before) show(found, before);
    [moved.value, unmoved.value] = Array.isArray(answer) ? [NONE, answer] : [answer, []];
    if (before) measure.realign(moved.value.strokes);
  });
}

/** Show a new recording over its whole duration. A recording that has grown keeps its view. */
function show(found: Opened, before?: Opened): void {
  const [from, to] = span.value;
  const names = (of?: Opened) => JSON.stringify([of?.time, of?.channels]);
  const isAlike = names(before) === names(found);
  const isZoomed =
    isAlike && (from > before!.span![0] || to < before!.span![1]) && from < found.span![1] && to > found.span![0];
  batch(() => {
    about.value = found;
    unread.value = wrong.value = [];
    again.value = null;
    if (!isAlike) {
      const named = found.channels!.filter((one) => one.unit); // by the layout, or by the file itself
      shown.value = (named.length ? named : found.channels!).slice(0, MOST_PLOTS).map((one) => one.column);
      views.value = null;
      measure.forgetBeside();
    }
    look(isZoomed ? [from, to] : found.span!);
  });
}

/** Show another part of the recording. */
function look(next: [number, number]): void {
  const [low, high] = about.value!.span!;
  const width = Math.min(next[1] - next[0], high - low);
  const from = Math.min(Math.max(next[0], low), high - width);
  batch(() => {
    pixels.value = pixelsOfPlots(pixels.value);
    span.value = [from, from + width];
  });
}

/** Request for the server. It uses the socket, because a separate HTTP request costs some ms more. */
const asked = computed(() => {
  if (!about.value?.channels) return null;
  const [from, to] = span.value;
  return {
    what: "window",
    path: route.value.path,
    key: about.value.key,
    turn: turn.value,
    from,
    to,
    pixels: pixels.value,
    columns: shown.value.join("\n"),
    ...measure.besideAsked(),
  };
});

let isOwed = false; // a view that was asked for

function take({ head, arrays }: Frame<Head>): void {
  isOwed = head.key === null;
  if (head.problems) wrong.value = head.problems;
  else if (isOwed)
    wake(); // another file has its name now
  else if (head.path === asked.value?.path && head.key === asked.value.key) {
    wrong.value = [];
    const time = arrays.get("time")!;
    arrays.delete("time");
    views.value = { head, time, channels: arrays };
    document.documentElement.dataset.points = String(time.length);
    requestAnimationFrame(() => (pixels.value = pixelsOfPlots(pixels.value))); // the first view comes before its plots
  }
}

/** Return the digits that tell the ends of a span apart. */
export const enough = (from: number, to: number): number =>
  Math.min(Math.max(Math.ceil(Math.log10(Math.max(Math.abs(from), Math.abs(to)) / (to - from || 1))) + 4, 7), 16);

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
    void open(path);
    return () => void (generation += 1);
  }, [path]);
  return (
    <div class="recording">
      <h2>{path}</h2>
      <Problems of={[...unread.value, ...wrong.value, ...(isForeign(found) ? [] : unmoved.value)]} />
      {isForeign(found) && <Foreign found={found!} />}
      {!found?.channels && !unread.value.length && (
        <p role="status">
          The file is read for the first time. <progress aria-label="Read so far" value={found?.share ?? 0} max={1} />
        </p>
      )}
      {found?.channels && (
        <>
          {view && <Answer view={view} />}
          <Controls found={found} />
          <div class="result">
            <div>
              <Plots found={found} />
              <Spectrum found={found} path={path} />
            </div>
            <aside class="panel">
              <Channels found={found} />
              <measure.FaultsLine faults={moved.value.faults} span={span.value} whole={found.span!} onShow={look} />
              <measure.BesideRecording path={path} strokes={moved.value.strokes} onShow={look} />
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
      {(found?.channels || unread.value.length > 0) && !isForeign(found) && <Wizard path={path} />}
      {found?.layout === "rig" && !isForeign(found) && <Characterise path={path} />}
    </div>
  );
}

const FOREIGN = "the layout does not fit this file: ";

/** Whether the layout of the folder belongs to other files. */
const isForeign = (found: Opened | null): boolean => Boolean(found?.notes?.some((one) => one.startsWith(FOREIGN)));

/** Explain why the layout of the folder does not fit, and link to the layout. */
function Foreign({ found }: { found: Opened }) {
  const [why] = found
    .notes!.find((one) => one.startsWith(FOREIGN))!
    .slice(FOREIGN.length)
    .split("; ");
  const layout = (studies.value?.files ?? []).find(
    (one) => one.kind === "layout" && route.value.path.startsWith(folderOf(one.path)),
  );
  return (
    <section class="problem" aria-label="Layout of other files">
      <p>
        The layout in this folder belongs to other files: {why}.
        {layout && (
          <>
            {" "}
            If it should hold for this file too, <a href={link("drive", layout.path)}>edit {layout.path}</a>.
          </>
        )}
      </p>
      <Wizard path={route.value.path} />
    </section>
  );
}

function Controls({ found }: { found: Opened }) {
  const [from, to] = span.value;
  const head = views.value?.head;
  return (
    <p class="row" role="group" aria-label="View">
      <Button act={() => look(found.span!)}>Whole recording</Button>
      <Button act={() => move(0.5)}>Closer</Button>
      <Button act={() => move(2)}>Wider</Button>
      <Button act={() => move(1, -0.5)}>Earlier</Button>
      <Button act={() => move(1, 0.5)}>Later</Button>
      <span role="status" data-from={from} data-to={to}>
        {found.time
          ? `${digits(from, enough(from, to))} s to ${digits(to, enough(from, to))} s`
          : `sample ${Math.round(from)} to ${Math.round(to)}`}
        {head && `, ${head.samples.toLocaleString("en")} of ${found.samples!.toLocaleString("en")} samples`}
        {head && !head.raw && ", lowest and highest of each pixel"}
        {head && head.missing > 0 && `, ${head.missing} values are not numbers, or beyond 3e38`}
        {again.value !== null && `, the file was replaced: ${Math.round(100 * again.value)} % read`}
        {shades.value.length > 0 && `, ${shades.value.length} strokes (darker: towards +x)`}
      </span>
    </p>
  );
}

/** Notes on the recording, and the channels that are drawn. */
function Channels({ found }: { found: Opened }) {
  return (
    <>
      <Remarks of={[...(isForeign(found) ? [] : found.notes!), moved.value.note ?? ""].filter(Boolean)} />
      <Ticks
        legend="Channels"
        options={found.channels!.map((one): [string, string] => [one.column, one.label])}
        chosen={shown.value}
        put={(columns) => (shown.value = columns)}
      />
    </>
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
          {found
            .channels!.filter(({ column }) => drawn.has(`hz/${column}`))
            .map(({ column, label, unit }) => (
              <Plot
                key={column}
                title={`Spectrum of ${label}`}
                unit={`${unit || "1"}/√Hz`}
                xUnit="Hz"
                size={1}
                log
                curves={[{ label, x: drawn.get(`hz/${column}`)!, y: drawn.get(`density/${column}`)! }]}
              />
            ))}
        </div>
      )}
    </section>
  );
}

/** Return all samples of a channel in the view. */
async function samplesOf(column: string): Promise<Map<string, Numbers>> {
  const [from, to] = span.value;
  const given = { path: route.value.path, from: String(from), to: String(to), columns: column };
  try {
    return (await frame("/api/samples", given)).arrays;
  } catch (error) {
    wrong.value = problemsOf(error);
    throw error;
  }
}

function Plots({ found }: { found: Opened }) {
  const now = views.value;
  if (!now) return null;
  const [from, to] = span.value;
  const drawn = found.channels!.filter((one) => now.channels.has(one.column) && shown.value.includes(one.column));
  return (
    <div class="plots" data-plots aria-busy={now.head.from !== from || now.head.to !== to}>
      {drawn.map((one, k) => {
        const curves: Curve[] = [{ label: one.label, x: now.time, y: now.channels.get(one.column)! }];
        const there = now.channels.get(`beside/${one.column}`);
        if (there && measure.beside.value)
          curves.push({
            label: `${one.label} (${measure.beside.value.path})`,
            x: now.channels.get("beside/time")!,
            y: there,
          });
        return (
          <Plot
            key={one.column}
            title={one.label}
            unit={one.unit}
            xUnit={found.time ? "s" : "samples"}
            size={1}
            curves={curves}
            bare={k < drawn.length - 1}
            range={[now.head.from, now.head.to]}
            onReset={from > found.span![0] || to < found.span![1] ? () => look(found.span!) : undefined}
            shades={shades.value}
            marks={marks.value}
            cursors={measure.cursors.value ?? undefined}
            onPick={measure.pick}
            gaps
            extreme={!now.head.raw}
            samples={() => samplesOf(one.column)}
            onZoom={(from, to) => look([from, to])}
          />
        );
      })}
    </div>
  );
}

/** Form that proposes a layout, lets the user correct it, and writes it next to the recording. */
function Wizard({ path }: { path: string }) {
  const place = [folderOf(path), "layout.toml"].filter(Boolean).join("/");
  const now = proposal.value;
  const own = nameOf(path).replace(/\..*$/, "");
  const isOther = isForeign(about.value); // its layout goes into a folder of its own
  if (about.value?.layout === "own names")
    return <p class="note">Its columns have the names of pneudrive: it needs no layout.</p>;
  if (about.value?.layout && !isOther)
    return (
      <p class="note">
        The layout of the folder names its columns: a recording of a {about.value.layout.replace("-", " ")}.
      </p>
    );
  const put = (one: Proposal) => {
    proposals.set(path, one);
    if (route.value.path === path) proposal.value = one;
  };
  const propose = () => attempt(async () => put(await read<Proposal>("/api/propose", { path })));
  const accept = () =>
    attempt(async () => {
      if (isOther) {
        const { path: moved } = await ask<{ path: string }>("/api/own-layout", { path, text: now!.text });
        proposals.delete(path);
        await list();
        location.hash = link("recording", moved);
        return;
      }
      try {
        await write(place, now!.text, "");
      } catch (error) {
        if (!(error instanceof Refused) || error.status !== 412) throw error;
        said.value = `${place} already exists; nothing was written.`;
        return;
      }
      proposals.delete(path);
      void open(path);
      said.value = `Wrote ${place}.`;
    });
  return (
    <section aria-label="Layout">
      <p class="row">
        <Button class={isOther ? "primary" : ""} act={() => propose()}>
          {isOther ? "Propose a layout for this file" : "Propose a layout"}
        </Button>
        <span role="status">
          {said.value ||
            "A layout gives the meaning, unit and sign of each column. With a layout, strokes are found and friction can be characterised."}
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

/** Friction of a recording, alone or together with others, by the same command as in a terminal. */
const Characterise = ({ path }: { path: string }) => (
  <section aria-label="Friction">
    <h2>Friction of this recording</h2>
    <JobForm kind="characterise" start={{ recordings: [path], name: nameOf(path).replace(/\..*$/, "") }} />
  </section>
);
