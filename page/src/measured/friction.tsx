/** View of friction maps with the curves of their fit, and of fits of every kind. */

import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect } from "preact/hooks";
import { Heat } from "../plots/heat";
import { digits } from "../plots/looks";
import { type Group, isWide, Scatter } from "../plots/scatter";
import { isToml, kept, link, route } from "../routes";
import type { SentView } from "../server/generated";
import { attempting, type Problem, Refused, read } from "../server/server";
import { Choose } from "../workspace/choose";
import { folderOf, studies } from "../workspace/files";
import { JobForm } from "../workspace/form";
import { follow } from "../workspace/jobs";
import { Copied, Problems, ReportOf, Table } from "../workspace/parts";
import { Answer, AnswerOf, Shown, Values } from "../workspace/result";
import { isOverMain } from "../workspace/tree";
import { Behind, forget, showBehind } from "./fit";

interface Point {
  recording: string;
  direction: number;
  speed: number;
  friction: number;
  spread: number | null;
  flags: string;
}

interface FrictionMap {
  groups: {
    label: string;
    assembly: string; // seal, mounting and drive
    points: Point[];
    curve?: { speed: number[]; friction: number[]; low: number[]; high: number[]; measured: [number, number] };
  }[];
  heat: {
    edges: number[];
    rows: {
      label: string;
      assembly: string;
      cells: ([friction: number, kind: "measured" | "fit" | "extrapolated"] | null)[];
    }[];
  };
  fit: string;
  fits: string[];
  recordings: Record<string, string>;
  left_out: number;
  flags: string[]; // a sentence on each raised flag
}

const map = signal<FrictionMap | null>(null);
const fit = signal<SentView | null>(null);
const wrong = signal<Problem[]>([]);
const attempt = attempting(wrong);
const isLog = signal<boolean | null>(null); // null: as wide as the speeds need it
const MOST_ROWS = 300;
const MM = 1000; // mm in a metre
const BAR = 1e5; // Pa

const drawn = signal("");

/** Draw the curves of another fit over the map. */
const choose = (path: string, of: string): Promise<void> =>
  attempt(async () => {
    forget();
    slice.value = difference.value = null;
    const one = await read<FrictionMap>("/api/map", { path, fit: of });
    if (route.value.path !== path) return;
    map.value = one;
    fit.value = null;
    if (!map.value.fit) fit.value = await read<SentView>("/api/view", { path: of });
    drawn.value = of;
  });

/** Draw a new fit of the map as soon as its file exists. */
async function drawFit(path: string, job: { number: number; out: string }): Promise<void> {
  await follow(job.number);
  if (route.value.path === path) await choose(path, job.out);
}

function Refit({ path, found }: { path: string; found: FrictionMap }) {
  return (
    <section aria-label="Fit again">
      {found.fits.length > 0 && (
        <label>
          Curves of{" "}
          <select
            value={drawnFit(path)}
            onChange={(event) => event.currentTarget.value && void choose(path, event.currentTarget.value)}>
            {!drawnFit(path) && <option value="">choose</option>}
            {found.fits.map((one) => (
              <option key={one}>{one}</option>
            ))}
          </select>
        </label>
      )}
      <details>
        <summary>Fit another law</summary>
        <JobForm kind="fit" given={{ map: path }} jobs={["fit", "design"]} after={(job) => drawFit(path, job)} />
      </details>
    </section>
  );
}

/** The fit of the usual name next to a map, if there is one: a map of several seals has one fit for each. */
function besideOf(path: string): string {
  const usual = `${path.slice(0, path.lastIndexOf("/") + 1)}fit.toml`;
  return map.value?.fits.includes(usual) ? usual : "";
}

/** Fit whose curves are drawn: the chosen fit, or else the fit next to the map. Empty without either. */
const drawnFit = (path: string): string => drawn.value || (map.value?.fit ? "" : besideOf(path));

/** Fit that is shown: the open file, or else the drawn fit. */
const pathOfFit = (path: string): string => (isToml(path) ? path : drawnFit(path));

let generation = 0;

async function open(path: string): Promise<void> {
  const mine = ++generation;
  forget();
  only.value = drawn.value = "";
  slice.value = difference.value = null;
  map.value = fit.value = isLog.value = null;
  wrong.value = [];
  const isFit = isToml(path);
  try {
    const found = isFit ? null : await read<FrictionMap>("/api/map", { path });
    if (mine !== generation) return;
    map.value = found;
    if (found?.fit) return;
    const beside = isFit ? path : besideOf(path);
    if (!beside) return;
    const own = await read<SentView>("/api/view", { path: beside });
    if (mine === generation) fit.value = own;
  } catch (error) {
    if (mine === generation && error instanceof Refused) wrong.value = error.problems;
  }
}

export function FrictionView() {
  const { path } = route.value;
  useEffect(() => {
    if (path) void open(path);
  }, [path]);
  if (!path)
    return (
      <Choose
        title="Friction"
        hint="A friction map holds the measured points, a fit holds the law. Characterise a recording to get both: open it, accept a layout, then press Characterise."
        view="friction"
        kinds={["friction map", "fit"]}
        recordings
      />
    );
  return (
    <div class="friction">
      <h2>{path}</h2>
      <Problems of={wrong.value} />
      {!map.value && !fit.value && !wrong.value.length && <p role="status">Reading {path}.</p>}
      {map.value &&
        (fit.value ? (
          <Answer
            view={fit.value}
            remedy={(of) =>
              of.state !== "good" && (
                <p>
                  <button type="button" onClick={() => void showBehind(pathOfFit(path))}>
                    Plan the next points
                  </button>
                </p>
              )
            }
          />
        ) : (
          <AnswerOf path={path} />
        ))}
      <ReportOf folder={folderOf(path)} />
      {map.value && <Refit path={path} found={map.value} />}
      {map.value ? (
        <FrictionMapView path={path} found={map.value}>
          {fit.value && (
            <section class="result-figures" aria-label="Fit">
              <Values view={fit.value} />
            </section>
          )}
        </FrictionMapView>
      ) : (
        fit.value && <Shown view={fit.value} label="Fit" />
      )}
      {(fit.value || map.value) && pathOfFit(path) && <Behind path={pathOfFit(path)} />}
    </div>
  );
}

type Curve = {
  friction: (number | null)[];
  low: (number | null)[];
  high: (number | null)[];
  measured: [number | null, number | null];
};

interface Slice {
  chamber: "a" | "b";
  groups: {
    label: string;
    assembly: string;
    points: (Point & { gauge: number })[];
    curve?: Curve & { gauge: number[] };
  }[];
  python: string;
}

type Difference = Pick<FrictionMap, "groups" | "fit"> & { command: string; python: string };

const only = signal("");
const slice = signal<(Slice & { speed: number; of: string }) | null>(null);
const difference = signal<(Difference & { other: string; of: string }) | null>(null);
const NEAR = 0.05; // speeds that differ by less, relatively, are one level

/** Return the different speeds of a map. */
export function levels(speeds: number[]): number[] {
  return [...speeds].sort((a, b) => a - b).filter((one, k, all) => k === 0 || one > all[k - 1]! * (1 + NEAR));
}

/** Index of a recording's run within its group: each run has a marker shape. */
function runOf(recording: string, points: { recording: string }[]): string {
  const all = [...new Set(points.map((one) => one.recording))];
  return `run ${all.indexOf(recording) + 1}`;
}

const ALL = "all, side by side";
const seal = kept("seal");

/** Return the seals or mountings of a map, and the shown one: the chosen one, else the first that has a fit. */
function chosenSeal(found: FrictionMap): { names: string[]; now: string } {
  const names = [...new Set(found.groups.map((one) => one.assembly))];
  const first = found.groups.find((one) => one.curve)?.assembly ?? names[0] ?? "";
  return { names, now: [...names, ALL].includes(seal.value) ? seal.value : first };
}

/** Return the groups of a plot over an axis of size `size`, from points and curves whose abscissa is named `key`. */
function drawnGroups<Key extends "speed" | "gauge">(
  key: Key,
  size: number,
  groups: {
    label: string;
    points: (Pick<Point, "friction" | "spread" | "recording"> & Record<Key, number>)[];
    curve?: Curve & Record<Key, number[]>;
  }[],
): Group[] {
  return groups.map(({ label, points, curve }) => ({
    label,
    points: points.map((one) => ({
      x: size * one[key],
      y: one.friction,
      spread: one.spread,
      run: runOf(one.recording, points),
    })),
    ...(curve && {
      curve: {
        x: curve[key].map((one) => size * one),
        y: curve.friction as number[],
        low: curve.low as number[],
        high: curve.high as number[],
        measured: curve.measured.map((one) => size * (one ?? Number.NaN)) as [number, number],
      },
    }),
  }));
}

/** Plot of a part of the map: one pressure, one speed, or the difference from another map. */
function Cuts({ path, found }: { path: string; found: FrictionMap }) {
  const fit = (drawn.value || besideOf(path)).replace(/^.*\//, "");
  const own = new Set(found.groups.map((one) => one.assembly)); // of the chosen seal
  const of = `${path} ${fit}`; // another map may be shown by the time of an answer
  const others = (studies.value?.files ?? [])
    .filter((one) => one.kind === "friction map" && one.path !== path)
    .map((one) => one.path);
  const cut = (speed: string) =>
    attempt(
      async () =>
        void (slice.value = speed
          ? { ...(await read<Slice>("/api/slice", { path, fit, speed })), speed: Number(speed), of }
          : null),
    );
  const compare = (other: string) =>
    attempt(
      async () =>
        void (difference.value = other
          ? { ...(await read<Difference>("/api/map-difference", { path, fit, other })), other, of }
          : null),
    );
  const [shown, apart] = [slice.value, difference.value].map((one) => (one?.of === of ? one : null)) as [
    typeof slice.value,
    typeof difference.value,
  ];
  return (
    <>
      <p class="row">
        <label>
          At one pressure{" "}
          <select value={only.value} onChange={(event) => (only.value = event.currentTarget.value)}>
            <option value="">all</option>
            {found.groups.map((one) => (
              <option key={one.label}>{one.label}</option>
            ))}
          </select>
        </label>
        <label>
          At one speed{" "}
          <select value={shown ? String(shown.speed) : ""} onChange={(event) => void cut(event.currentTarget.value)}>
            <option value="">none</option>
            {levels(found.groups.flatMap((one) => one.points.map((point) => point.speed))).map((one) => (
              <option key={one} value={one}>
                {digits(MM * one, 3)} mm/s
              </option>
            ))}
          </select>
        </label>
        {others.length > 0 && (
          <label>
            Compare with{" "}
            <select value={apart?.other ?? ""} onChange={(event) => void compare(event.currentTarget.value)}>
              <option value="">no other map</option>
              {others.map((one) => (
                <option key={one}>{one}</option>
              ))}
            </select>
          </label>
        )}
      </p>
      {shown && (
        <>
          <Scatter
            title={`Friction over pressure at ${digits(MM * shown.speed, 3)} mm/s`}
            x={`chamber ${shown.chamber}, bar gauge`}
            y="friction, N"
            log={false}
            groups={drawnGroups(
              "gauge",
              1 / BAR,
              shown.groups.filter((one) => own.has(one.assembly)),
            )}
          />
          {shown.python && <Copied of="at one speed" python={shown.python} />}
        </>
      )}
      {apart && (
        <>
          <Scatter
            title={`${apart.other} less ${path}`}
            x="speed, mm/s"
            y="difference of friction, N"
            log={isLog.value ?? isWide(drawnGroups("speed", MM, apart.groups))}
            groups={drawnGroups("speed", MM, apart.groups)}
          />
          <p class="note">
            Bars: U (k = 2) of both points together. Bands: 95 % of the difference of both fits, by Welch; errors that
            the sensors of both share are not in them, and may cancel. {apart.fit}
          </p>
          {apart.python && <Copied of="the difference" command={apart.command} python={apart.python} />}
        </>
      )}
    </>
  );
}

function FrictionMapView({ path, found, children }: { path: string; found: FrictionMap; children: ComponentChildren }) {
  const { names, now } = chosenSeal(found);
  const own = found.groups.filter((one) => now === ALL || one.assembly === now);
  const groups = drawnGroups(
    "speed",
    MM,
    own.filter((one) => !only.value || one.label === only.value),
  );
  const points = own.flatMap((group) => group.points.map((one) => ({ ...one, group: group.label })));
  const curves = own.filter((one) => one.curve).length;
  const log = isLog.value ?? isWide(groups);
  return (
    <>
      <p class="row">
        {names.length > 1 && (
          <label>
            Seal or mounting{" "}
            <select value={now} onChange={(event) => (seal.value = event.currentTarget.value)}>
              {[...names, ALL].map((one) => (
                <option key={one}>{one}</option>
              ))}
            </select>
          </label>
        )}
        <label>
          <input type="checkbox" checked={log} onChange={(event) => (isLog.value = event.currentTarget.checked)} />{" "}
          speed on a logarithmic scale
        </label>
        <span class="note">
          Bars: U (k = 2), statistical and systematic. Bands: 95 % of the fitted curve; dotted beyond the measured
          speeds. {found.fit}
        </span>
      </p>
      {now !== ALL && <Scatter title="Friction over speed" x="speed, mm/s" y="friction, N" groups={groups} log={log} />}
      {now === ALL && (
        <div class="multiples">
          {names.map((name) => {
            const part = drawnGroups(
              "speed",
              MM,
              own.filter((one) => one.assembly === name),
            ).map((one) => ({ ...one, label: one.label.replace(`${name}: `, "") }));
            return (
              <Scatter
                key={name}
                title={name}
                x="speed, mm/s"
                y="friction, N"
                groups={part}
                log={log}
                among={groups}
                height={240}
              />
            );
          })}
        </div>
      )}
      {now !== ALL && curves > 0 && curves < own.length && (
        <p class="note">
          Curves are drawn for the first {curves} of {own.length} pairs of pressures.
        </p>
      )}
      {children}
      <h2>Sections of the map</h2>
      <Cuts path={path} found={{ ...found, groups: own }} />
      <Heat of={{ ...found.heat, rows: found.heat.rows.filter((one) => now === ALL || one.assembly === now) }} />
      <details open={!isOverMain()}>
        <summary>Measured points</summary>
        <Table
          label="Points of the map"
          heads={["Recording", "Direction", "Speed, mm/s", "Friction, N", "U (k = 2), N", "Chambers", "Flags"]}
          rows={points.slice(0, MOST_ROWS).map((one) => {
            const file = found.recordings[one.recording];
            const name = file ? <a href={link("recording", file)}>{one.recording}</a> : one.recording;
            const flags = one.flags.replaceAll(",", ", ").replaceAll("_", " ");
            return {
              cells: [
                name,
                one.direction > 0 ? "+x" : "-x",
                digits(MM * one.speed),
                digits(one.friction),
                digits(one.spread, 2),
                one.group,
                flags,
              ],
              data: { "data-si": one.friction },
            };
          })}
        />
      </details>
      {points.length > MOST_ROWS && (
        <p class="note">{points.length - MOST_ROWS} more points are in the plot and in the file.</p>
      )}
      {found.left_out > 0 && <p class="note">{found.left_out} points are in the file only.</p>}
      {found.flags.map((sentence) => (
        <p class="note" key={sentence}>
          {sentence}
        </p>
      ))}
    </>
  );
}
