/** Measuring tools of a recording: two cursors, another recording aligned on a stroke, and the faults. */

import { computed, signal } from "@preact/signals";
import { digits, instant } from "../plots/looks";
import type { Mark } from "../plots/paint";
import type { MeasuredRows, OpenedRecording, Problem, Stroke, Strokes } from "../server/generated";
import { ask, attempts, pause, Refused, read, useAnswer } from "../server/server";
import { Button, Range, Select, Table, Tick } from "../workspace/fields";
import { pathsOf } from "../workspace/files";
import { NumberField, Problems } from "../workspace/parts";

type Span = [number, number];

interface Beside {
  path: string;
  strokes: Stroke[];
  numbers: [number, number]; // of the strokes that begin together, from 1
}

export const UNMOVED: Strokes = { strokes: [], faults: {} };
/** Strokes and faults of the shown recording, with a note or with problems that say why neither is shown. */
export const moved = signal<Strokes & { problems?: Problem[] }>(UNMOVED);
/** Recording that is drawn over this one. */
export const beside = signal<Beside | null>(null);
/** Times of the two cursors. Null: nothing is measured. */
export const cursors = signal<Span | null>(null);

const reading = signal("");
const [wrong, attempt] = attempts();

/** Forget everything that belonged to the previous recording. */
export function forgetBeside(): void {
  beside.value = cursors.value = null;
  reading.value = "";
  wrong.value = [];
}

/** Return the numbers of the first strokes of two recordings that move in the same direction. */
export function alike(own: Stroke[], other: Stroke[]): [number, number] {
  const there = other.findIndex((one) => one.direction === own[0]?.direction);
  return [1, Math.max(there, 0) + 1];
}

/** Return the time shift of the other recording; undefined without the strokes to align. */
export function shiftOf(own: Stroke[], other: Stroke[], [first, second]: [number, number]): number | undefined {
  const [here, there] = [own[first - 1], other[second - 1]];
  return here && there && here.from - there.from;
}

const shift = computed(() => beside.value && shiftOf(moved.value.strokes, beside.value.strokes, beside.value.numbers));

/** Return the part of a request that concerns the other recording. */
export const besideAsked = (): Record<string, string> =>
  beside.value ? { beside: beside.value.path, shift: String(shift.value ?? 0) } : {};

export const marksOf = (faults: Strokes["faults"]): Mark[] =>
  Object.values(faults).flatMap((one) => one.places.map(([from, to]) => ({ from, to })));

/** Return the next fault after the middle of the view. The first fault follows the last. */
export function nextPlace(places: Span[], middle: number): Span {
  return places.find(([from, to]) => 0.5 * (from + to) > middle + 1e-9 * Math.abs(middle)) ?? places[0]!;
}

/** Faults of the recording by kind. A button moves from one place to the next. */
export function FaultsLine({ span, whole, onShow }: { span: Span; whole: Span; onShow: (span: Span) => void }) {
  const kinds = Object.entries(moved.value.faults);
  if (!kinds.length) return null;
  const show = (places: Span[]) => {
    const [from, to] = nextPlace(places, 0.5 * (span[0] + span[1]));
    const half = Math.max(to - from, 0.01 * (whole[1] - whole[0]));
    const middle = 0.5 * (from + to);
    onShow([middle - half, middle + half]);
  };
  return (
    <p class="row" role="group" aria-label="Faults of the recording">
      <span>Faults, marked at the foot of the plots:</span>
      {kinds.map(([kind, { count, places }]) => (
        <Button
          key={kind}
          class="link"
          data-fault={kind}
          data-count={count}
          disabled={!places.length}
          act={() => show(places)}>
          {kind.replaceAll("_", " ")} {count}, show the next
        </Button>
      ))}
    </p>
  );
}

/** Return a pair with another first or second number. */
const replaced = ([first, second]: Span, which: 0 | 1, value: number): Span =>
  which ? [first, value] : [value, second];

export const READ_MS = 150; // between two looks at a file that is being read

/** Draw another recording over this one, once it is read. An empty path: none. */
async function choose(path: string): Promise<void> {
  reading.value = path;
  await attempt(async () => {
    while (path && reading.value === path) {
      const there = await read<OpenedRecording>("/api/recording", { path });
      if (there.problems) throw new Refused(200, there.problems);
      if (there.channels) break;
      await pause(READ_MS);
    }
    const { strokes } = path ? await read<Strokes>("/api/strokes", { path }) : UNMOVED;
    if (reading.value !== path) return;
    beside.value = path ? { path, strokes, numbers: alike(moved.value.strokes, strokes) } : null;
  });
  if (reading.value === path) reading.value = "";
}

/** Form that selects another recording, and the strokes of both that are aligned. */
export function BesideRecording({ path, onShow }: { path: string; onShow: (span: Span) => void }) {
  const now = beside.value;
  const own = moved.value.strokes;
  const isAligned = typeof shift.value === "number";
  const stroke = (which: 0 | 1, label: string, of: Stroke[]) => {
    const align = (number: number) => {
      const numbers = replaced(now!.numbers, which, number);
      beside.value = { ...now!, numbers };
      const { from, to } = own[numbers[0] - 1]!;
      onShow([from - 0.1 * (to - from), to + 0.1 * (to - from)]);
    };
    return (
      <label>
        {label} <NumberField low={1} high={of.length} whole value={now!.numbers[which]} put={align} /> of {of.length}
      </label>
    );
  };
  return (
    <section aria-label="Another recording">
      <p class="row">
        <Select
          label="Draw over it"
          value={now?.path ?? ""}
          options={[["", "no other recording"], ...pathsOf("recording").filter((file) => file !== path)]}
          put={(file) => void choose(file)}
        />
        {reading.value && <span role="status">{reading.value} is read.</span>}
        {isAligned && stroke(0, "begin of stroke", own)}
        {isAligned && stroke(1, "with that of stroke", now!.strokes)}
        {now && (
          <span role="status" data-shift={shift.value ?? 0}>
            {isAligned
              ? `moved by ${digits(shift.value, 12)} s`
              : "not aligned: strokes need a layout that names the position"}
          </span>
        )}
      </p>
      <Problems of={wrong.value} />
    </section>
  );
}

/** Move the nearer cursor to the clicked time. */
export function pick(time: number): void {
  const now = cursors.value;
  if (now) cursors.value = replaced(now, Math.abs(time - now[0]) < Math.abs(time - now[1]) ? 0 : 1, time);
}

/** A time in words, with a resolution of a millionth of the view. */
export const told = (time: number, [from, to]: Span): string => instant(time, (to - from) / 1e4);

/** Two cursors, with the time, difference and slope between them for each shown channel. */
export function Measuring(props: { path: string; version: string; columns: string[]; span: Span; isTimed: boolean }) {
  const { path, version, columns, span, isTimed } = props;
  const now = cursors.value;
  const unit = isTimed ? "s" : "samples";
  const overlay = { beside: typeof shift.value === "number" ? beside.value!.path : "", shift: shift.value ?? 0 };
  const wanted = JSON.stringify({ path, at: now, columns, ...overlay });
  const [found, problems] = useAnswer(
    now ? path : "",
    async () => ({ ...(await ask<MeasuredRows>("/api/measure", JSON.parse(wanted))), of: wanted }),
    [wanted, version],
  );
  const wide = span[1] - span[0];
  const cursor = (which: 0 | 1) => {
    const put = (time: number) => (cursors.value = replaced(now!, which, time));
    const words = told(now![which], span);
    const name = `Cursor ${which + 1}`;
    return (
      <span class="row">
        <Range label={name} value={now![which]} ends={span} words={`${words} ${unit}`} steps={1000} put={put} />
        <NumberField label={`${name}, ${unit}`} value={words} put={put} /> {unit}
      </span>
    );
  };
  return (
    <section aria-label="Measure">
      <p class="row">
        <Tick
          label="measure between two cursors"
          value={now !== null}
          put={(isOn) => (cursors.value = isOn ? [span[0] + wide / 3, span[0] + (2 * wide) / 3] : null)}
        />
        {now && cursor(0)}
        {now && cursor(1)}
        {now && <span class="note">A click in a plot moves the nearer cursor there.</span>}
      </p>
      <Problems of={problems} />
      {found && (
        <div class="measured" data-is-current={found.of === wanted}>
          <Table
            label="Measured between the cursors"
            heads={["Nearest samples", "cursor 1", "cursor 2", "difference", "slope"]}
            rows={rowsOf(found, path, (time) => told(time, span), isTimed)}
          />
        </div>
      )}
    </section>
  );
}

/** Rows of the measured values, after the times of the samples of each recording. */
function rowsOf({ rows }: MeasuredRows, path: string, timeOf: (time: number) => string, isTimed: boolean) {
  const unit = isTimed ? "s" : "samples";
  const text = (value: number | null, of: string) => (value === null ? "–" : `${digits(value, 6)}${of && ` ${of}`}`);
  return rows.flatMap(({ recording, label, unit: own, time_s: times, values, difference, slope }, index) => {
    const name = recording === path ? "" : ` (${recording})`;
    const step = own.replace(/ (gauge|abs)$/, ""); // of a difference
    const cells = [
      `${label}${name}`,
      ...values.map((value) => text(value, own)),
      text(difference, step),
      text(slope, `${step || "1"}${isTimed ? "/s" : " a sample"}`),
    ];
    const data = { "data-measured": `${recording}/${label}`, "data-difference": difference, "data-slope": slope };
    if (rows[index - 1]?.recording === recording) return [{ cells, data }];
    const shown = times.map((time) => `${timeOf(time)} ${unit}`);
    return [[`time${name}`, ...shown, text(times[1] - times[0], unit), ""], { cells, data }];
  });
}
