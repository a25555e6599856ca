/** View of friction maps with the curves of their fits, of comparisons of seals, and of fits of every kind. */

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { FigureView } from "../plots/figure";
import { digits } from "../plots/looks";
import { type Group, isWide, MOST_SERIES, pointsFigure } from "../plots/points";
import { isToml, kept, link, route } from "../routes";
import type {
  Compared,
  FrictionCurve as Curve,
  Finding,
  FrictionMap,
  FrictionPoint as Point,
  SentView,
  ShownFigure,
  Slice,
} from "../server/generated";
import { usePosted, useRequest } from "../server/server";
import { Button, Fold, type Option, Select, Table, Tick } from "../workspace/fields";
import { changesOf, filesOf, folderOf, nameOf, pathsOf, studies } from "../workspace/files";
import { follow, JobForm } from "../workspace/jobs";
import { Copied, Problems, ReportOf } from "../workspace/parts";
import { Answer, Findings, Shown, useView, Values } from "../workspace/result";
import Differences from "./differences";
import { Behind, showBehind } from "./fit";

/** Points of one seal and pressure, with the curve of the fit; `assembly` is seal, mounting and drive. */
interface Part<Key extends string> {
  label: string;
  assembly: string;
  points: (Point & Record<Key, number>)[];
  curve?: Curve & Record<Key, number[]>;
}

const MOST_ROWS = 300;
const MM = 1000; // mm in a metre
const BAR = 1e5; // Pa
const NEAR = 0.05; // speeds that differ by less, relatively, are one level
const NARROW = 3; // ratio of speeds below which pressure is the axis
const ALL = "all, side by side";

const seal = kept("seal");
const axis = kept("over"); // "pressure" or "speed"
const level = kept("at"); // the speed or the pressure that is shown alone
const other = kept("with"); // a seal of this map, or another map
const chosenFit = kept("fit");
const isLog = signal<boolean | null>(null); // null: as wide as the speeds need it

/** Return the different speeds of a map. */
export function levels(speeds: number[]): number[] {
  return [...speeds].sort((a, b) => a - b).filter((speed, k, all) => k === 0 || speed > all[k - 1]! * (1 + NEAR));
}

/** Return a group over an axis of size `size`, from points and a curve whose abscissa is named `key`. */
function groupOver<Key extends "speed" | "gauge">(key: Key, size: number, part: Part<Key>): Group {
  const { label, assembly, points, curve } = part;
  const runs = [...new Set(points.map((point) => point.recording))];
  const runOf = (recording: string) => (key === "speed" ? runs.indexOf(recording) : 0);
  return {
    label: label.replace(`${assembly}: `, ""),
    points: points.map((point) => ({
      x: size * point[key],
      y: point.friction,
      spread: point.spread,
      run: runOf(point.recording),
    })),
    curve: curve && {
      x: curve[key].map((at) => size * at),
      y: curve.friction,
      low: curve.low,
      high: curve.high,
      measured: curve.measured.map((at) => size * (at ?? Number.NaN)),
    },
  };
}

/** Return the panels of a figure: one for each seal. */
const panelsOf = <Key extends "speed" | "gauge">(key: Key, size: number, parts: Part<Key>[]) =>
  [...new Set(parts.map((part) => part.assembly))].map((title, _, all) => ({
    title: all.length > 1 ? title : "",
    groups: parts.filter((part) => part.assembly === title).map((part) => groupOver(key, size, part)),
  }));

/** Friction over the pressure of a chamber, with a panel for each seal. */
export function overPressure({ chamber, groups }: Slice, caption: string): ShownFigure {
  const panels = panelsOf("gauge", 1 / BAR, groups);
  if (groups.length === panels.length) for (const panel of panels) panel.groups[0]!.label = ""; // one pressure alone
  const x = `chamber ${chamber}, bar gauge`;
  return pointsFigure({ name: "Friction over pressure", caption, x, y: "friction, N", panels, isFromZero: true });
}

/** Whether the axis is pressure: as chosen, or because pressure was varied more than speed, as a map of one seal shows. */
function isOverPressure(groups: FrictionMap["groups"]): boolean {
  if (axis.value) return axis.value === "pressure";
  const speeds = groups.flatMap((group) => group.points.map((point) => point.speed));
  const counts = groups.map((group) => groups.filter((one) => one.assembly === group.assembly).length);
  return Math.max(...counts) > 1 && Math.max(...speeds) < NARROW * Math.min(...speeds);
}

export default function FrictionView() {
  const { path } = route.value;
  const isFit = isToml(path);
  const [view, problems] = useRequest<SentView>("/api/view", isFit ? { path } : null, [changesOf(path)]);
  const beside = [folderOf(path), "map.parquet"].filter(Boolean).join("/");
  const hasMap = studies.value?.files.some((file) => file.path === beside);
  if (!isFit) return <MapView key={path} path={path} fit="" />;
  if (view && hasMap && !view.figures.length && !view.curves.length)
    return <MapView key={path} path={beside} fit={path} />;
  return (
    <div class="friction">
      <h2>{path}</h2>
      <Problems of={problems} />
      {view && <Shown view={view} label="Fit" />}
      <ReportOf folder={folderOf(path)} />
      {view && <Behind path={path} />}
      {view && !hasMap && (
        <Fold title="Apply it to a drive">
          <JobForm
            kind="apply"
            given={{ fit: path }}
            start={{ out: path.replace(/(fit)?\.toml$/, "identified.toml") }}
          />
        </Fold>
      )}
    </div>
  );
}

/** A map, with the fit that was opened, or the fits of its folder. */
function MapView({ path, fit: opened }: { path: string; fit: string }) {
  const drawn = chosenFit.value || opened;
  useEffect(() => void (isLog.value = null), []);
  const [found, problems] = useRequest<FrictionMap>("/api/map", { path, fit: drawn }, [studies.value]);
  const whole = useView(path);
  const names = Object.keys(found?.seals ?? {});
  const ofFit = names.find((name) => opened && found!.seals[name] === opened);
  const now = [...names, ALL].includes(seal.value)
    ? seal.value
    : (ofFit ?? (names.length > 1 ? ALL : (names[0] ?? "")));
  const fit = drawn || (found?.seals[now] ?? "");
  const fitted = useView(fit);
  const name = nameOf(folderOf(path)) || nameOf(path);
  const answer = fitted ?? (fit ? null : whole);
  return (
    <div class="friction">
      <h2>
        {now && now !== ALL && names.length > 1 ? [now, other.value || name].join(other.value ? " and " : ", ") : name}{" "}
        <span class="note">{opened || path}</span>
      </h2>
      <Problems of={problems} />
      {!found && !problems.length && <p role="status">Reading {path}.</p>}
      {found && !other.value && answer && <Answer view={answer} withFindings={false} />}
      {found && (
        <>
          <Choices path={path} found={found} names={names} now={now} drawn={drawn} />
          <div class="result">
            <div class="result-figures">
              {other.value ? (
                <Comparison path={path} fit={fit} found={found} />
              ) : (
                <MapFigure path={path} fit={drawn} found={found} now={now} />
              )}
            </div>
            <aside>
              <Aside path={path} fit={fit} views={[fitted, whole]} />
            </aside>
          </div>
          <Points found={found} now={now} />
          {fit && <Behind path={fit} />}
        </>
      )}
    </div>
  );
}

/** Open findings, the values of the fit, the report, and another fit. */
function Aside({ path, fit, views: [fitted, whole] }: { path: string; fit: string; views: (SentView | null)[] }) {
  const remedy = ({ state }: Finding) =>
    fit && state !== "good" ? (
      <p>
        <Button act={() => showBehind(fit)}>Plan the next points</Button>
      </p>
    ) : null;
  const again = async (job: { number: number; out: string }) => {
    await follow(job.number);
    if (route.value.path === path) chosenFit.value = job.out;
  };
  return (
    <>
      {(fitted ?? whole) && (
        <section class="panel" aria-label="Findings">
          <h3>What these data cannot tell</h3>
          <Findings of={[...(fitted?.findings ?? []), ...(whole?.findings ?? [])]} remedy={remedy} />
          <ReportOf folder={folderOf(path)} />
        </section>
      )}
      {fitted && <Values view={fitted} />}
      <Fold title="Fit another law">
        <JobForm kind="fit" given={{ map: path }} jobs={["fit", "design"]} after={again} />
      </Fold>
    </>
  );
}

/** Choices of the figure; the address keeps them. */
function Choices(props: { path: string; found: FrictionMap; names: string[]; now: string; drawn: string }) {
  const { path, found, names, now, drawn } = props;
  const groups = found.groups.filter((group) => now === ALL || group.assembly === now);
  const isOver = isOverPressure(found.groups);
  const speeds = levels(groups.flatMap((group) => group.points.map((point) => point.speed))).map(
    (speed): Option => [String(speed), `${digits(MM * speed, 3)} mm/s`],
  );
  const maps = pathsOf("friction map").filter((file) => file !== path);
  const seals = names.filter((name) => name !== now && found.seals[name] && found.seals[now]);
  const over = (name: string) => (
    <Button
      aria-pressed={(name === "pressure") === isOver}
      act={() => ([axis.value, level.value, other.value] = [name, "", ""])}
      words={name}
    />
  );
  return (
    <p class="row">
      {names.length > 1 && (
        <Select
          label="Seal or mounting"
          value={now}
          options={[ALL, ...names]}
          put={(name) => ([seal.value, other.value, level.value] = [name, "", ""])}
        />
      )}
      <span role="group" aria-label="Friction over">
        over {over("pressure")} {over("speed")}
      </span>
      {isOver ? (
        <Select label="At one speed" of={level} options={[["", "all"], ...speeds]} />
      ) : (
        <>
          <Select label="At one pressure" of={level} options={[["", "all"], ...groups.map(({ label }) => label)]} />
          <Tick
            label="speed on a logarithmic scale"
            value={isLog.value ?? isWide(groups.map((group) => groupOver("speed", MM, group)))}
            put={(isIn) => (isLog.value = isIn)}
          />
        </>
      )}
      {(seals.length > 0 || maps.length > 0) && (
        <Select label="Compare with" of={other} options={[["", "nothing"], ...seals, ...maps]} />
      )}
      {found.fits.length > 0 && names.length === 1 && (
        <Select
          label="Curves of"
          value={drawn || found.seals[now] || ""}
          options={drawn || found.seals[now] ? found.fits : [["", "choose"], ...found.fits]}
          put={(file) => (chosenFit.value = file)}
        />
      )}
    </p>
  );
}

const BARS =
  "Bars: U (k = 2), statistical and systematic. Bands: 95 % of the fitted curve; dotted beyond the measured range.";

function MapFigure({ path, fit, found, now }: { path: string; fit: string; found: FrictionMap; now: string }) {
  const isOver = isOverPressure(found.groups);
  const speed = level.value || "all";
  const [slice, problems] = useRequest<Slice>("/api/slice", isOver ? { path, fit, speed } : null, [found]);
  const isIn = ({ assembly }: { assembly: string }) => now === ALL || assembly === now;
  const groups = found.groups.filter((group) => isIn(group) && (!level.value || group.label === level.value));
  const shown = slice && { ...slice, groups: slice.groups.filter(isIn) };
  const at = shown?.groups.length === 1 ? ` at ${digits(MM * shown.groups[0]!.speed, 3)} mm/s` : "";
  const words = shown && (level.value ? "" : ` Curves hold at the mean speed of the seal${at}.`);
  const isOpen = groups.some((group) => new Set(group.points.map((point) => point.recording)).size > 1);
  const most = Math.max(...panelsOf("speed", MM, groups).map((panel) => panel.groups.length), 0);
  const hints = `${isOpen ? " Open: later runs." : ""}${most > MOST_SERIES ? " Grey: other pressures; choose one above." : ""}`;
  const figure = isOver
    ? shown && overPressure(shown, `${BARS}${words} ${found.fit}`)
    : pointsFigure({
        name: "Friction over speed",
        caption: `${BARS}${hints} ${found.fit}`,
        x: "speed, mm/s",
        y: "friction, N",
        panels: panelsOf("speed", MM, groups),
        isFromZero: true,
        isLog: isLog.value ?? isWide(groups.map((group) => groupOver("speed", MM, group))),
      });
  return (
    <div class="panel">
      <Problems of={problems} />
      {figure ? <FigureView shown={figure} /> : !problems.length && <p role="status">Reading the points.</p>}
      {isOver && shown?.python && (
        <Fold title="These curves in Python">
          <Copied of="at one speed" python={shown.python} />
        </Fold>
      )}
    </div>
  );
}

/** Two seals of the map or two maps, by their fits where both have one. */
function Comparison({ path, fit, found }: { path: string; fit: string; found: FrictionMap }) {
  const beside = [folderOf(other.value), "fit.toml"].filter(Boolean).join("/");
  const fitOfOther = found.seals[other.value] ?? (filesOf("fit").some((file) => file.path === beside) && beside);
  const pair = fit && fitOfOther ? { before: fit, after: fitOfOther } : { before: path, after: other.value };
  const [compared, problems] = usePosted<Compared>("/api/compare", pair, [found]);
  return (
    <div class="panel">
      <Problems of={problems} />
      {!problems.length && !compared && <p role="status">Comparing.</p>}
      {compared && <Differences {...compared} />}
      {compared && <Copied of="the difference" command={compared.command} python={compared.python} />}
    </div>
  );
}

function Points({ found, now }: { found: FrictionMap; now: string }) {
  const groups = found.groups.filter((group) => now === ALL || group.assembly === now);
  const points = groups.flatMap((group) => group.points.map((point) => ({ ...point, group: group.label })));
  return (
    <Fold title="Measured points">
      <Table
        label="Points of the map"
        heads={["Recording", "Direction", "Speed, mm/s", "Friction, N", "U (k = 2), N", "Chambers", "Flags"]}
        rows={points.slice(0, MOST_ROWS).map((point) => {
          const file = found.recordings[point.recording];
          return {
            cells: [
              file ? <a href={link("recording", file)}>{point.recording}</a> : point.recording,
              point.direction > 0 ? "+x" : "-x",
              digits(MM * point.speed),
              digits(point.friction),
              digits(point.spread, 2),
              point.group,
              point.flags.replaceAll(",", ", ").replaceAll("_", " "),
            ],
            data: { "data-si": point.friction },
          };
        })}
      />
      {points.length > MOST_ROWS && (
        <p class="note">{points.length - MOST_ROWS} more points are in the figure and in the file.</p>
      )}
      {found.left_out > 0 && <p class="note">{found.left_out} points are in the file only.</p>}
    </Fold>
  );
}
