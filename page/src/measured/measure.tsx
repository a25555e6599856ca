/** Measuring tools of a recording: two cursors, another recording aligned on a stroke, and the faults. */

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { digits, instant } from "../plots/looks";
import type { Mark } from "../plots/paint";
import type { MeasuredRows, OpenedRecording, Stroke, Strokes } from "../server/generated";
import { ask, attempts, newest, pause, problemsOf, Refused, read } from "../server/server";
import { Button, Range, Select, Table, Tick } from "../workspace/fields";
import { pathsOf } from "../workspace/files";
import { NumberField, Problems } from "../workspace/parts";

export type { Stroke };

export type Faults = Strokes["faults"];
type Span = [number, number];

interface Beside {
  path: string;
  strokes: Stroke[];
  numbers: [number, number]; // of the strokes that begin together, from 1
  shift: number;
}

/** Recording that is drawn over this one. */
export const beside = signal<Beside | null>(null);
/** Times of the two cursors. Null: nothing is measured. */
export const cursors = signal<[number, number] | null>(null);

const reading = signal("");
const [wrong, attempt] = attempts();

/** Forget everything that belonged to the previous recording. */
export function forgetBeside(): void {
  beside.value = cursors.value = null;
  reading.value = "";
  wrong.value = [];
}

/** Find the strokes again, because the recording grew or was replaced. */
export function realign(own: Stroke[]): void {
  const now = beside.value;
  if (!now?.strokes.length) return;
  const isThere = own.length >= now.numbers[0];
  beside.value = isThere ? { ...now, shift: shiftOf(own, now.strokes, now.numbers) } : null;
}

/** Return the part of a request that concerns the other recording. */
export function besideAsked(): Record<string, string> {
  const now = beside.value;
  return now ? { beside: now.path, shift: String(now.shift) } : {};
}

/** Return the numbers of the first strokes of two recordings that move in the same direction. */
export function alike(own: Stroke[], other: Stroke[]): [number, number] {
  const there = other.findIndex((one) => one.direction === own[0]!.direction);
  return [1, Math.max(there, 0) + 1];
}

/** Return the time shift of the other recording. */
export const shiftOf = (own: Stroke[], other: Stroke[], [first, second]: [number, number]): number =>
  own[first - 1]!.from - other[second - 1]!.from;

const WORDS: Record<string, string> = {
  non_finite: "not a number",
  repeated_time: "repeated time",
  spike: "spike",
  saturated: "sensor at its limit",
  stuck: "sensor stuck",
  gap: "gap in time",
  counter_wrap: "counter wrapped",
  position_jump: "position jumps",
};

export const marksOf = (faults: Faults): Mark[] =>
  Object.values(faults).flatMap((one) => one.places.map(([from, to]) => ({ from, to })));

/** Return the next fault after the middle of the view. The first fault follows the last. */
export function nextPlace(places: [number, number][], middle: number): [number, number] {
  return places.find(([from, to]) => 0.5 * (from + to) > middle + 1e-9 * Math.abs(middle)) ?? places[0]!;
}

/** Table of the recording's faults by kind. A button moves from one place to the next. */
export function FaultsLine(props: { faults: Faults; span: Span; whole: Span; onShow: (span: Span) => void }) {
  const { faults, span, whole, onShow } = props;
  const kinds = Object.entries(faults);
  if (!kinds.length) return null;
  const show = (places: [number, number][]) => {
    const [from, to] = nextPlace(places, 0.5 * (span[0] + span[1]));
    const half = Math.max(to - from, 0.01 * (whole[1] - whole[0]));
    const middle = 0.5 * (from + to);
    onShow([middle - half, middle + half]);
  };
  return (
    <p class="row" role="group" aria-label="Faults of the recording">
      <span>Faults, marked at the foot of the plots:</span>
      {kinds.map(([kind, one]) => (
        <span key={kind} data-fault={kind} data-count={one.count}>
          {WORDS[kind] ?? kind.replace(/_/g, " ")} {one.count}{" "}
          {one.places.length > 0 && (
            <Button
              class="link"
              act={() => show(one.places)}
              aria-label={`Show the next place: ${WORDS[kind] ?? kind}`}
              words="show the next"
            />
          )}
        </span>
      ))}
    </p>
  );
}

export const READ_MS = 150; // between two looks at a file that is being read

/** Form that selects another recording, and the strokes of both that are aligned. */
export function BesideRecording(props: { path: string; strokes: Stroke[]; onShow: (span: [number, number]) => void }) {
  const { path, strokes, onShow } = props;
  const now = beside.value;
  const files = pathsOf("recording").filter((file) => file !== path);
  const choose = async (other: string) => {
    reading.value = other;
    await attempt(async () => {
      while (other && reading.value === other) {
        const there = await read<OpenedRecording>("/api/recording", { path: other });
        if (there.problems) throw new Refused(200, there.problems);
        if (there.channels) break;
        await pause(READ_MS);
      }
      const found = other ? (await read<Strokes>("/api/strokes", { path: other })).strokes : [];
      if (reading.value !== other) return;
      const isAligned = strokes.length > 0 && found.length > 0;
      const numbers: [number, number] = isAligned ? alike(strokes, found) : [1, 1];
      const shift = isAligned ? shiftOf(strokes, found, numbers) : 0;
      beside.value = other ? { path: other, strokes: found, numbers, shift } : null;
    });
    if (reading.value === other) reading.value = "";
  };
  const align = (which: 0 | 1, number: number) => {
    const numbers: [number, number] = which ? [now!.numbers[0], number] : [number, now!.numbers[1]];
    beside.value = { ...now!, numbers, shift: shiftOf(strokes, now!.strokes, numbers) };
    const { from, to } = strokes[numbers[0] - 1]!;
    onShow([from - 0.1 * (to - from), to + 0.1 * (to - from)]);
  };
  const stroke = (which: 0 | 1, label: string, of: Stroke[]) => (
    <label>
      {label}{" "}
      <NumberField low={1} high={of.length} whole value={now!.numbers[which]} put={(number) => align(which, number)} />{" "}
      of {of.length}
    </label>
  );
  return (
    <section aria-label="Another recording">
      <p class="row">
        <Select
          label="Draw over it"
          value={now?.path ?? ""}
          options={[["", "no other recording"], ...files]}
          put={(file) => void choose(file)}
        />
        {reading.value && <span role="status">{reading.value} is read.</span>}
        {now && strokes.length > 0 && now.strokes.length > 0 && (
          <>
            {stroke(0, "begin of stroke", strokes)}
            {stroke(1, "with that of stroke", now.strokes)}
          </>
        )}
        {now && (
          <span role="status" data-shift={now.shift}>
            {now.strokes.length && strokes.length
              ? `moved by ${digits(now.shift, 12)} s`
              : "not aligned: strokes need a layout that names the position"}
          </span>
        )}
      </p>
      <Problems of={wrong.value} />
    </section>
  );
}

const measured = signal<(MeasuredRows & { of: string }) | null>(null);
let asked = ""; // what is to be measured, as JSON
const fetchMeasured = newest(async () => {
  const of = asked;
  try {
    measured.value = { ...(await ask<MeasuredRows>("/api/measure", JSON.parse(of))), of };
    wrong.value = [];
  } catch (error) {
    const problems = problemsOf(error);
    if (of === asked) wrong.value = problems; // else another recording was opened meanwhile
  }
});

/** Move the nearer cursor to the clicked time. */
export function pick(time: number): void {
  const now = cursors.value;
  if (now) cursors.value = Math.abs(time - now[0]) < Math.abs(time - now[1]) ? [time, now[1]] : [now[0], time];
}

/** Field of a time, with a resolution of a millionth of the view. */
export const told = (time: number, [from, to]: [number, number]): string => instant(time, (to - from) / 1e6);

interface MeasuredProps {
  path: string;
  span: Span;
  isTimed: boolean;
}

/** Two cursors, with the time, difference and slope between them for each shown channel. */
export function Measuring(props: MeasuredProps & { version: string; columns: string[] }) {
  const { path, version, columns, span, isTimed } = props;
  const now = cursors.value;
  const other = beside.value;
  const unit = isTimed ? "s" : "samples";
  const overlay = { beside: other?.strokes.length ? other.path : "", shift: other?.shift ?? 0 };
  const wanted = JSON.stringify({ path, at: now, columns, ...overlay });
  useEffect(() => {
    asked = wanted;
    if (now) void fetchMeasured();
  }, [wanted, version]);
  const begin = (isOn: boolean) => {
    measured.value = null;
    const wide = span[1] - span[0];
    cursors.value = isOn ? [span[0] + wide / 3, span[0] + (2 * wide) / 3] : null;
  };
  const put = (which: 0 | 1, time: number) => (cursors.value = which ? [now![0], time] : [time, now![1]]);
  const cursor = (which: 0 | 1) => (
    <span class="row">
      <Range
        label={`Cursor ${which + 1}`}
        value={now![which]}
        ends={span}
        words={`${told(now![which], span)} ${unit}`}
        steps={1000}
        put={(time) => put(which, time)}
      />
      <NumberField
        label={`Cursor ${which + 1}, ${unit}`}
        value={told(now![which], span)}
        put={(time) => put(which, time)}
      />{" "}
      {unit}
    </span>
  );
  return (
    <section aria-label="Measure">
      <p class="row">
        <Tick label="measure between two cursors" value={now !== null} put={begin} />
        {now && cursor(0)}
        {now && cursor(1)}
        {now && <span class="note">A click in a plot moves the nearer cursor there.</span>}
      </p>
      {now && <MeasuredTable path={path} wanted={wanted} span={span} isTimed={isTimed} />}
    </section>
  );
}

/**
 * Table of the measured values. It is separate from the cursors, so that an answer does not overwrite a field in
 * use.
 */
function MeasuredTable({ path, wanted, span, isTimed }: MeasuredProps & { wanted: string }) {
  const found = measured.value;
  if (!found) return null;
  const unit = isTimed ? "s" : "samples";
  const withUnit = (value: number | null, of: string) =>
    value === null ? "–" : `${digits(value, 6)}${of && ` ${of}`}`;
  const step = (of: string) => of.replace(/ (gauge|abs)$/, ""); // of a difference
  const rows = found.rows.flatMap((row, index) => {
    const name = row.recording === path ? "" : ` (${row.recording})`;
    const [first, second] = row.time_s;
    const times = [told(first, span), told(second, span)].map((time) => `${time} ${unit}`);
    const values = {
      cells: [
        `${row.label}${name}`,
        ...row.values.map((value) => withUnit(value, row.unit)),
        withUnit(row.difference, step(row.unit)),
        withUnit(row.slope, `${step(row.unit) || "1"}${isTimed ? "/s" : " a sample"}`),
      ],
      data: {
        "data-measured": `${row.recording}/${row.label}`,
        "data-difference": row.difference,
        "data-slope": row.slope,
      },
    };
    const isFirst = found.rows[index - 1]?.recording !== row.recording;
    return isFirst ? [[`time${name}`, ...times, withUnit(second - first, unit), ""], values] : [values];
  });
  return (
    <div class="measured" data-is-current={found.of === wanted}>
      <Table
        label="Measured between the cursors"
        heads={["Nearest samples", "cursor 1", "cursor 2", "difference", "slope"]}
        rows={rows}
      />
    </div>
  );
}
