/** Comparisons with a run in Simulate: other drives and runs, a band of many members, p-V loops, the moving piston. */

import { computed, signal } from "@preact/signals";
import { isPlaying, timeAt } from "../drive/circuit";
import { opened } from "../drive/opened";
import { FigurePanel } from "../plots/figure";
import { digits } from "../plots/looks";
import type { Band } from "../plots/paint";
import { type Curve, curvesOf } from "../plots/plot";
import { pointsFigure } from "../plots/points";
import { undoable } from "../routes";
import type { Frame } from "../server/frame";
import type { Field, RunPanel as Panel, RunHead } from "../server/generated";
import { Button, Fold, Remarks, Select, Table, Tick } from "../workspace/fields";
import { cataloguePaths, filesOf } from "../workspace/files";
import { NumberField } from "../workspace/parts";

const others = undoable(signal<string[]>([]));
const loops = undoable(signal(false));
/** Whether the circuit is shown as it moves. */
export const motion = undoable(signal(false));
const energy = undoable(signal(false));
const band = undoable(signal(false));
const width = undoable(signal(10)); // of the spreads, per cent
export const isNarrow = globalThis.matchMedia?.("(max-width: 60rem)").matches;

/** Selected comparisons of the run. A spread is centred on each value that has a slider. */
export function besides(
  fields: Map<string, Field>,
  sliders: string[],
  numbers: Record<string, number>,
): Record<string, unknown> {
  const spreads: Record<string, [number, number, string]> = {};
  if (band.value)
    for (const key of sliders) {
      const field = fields.get(key);
      const value = numbers[key] ?? field?.number ?? 0;
      const half = (Math.abs(value) * width.value) / 100;
      if (field?.number !== undefined && half > 0) spreads[key] = [value - half, value + half, field.unit ?? ""];
    }
  return { others: others.value, loops: loops.value, motion: motion.value, energy: energy.value, spreads };
}

/** A newly opened file starts without the comparisons of the previous file. */
export function forget(): void {
  others.value = [];
  band.value = energy.value = isPlaying.value = false;
  timeAt.value = 0;
}

const choices = computed(() => {
  const files = filesOf("drive", "circuit", "recording")
    .filter(({ kind, path }) => kind !== "recording" || /\.(parquet|csv|nc)$/.test(path))
    .map(({ path }) => path);
  return [...files, ...cataloguePaths()].filter((path) => path !== opened.value?.path && !others.value.includes(path));
});

const MOST_OTHERS = 7;

export function BesideChoices() {
  return (
    <Fold class="beside" open={!isNarrow} title="Compare">
      <Select
        value=""
        label="Compare with"
        hint="another drive or run"
        options={choices.value}
        disabled={others.value.length >= MOST_OTHERS}
        put={(path) => (others.value = [...others.value, path])}
      />
      {others.value.map((one) => (
        <p class="row" key={one}>
          {one}{" "}
          <Button
            class="link"
            act={() => (others.value = others.value.filter((it) => it !== one))}
            aria-label={`Remove ${one}`}
            words="remove"
          />
        </p>
      ))}
      <p class="row">
        <Tick label="band of 200 members" of={band} />
        <label>
          within ± <NumberField label="Half width of the spreads, per cent" low={0.1} high={90} of={width} /> % of each
          slider
        </label>
      </p>
      <p class="row">
        <Tick label="p-V loops" of={loops} />
        <Tick label="energy" of={energy} />
      </p>
    </Fold>
  );
}

/** Return the name of a file without its folder, unless another selected file has the same name. */
export function short(path: string, all: string[]): string {
  const name = (one: string): string => one.replace("catalogue:", "").replace(/^.*\//, "");
  return all.filter((one) => name(one) === name(path)).length > 1 ? path : name(path);
}

const named = (path: string): string => short(path, [...others.value, opened.value?.path ?? ""]);

/** Return the curves of a panel from the other runs. */
export const otherCurves = (now: Frame<RunHead>, panel: Panel): Curve[] =>
  (now.head.others ?? []).flatMap(({ path }, index) => curvesOf(now, panel, named(path), `${index + 1}/`));

/** Return the band of the members for one column, if there is one. */
export function bandOf({ arrays }: Frame<RunHead>, column: string, look: number): Band[] {
  const [x, low, high] = ["time_s", `${column}/low`, `${column}/high`].map((name) => arrays.get(`band/${name}`));
  return x && low && high ? [{ x, low, high, look }] : [];
}

const REST = 1e-4; // of a unit: rounding of the solver
export const settled = (value: number): number => (Math.abs(value) < REST ? 0 : value);

/** Table of the last values of the run and of the others, their differences, and the ends of the band. */
export function Differences({ head, panels }: { head: RunHead; panels: Panel[] }) {
  const { ends, band, others = [] } = head;
  if (!ends) return null;
  type Column = [head: string, name: string, key: string, valuesOf: Record<string, number | [number, number]>];
  const columns: Column[] = [
    ["this run", "end", "", ends],
    ...(band ? [["5 to 95 % of the members", "band", "", band.ends] as Column] : []),
    ...others.map((one): Column => [named(one.path), "other", `${one.path}/`, one.ends]),
    ...others.map(
      (one): Column => [`largest difference to ${named(one.path)}`, "largest", `${one.path}/`, one.largest],
    ),
  ];
  const cell = ({ unit, size }: Panel, column: string, [, name, key, valuesOf]: Column) => {
    const value = valuesOf[column];
    const texts = [value ?? []].flat().map((one) => `${digits(settled(one / size), 5)} ${unit}`);
    return { text: texts.join(" … ") || "–", data: { [`data-${name}`]: `${key}${column}`, "data-si": value } };
  };
  return (
    <section aria-label="At the end" class="differences ends">
      {band && (
        <p class="note">
          Band: from 5 to 95 % of {band.members} members, which lie evenly in the spreads
          {band.failed > 0 &&
            `; ${band.failed} of them could not be simulated, for example ${band.why}${band.refused ? ". The command and Python reject such a member: narrow the spreads" : ""}`}
          .
        </p>
      )}
      <Remarks
        of={others
          .filter((one) => !Object.keys(one.ends).length)
          .map((one) => `${one.path} has none of these quantities under the same names.`)}
      />
      <Table
        label="Differences"
        heads={["At the end", ...columns.map(([words]) => words)]}
        rows={panels.flatMap((panel) =>
          panel.curves.map(({ column, label }) => [label, ...columns.map((one) => cell(panel, column, one))]),
        )}
      />
    </section>
  );
}

/** Plot of pressure over volume for each chamber. */
export function Loops({ now }: { now: Frame<RunHead> }) {
  const names = now.head.loops ?? [];
  if (!names.length)
    return (
      <p class="note" data-without="loops">
        No p-V loop: only double-acting cylinders have loops, and this circuit does not contain one.
      </p>
    );
  const of = (name: string, axis: string) => Array.from(now.arrays.get(`loop/${name}/${axis}`)!);
  const groups = names.map((name) => ({
    label: name.replace(/\.([ab])$/, ", chamber $1"),
    points: [],
    curve: { x: of(name, "volume_m3"), y: of(name, "pressure_pa") },
  }));
  const title = "Pressure over volume of the chambers";
  const panels = [{ title, groups }];
  const shown = pointsFigure({ name: title, x: ["volume, l", 1e-3], y: ["pressure, bar abs", 1e5], panels });
  return <FigurePanel shown={shown} />;
}
