/** View of friction maps with the curves of their fits, of comparisons of seals, and of fits of every kind. */

import { type Signal, signal, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { FigureView } from "../plots/figure";
import { digits, MM } from "../plots/looks";
import { type Group, isWide, MOST_SERIES, pointsFigure } from "../plots/points";
import { isToml, kept, link, route } from "../routes";
import type { BehindFit, Finding, FrictionMap, NextPoints, SentView, ShownFigure, Slice } from "../server/generated";
import { useRequest } from "../server/server";
import { Button, Fold, type Option, Select, Table, Tick } from "../workspace/fields";
import { changesOf, filesOf, folderOf, nameOf, pathsOf, studies } from "../workspace/files";
import { follow, JobForm, requestOf } from "../workspace/jobs";
import { Copied, Problems, ReportOf } from "../workspace/parts";
import { Answer, Figures, Findings, Shown, useView, Values } from "../workspace/result";
import Comparison from "./differences";

type Groups = FrictionMap["groups"];

const MOST_ROWS = 300;
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

/** Return the panels of a figure: one for each seal. Over speed, points of later recordings are open. */
const panelsOf = (parts: (Groups | Slice["groups"])[number][], isOverSpeed = false) =>
  [...new Set(parts.map((part) => part.assembly))].map((seal, _, all) => ({
    title: all.length > 1 ? seal : "",
    groups: parts
      .filter((part) => part.assembly === seal)
      .map(
        ({ label, points, curve }): Group => ({
          label: label.replace(`${seal}: `, ""),
          points: isOverSpeed ? points.map((point) => ({ ...point, run: point.recording })) : points,
          curve,
        }),
      ),
  }));

/** Whether speeds are drawn on a logarithmic axis: as chosen, or because they need it. */
const isLogOf = (groups: Groups): boolean => isLog.value ?? isWide(groups);

/** Friction over the pressure of a chamber, with a panel for each seal. */
export function overPressure({ chamber, groups }: Slice, caption: string): ShownFigure {
  const panels = panelsOf(groups);
  if (groups.length === panels.length) for (const panel of panels) panel.groups[0]!.label = ""; // one pressure alone
  const axes = { x: [`chamber ${chamber}, bar gauge`, 1e5] as [string, number], y: "friction, N" };
  return pointsFigure({ name: "Friction over pressure", caption, ...axes, panels, isFromZero: true });
}

/** Whether the axis is pressure: as chosen, or because pressure was varied more than speed, as a map of one seal shows. */
function isOverPressure(groups: Groups): boolean {
  if (axis.value) return axis.value === "pressure";
  const speeds = groups.flatMap((group) => group.points.map((point) => point.x));
  const counts = groups.map((group) => groups.filter((one) => one.assembly === group.assembly).length);
  return Math.max(...counts) > 1 && Math.max(...speeds) < NARROW * Math.min(...speeds);
}

export default function FrictionView() {
  const { path } = route.value;
  const isFit = isToml(path);
  const [view, problems] = useRequest<SentView>("/api/view", isFit ? { path } : null, [changesOf(path)]);
  const beside = [folderOf(path), "map.parquet"].filter(Boolean).join("/");
  const hasMap = studies.value?.files.some((file) => file.path === beside);
  const behind = useSignal("");
  if (!isFit) return <MapView key={path} path={path} fit="" />;
  if (view && hasMap && !view.figures.length && !view.curves.length)
    return <MapView key={path} path={beside} fit={path} />;
  return (
    <div class="friction">
      <h2>{path}</h2>
      <Problems of={problems} />
      {view && <Shown view={view} label="Fit" />}
      <ReportOf folder={folderOf(path)} />
      {view && <Behind path={path} of={behind} />}
      {view && !hasMap && <Apply fit={path} />}
    </div>
  );
}

const Apply = ({ fit }: { fit: string }) => (
  <Fold title="Apply it to a drive">
    <JobForm kind="apply" given={{ fit }} start={{ out: fit.replace(/\.toml$/, "-identified.toml") }} />
  </Fold>
);

/** A map, with the fit that was opened, or the fits of its folder. */
function MapView({ path, fit: opened }: { path: string; fit: string }) {
  const drawn = chosenFit.value || opened;
  useEffect(() => void (isLog.value = null), []);
  const [found, problems] = useRequest<FrictionMap>("/api/map", { path, fit: drawn }, [studies.value]);
  const whole = useView(path);
  const behind = useSignal("");
  const names = Object.keys(found?.seals ?? {});
  const ofFit = names.find((name) => opened && found!.seals[name] === opened);
  const now = [...names, ALL].includes(seal.value)
    ? seal.value
    : (ofFit ?? (names.length > 1 ? ALL : (names[0] ?? "")));
  const groups = found?.groups.filter((group) => now === ALL || group.assembly === now) ?? [];
  const isOver = found !== null && isOverPressure(found.groups);
  const fit = drawn || (found?.seals[now] ?? "");
  const seals = names.filter((name) => name !== now && found!.seals[name] && found!.seals[now]);
  const others = [...seals, ...pathsOf("friction map").filter((file) => file !== path)];
  const fitted = useView(fit);
  const name = nameOf(folderOf(path)) || nameOf(path);
  const answer = fitted ?? (fit ? null : whole);
  const remedy = ({ state }: Finding) =>
    fit && state !== "good" ? (
      <p>
        <Button act={() => (behind.value = fit)}>Plan the next points</Button>
      </p>
    ) : null;
  const again = async (job: { number: number; out: string }) => {
    await follow(job.number);
    if (route.value.path === path) chosenFit.value = job.out;
  };
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
          <p class="row">
            {names.length > 1 && (
              <Select
                label="Seal or mounting"
                value={now}
                options={[ALL, ...names]}
                put={(name) => ([seal.value, other.value, level.value] = [name, "", ""])}
              />
            )}
            <Axes isOver={isOver} groups={groups} />
            {others.length > 0 && <Select label="Compare with" of={other} options={[["", "nothing"], ...others]} />}
            {found.fits.length > 0 && names.length === 1 && (
              <Select
                label="Curves of"
                value={fit}
                options={fit ? found.fits : [["", "choose"], ...found.fits]}
                put={(file) => (chosenFit.value = file)}
              />
            )}
          </p>
          <div class="result">
            <div class="result-figures">
              {other.value ? (
                <div class="panel">
                  <Comparison {...pairOf(path, fit, found)} again={found} />
                </div>
              ) : (
                <MapFigure path={path} fit={drawn} found={found} groups={groups} isOver={isOver} />
              )}
            </div>
            <aside>
              {(fitted ?? whole) && (
                <section class="panel" aria-label="Findings">
                  <h3>What these data cannot tell</h3>
                  <Findings of={[...(fitted?.findings ?? []), ...(whole?.findings ?? [])]} remedy={remedy} />
                  <ReportOf folder={folderOf(path)} />
                </section>
              )}
              {fitted && <Values view={fitted} />}
              {fit && <Apply key={fit} fit={fit} />}
              <Fold title="Fit another law">
                <JobForm kind="fit" given={{ map: path }} jobs={["fit", "design"]} after={again} />
              </Fold>
            </aside>
          </div>
          <Points found={found} groups={groups} />
          {fit && <Behind path={fit} of={behind} />}
        </>
      )}
    </div>
  );
}

/** Choices of the axis and of a part of the points; the address keeps them. */
function Axes({ isOver, groups }: { isOver: boolean; groups: Groups }) {
  const speeds = levels(groups.flatMap((group) => group.points.map((point) => point.x))).map(
    (speed): Option => [String(speed), `${digits(speed / MM, 3)} mm/s`],
  );
  const over = (name: string) => (
    <Button
      aria-pressed={(name === "pressure") === isOver}
      act={() => ([axis.value, level.value, other.value] = [name, "", ""])}
      words={name}
    />
  );
  return (
    <>
      <span role="group" aria-label="Friction over">
        over {over("pressure")} {over("speed")}
      </span>
      {isOver ? (
        <Select label="At one speed" of={level} options={[["", "all"], ...speeds]} />
      ) : (
        <>
          <Select label="At one pressure" of={level} options={[["", "all"], ...groups.map(({ label }) => label)]} />
          <Tick label="speed on a logarithmic scale" value={isLogOf(groups)} put={(isIn) => (isLog.value = isIn)} />
        </>
      )}
    </>
  );
}

const BARS =
  "Bars: U (k = 2), statistical and systematic. Bands: 95 % of the fitted curve; dotted beyond the measured range.";

/** Groups are those of the shown seals. */
interface ShownMap {
  found: FrictionMap;
  groups: Groups;
}

function MapFigure(props: ShownMap & { path: string; fit: string; isOver: boolean }) {
  const { path, fit, found, isOver } = props;
  const speed = level.value || "all";
  const [slice, problems] = useRequest<Slice>("/api/slice", isOver ? { path, fit, speed } : null, [found]);
  const groups = props.groups.filter((group) => !level.value || group.label === level.value);
  const seals = new Set(props.groups.map((group) => group.assembly));
  const shown = slice && { ...slice, groups: slice.groups.filter((group) => seals.has(group.assembly)) };
  const at = shown?.groups.length === 1 ? ` at ${digits(shown.groups[0]!.speed / MM, 3)} mm/s` : "";
  const words = shown && (level.value ? "" : ` Curves hold at the mean speed of the seal${at}.`);
  const isOpen = groups.some((group) => new Set(group.points.map((point) => point.recording)).size > 1);
  const most = Math.max(...panelsOf(groups, true).map((panel) => panel.groups.length), 0);
  const hints = `${isOpen ? " Open: later runs." : ""}${most > MOST_SERIES ? " Grey: other pressures; choose one above." : ""}`;
  const figure = isOver
    ? shown && overPressure(shown, `${BARS}${words} ${found.fit}`)
    : pointsFigure({
        name: "Friction over speed",
        caption: `${BARS}${hints} ${found.fit}`,
        x: ["speed, mm/s", 1e-3],
        y: "friction, N",
        panels: panelsOf(groups, true),
        isFromZero: true,
        isLog: isLogOf(groups),
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

/** Return the files to compare: two seals of the map or two maps, by their fits where both have one. */
function pairOf(path: string, fit: string, { seals }: FrictionMap): { before: string; after: string } {
  const beside = [folderOf(other.value), "fit.toml"].filter(Boolean).join("/");
  const fitOfOther = seals[other.value] ?? (filesOf("fit").some((file) => file.path === beside) && beside);
  return fit && fitOfOther ? { before: fit, after: fitOfOther } : { before: path, after: other.value };
}

function Points({ found, groups }: ShownMap) {
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
              digits(point.x / MM),
              digits(point.y),
              digits(point.spread, 2),
              point.group,
              point.flags.replaceAll(",", ", ").replaceAll("_", " "),
            ],
            data: { "data-si": point.y },
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

/** Residuals, profiles, ellipses and next points of a fit, read when they are opened. `of` is the fit that is opened. */
function Behind({ path, of }: { path: string; of: Signal<string> }) {
  const [found, problems] = useRequest<BehindFit>("/api/behind", of.value === path ? { path } : null);
  useEffect(() => {
    if (found) document.getElementById("behind")?.scrollIntoView();
  }, [found]);
  return (
    <section id="behind" aria-label="Behind the fit">
      <Problems of={problems} />
      {!found ? (
        <p class="row">
          <Button act={() => (of.value = path)}>Residuals, profiles and next points of {path}</Button>
        </p>
      ) : (
        <>
          {found.view.title && <p class="note">{found.view.title}</p>}
          <Figures view={found.view} />
          {found.python && <Copied of="behind the fit" command={found.command} python={found.python} />}
          {found.designs && <Next path={path} />}
        </>
      )}
    </section>
  );
}

/** Points that a new campaign measures best, and the form that writes them as a protocol. */
function Next({ path }: { path: string }) {
  const { points } = requestOf("design");
  const given: Record<string, string> = { path, ...(points ? { points: String(points) } : {}) };
  const proposed = useSignal<typeof given | null>(null); // what was asked for
  const [found, problems] = useRequest<NextPoints>("/api/next", proposed.value);
  return (
    <>
      <h2>Next points to measure</h2>
      <JobForm kind="design" given={{ fit: path }}>
        <Button act={() => (proposed.value = given)}>Propose on the simulated rig</Button>
        <a href={link("campaign")}>Plan a campaign</a>
      </JobForm>
      <Problems of={problems} />
      {found && (
        <>
          <p>{found.view.title}</p>
          <Values view={found.view} />
          <Copied of="next points" command={found.command} python={found.python} />
        </>
      )}
    </>
  );
}
