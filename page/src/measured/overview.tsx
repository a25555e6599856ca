/** Recordings of the overview: friction of their seals, a row for each seal, and actions on all chosen ones. */

import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { FigurePanel } from "../plots/figure";
import { BAR, count, digits, MM } from "../plots/looks";
import { saveRows } from "../plots/saving";
import { link } from "../routes";
import type { Form, FrictionMap, Listed, Slice } from "../server/generated";
import { useRequest } from "../server/server";
import { Button, Tick } from "../workspace/fields";
import { folderOf, nameOf, studies } from "../workspace/files";
import { JobForm } from "../workspace/jobs";
import { ObjectLink, pair, partsOf, Rename, stale, trace, useHeadlines } from "../workspace/listed";
import { Findings, useView } from "../workspace/result";
import { overPressure } from "./friction";

const MOST_OPEN = 8; // recordings whose names are shown at once
const MOST = 200; // names of a row; the search of the tree finds the others
const SPARK = { width: 120, height: 36, room: 4 };

type Part = Slice["groups"][number];

const chosen = signal<string[]>([]);
const verb = signal(""); // command whose form is open for the chosen recordings

/** Box that chooses some recordings; without a label, it has a name. */
function Choose({ paths, ...looks }: { paths: string[]; label: ComponentChildren; name: string; class?: string }) {
  const choose = (isIn: boolean) => {
    const others = chosen.value.filter((path) => !paths.includes(path));
    chosen.value = isIn ? [...others, ...paths] : others;
  };
  return <Tick {...looks} value={paths.every((path) => chosen.value.includes(path))} put={choose} />;
}

/** The newest characterisation of the folder: its points over speed and over pressure. */
function useFriction(files: Listed[]) {
  const maps = files.filter((file) => file.kind === "friction map" && nameOf(file.path) === "map.parquet");
  const newest = maps.reduce<Listed | null>((best, file) => (best && best.changed >= file.changed ? best : file), null);
  const path = newest?.path ?? "";
  const given = newest && { path, fit: "" };
  const [map] = useRequest<FrictionMap>("/api/map", given, [newest?.changed]);
  const [slice] = useRequest<Slice>("/api/slice", given && { ...given, speed: "all" }, [newest?.changed]);
  return { path, map: slice && map, slice: map && slice };
}

/** Recordings by seal, mounting and drive, or by folder where nothing tells them. */
export default function Recordings({ files: all }: { files: Listed[] }) {
  const lines = useHeadlines();
  const { path, map, slice } = useFriction(all);
  const parts = partsOf(all);
  const files = all.filter((file) => file.kind === "recording" && !parts.has(file.path));
  if (!files.length) return null;
  const labelOf = ({ path: file }: Listed) => lines[file] || folderOf(file) || "Recordings here";
  const labels = [...new Set(files.map(labelOf))];
  const paths = files.map((file) => file.path);
  const isOpen = files.length <= MOST_OPEN;
  return (
    <section class="group" aria-label="Recordings">
      {map && slice && <Friction path={path} map={map} slice={slice} />}
      <div class="panel by-label">
        <Choose
          paths={paths}
          class="folder-head"
          name={`Choose all ${paths.length} recordings`}
          label={
            <>
              <a href={link("recording")}>
                <b>Recordings</b>
              </a>{" "}
              <span class="note">{`${count(files.length, "recording")}, ${count(labels.length, "group")}`}</span>
            </>
          }
        />
        <ul>
          {labels.map((label) => (
            <Row
              key={label}
              label={label}
              files={files.filter((file) => labelOf(file) === label)}
              part={slice?.groups.find((group) => group.assembly === label && isOf(group, map!, paths))}
              all={slice?.groups ?? []}
              fit={(lines[map?.seals[label] ?? ""] ?? "").replace(/: [a-z ]+$/, "")}
              isOpen={isOpen}
            />
          ))}
        </ul>
      </div>
      <Chosen paths={paths.filter((file) => chosen.value.includes(file))} map={map} slice={slice} mapPath={path} />
    </section>
  );
}

/** Return the ends of some values in words. */
const range = (values: number[], count: number): string =>
  [Math.min(...values), Math.max(...values)].map((end) => digits(end, count)).join(" to ");

/** Whether recordings of the folder made the points of a seal. */
const isOf = ({ points }: Part, { recordings }: FrictionMap, paths: string[]): boolean =>
  points.some((point) => paths.includes(recordings[point.recording] ?? ""));

/** Friction of the seals over pressure, and what needs someone. */
function Friction({ path, map, slice }: { path: string; map: FrictionMap; slice: Slice }) {
  const open = useView(path)?.findings.filter((finding) => finding.state !== "good") ?? [];
  const seals = Object.keys(map.seals).length;
  const speeds = map.groups.flatMap((group) => group.points.map((point) => point.x / MM));
  const gauges = slice.groups.flatMap((group) => group.points.map((point) => point.x / BAR));
  const recordings = count(Object.keys(map.recordings).length, "recording");
  return (
    <>
      <h3>
        <a href={link("friction", path)}>{`Friction of ${count(seals, "seal")}`}</a>{" "}
        <span class="note">{`${recordings}, ${range(gauges, 2)} bar gauge, ${range(speeds, 2)} mm/s`}</span>
      </h3>
      <div class="result">
        <FigurePanel shown={overPressure(slice, "Points: U (k = 2). Bands: 95 % of the fit.")} />
        {open.length > 0 && (
          <aside class="panel">
            <h3>What needs you</h3>
            <Findings of={open} />
          </aside>
        )}
      </div>
    </>
  );
}

/** Friction over pressure of a seal on the axes of all seals, small. */
function Spark({ part, all }: { part: Part; all: Part[] }) {
  const points = all.flatMap((group) => group.points);
  const widest = Math.max(...points.map((point) => point.x), 1);
  const highest = Math.max(...points.map((point) => point.y));
  const { width, height, room } = SPARK;
  const at = (gauge: number, friction: number) => [
    room + (Math.max(gauge, 0) / widest) * (width - 2 * room),
    height - room - (friction / highest) * (height - 2 * room),
  ];
  const line = part.curve?.x.map((gauge, k) => at(gauge, part.curve!.y[k] ?? 0).join(" "));
  return (
    <svg width={width} height={height} role="img" aria-label={`Friction of ${part.assembly} over pressure`}>
      <path d={`M0 ${height - 1}H${width}`} stroke="var(--grid)" />
      {line && <path d={`M${line.join("L")}`} fill="none" stroke="var(--fig-blue)" />}
      {part.points.map(({ x: gauge, y: friction }) => {
        const [x, y] = at(gauge, friction);
        return <circle cx={x} cy={y} r="2.2" fill="var(--fig-blue)" />;
      })}
    </svg>
  );
}

/** A seal with its friction and its recordings, each with its box, its origin and another name. */
function Row(props: {
  label: string;
  files: Listed[];
  part: Part | undefined;
  all: Part[];
  fit: string;
  isOpen: boolean;
}) {
  const { label, files, part, all, fit, isOpen } = props;
  const paths = files.map((file) => file.path);
  const flags = [...new Set(part?.points.flatMap((point) => point.flags.split(",").filter(Boolean)))];
  const friction = part?.points.map((point) => point.y) ?? [];
  const old = paths.filter((path) => stale.value.stale[path]);
  const names = (
    <>
      <ul class="chips">
        {paths.slice(0, MOST).map((path) => (
          <li key={path}>
            <Choose paths={[path]} label="" name={`Choose ${path}`} />
            <ObjectLink path={path} view="recording" name={nameOf(path)} />
            {stale.value.stale[path] && (
              <b class="missed" data-stale={path}>
                out of date
              </b>
            )}
            <details class="chip-menu">
              <summary aria-label={`More of ${path}`}>⋯</summary>
              <Button class="link" aria-label={`Made from: ${path}`} act={() => trace(path)} words="made from" />{" "}
              <Rename path={path} />
            </details>
          </li>
        ))}
      </ul>
      {paths.length > MOST && <p class="note">{paths.length - MOST} more: search for them in the tree.</p>}
    </>
  );
  return (
    <li data-label={label}>
      <Choose
        paths={paths}
        name={`Choose all of ${label}`}
        label={
          <>
            <b>{label}</b> <span class="note">{count(files.length, "recording")}</span>
          </>
        }
      />
      <span>{part && <Spark part={part} all={all} />}</span>
      <span class="holds">
        {part && (
          <>
            <b>{range(friction, 3)} N</b> {fit}
          </>
        )}
      </span>
      <span>
        {part ? (
          <span class={`pill ${flags.length ? "open" : "good"}`} title={flags.join(", ").replaceAll("_", " ")}>
            {flags.length ? count(flags.length, "flag") : "no flag"}
          </span>
        ) : (
          <span class="pill">not characterised</span>
        )}
        {old.length > 0 && <b class="missed"> out of date</b>}
      </span>
      {isOpen ? (
        names
      ) : (
        <details>
          <summary aria-label={`Recordings of ${label}`}>recordings</summary>
          {names}
        </details>
      )}
    </li>
  );
}

/** Actions on all chosen recordings. A command is offered for those that have its channels. */
function Chosen(props: { paths: string[]; map: FrictionMap | null; slice: Slice | null; mapPath: string }) {
  const { paths, map, slice, mapPath } = props;
  const [forms] = useRequest<Record<string, Form>>("/api/forms", paths.length ? {} : null, [studies.value]);
  if (!paths.length) return null;
  const able = (kind: string) => {
    const offered = forms?.[kind]?.fields.find((field) => field.kind === "recordings")?.choices ?? [];
    return paths.filter((path) => offered.some(([file]) => file === path));
  };
  const [rig, drive] = [able("characterise"), able("validate")];
  const isIn = (name: string) => paths.includes(map?.recordings[name] ?? "");
  const points = (slice?.groups ?? []).flatMap((group) =>
    group.points.filter((point) => isIn(point.recording)).map((point) => ({ ...point, label: group.assembly })),
  );
  const seals = [...new Set(points.map((point) => point.label))];
  const address = new URLSearchParams({ seal: seals[0] ?? "", with: seals[1] ?? "" });
  const save = () =>
    saveRows("recordings", [
      ["recording", "group", "direction", "pressure, bar gauge", "speed, mm/s", "friction, N", "U (k = 2), N", "flags"],
      ...points.map((point) => [
        ...[point.recording, point.label, point.direction > 0 ? "+x" : "-x"],
        ...[point.x / BAR, point.speed / MM, point.y, point.spread].map((value) => digits(value, 6)),
        point.flags,
      ]),
    ]);
  const given = verb.value === "characterise" ? rig : drive;
  const name = verb.value === "characterise" ? nameOf(folderOf(paths[0]!)) || "friction" : verb.value;
  return (
    <section class="panel chosen" aria-label="Chosen recordings">
      <p class="row">
        <b>{paths.length} chosen</b>
        <Button class="primary" disabled={!rig.length} act={() => (verb.value = "characterise")}>
          {rig.length > 1 ? `Characterise ${rig.length} together` : "Characterise"}
        </Button>
        {seals.length === 2 && (
          <a class="button" href={`${link("friction", mapPath)}?${address}`}>
            {`Compare ${seals.join(" and ")}`}
          </a>
        )}
        {seals.length !== 2 && paths.length === 2 && <Button act={() => (pair.value = paths)}>Compare</Button>}
        {drive.length > 0 && (
          <Button act={() => (verb.value = "validate")}>{`Validate a drive on ${drive.length}`}</Button>
        )}
        {points.length > 0 && <Button act={save}>Export table</Button>}
        <Button act={() => ([chosen.value, verb.value] = [[], ""])}>Clear</Button>
      </p>
      {forms && !rig.length && !drive.length && (
        <p class="note">
          Nothing tells the channels of these recordings. Open one of them, propose a layout and accept it.
        </p>
      )}
      {verb.value && given.length > 0 && (
        <JobForm key={verb.value} kind={verb.value} given={{ recordings: given }} start={{ name }} />
      )}
    </section>
  );
}
