/**
 * View that checks a drive against its recordings: free runs, verdicts, causes of the difference, and origin of
 * each value.
 */

import { type Signal, signal, useComputed, useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { open as openDrive, valid } from "../drive/opened";
import { changed, digits, instant } from "../plots/looks";
import { curveOf, Plot, zooming } from "../plots/plot";
import { inCatalogue, link, route, undoable } from "../routes";
import type { Frame } from "../server/frame";
import type { Field, ValidationHead as Head, Problem, ValidatedRecord, Validation } from "../server/generated";
import { isShowable, useLive, useRequest } from "../server/server";
import { Button, Fold, type Option, Select, Table } from "../workspace/fields";
import { folderOf, kindOf, list } from "../workspace/files";
import { follow, JobForm, jobs, requestOf, useHeldOut } from "../workspace/jobs";
import { Files } from "../workspace/listed";
import { Problems, ReportOf, SliderRow } from "../workspace/parts";
import { Answer, useView, Values } from "../workspace/result";
import Comparison from "./differences";

const INPUTS = ["drive", "circuit", "fit", "recording"];
/** Value that the slider moves, and its number; null: that of the drive. */
const key = undoable(signal(""));
const number = undoable(signal<number | null>(null));

/** Values that can have a slider: those of the file, and those that a cause names but the file lacks. */
const fieldsOf = ({ suspects }: Validation): Field[] =>
  [...suspects, ...(valid.value?.values ?? [])].filter((one) => one.number !== undefined);

export default function ValidationView() {
  const { path: object } = route.value;
  const path = INPUTS.includes(kindOf(object)) ? "" : object;
  const [found, problems] = useRequest<Validation>("/api/validation", path ? { path } : null);
  if (!path) return <Start />;
  return (
    <div class="validation">
      <h2>
        {found ? `Does ${found.name} hold?` : path}{" "}
        <a class="note" href={link("validation")}>
          A new validation, and all of them
        </a>
      </h2>
      <Problems of={problems} />
      {!found && !problems.length && <p role="status">Reading {path}.</p>}
      {found && <Result key={path} path={path} now={found} />}
    </div>
  );
}

/** Form of a validation. Recordings that did not make the values of the drive are chosen to begin with. */
function Start() {
  const { path: object } = route.value;
  const isRecording = kindOf(object) === "recording";
  const { made, offered } = useHeldOut(isRecording ? "" : object);
  const held = offered.filter((file) => !made.includes(file));
  const begin = isRecording
    ? { recordings: [object] }
    : { ...(object && { drive: object }), ...(made.length && { recordings: held }) };
  const here = route.value;
  const after = async (job: { number: number; out: string }) => {
    await follow(job.number);
    await list();
    const isDone = jobs.value.some((one) => one.number === job.number && one.state === "done");
    if (isDone && route.peek() === here) location.hash = link("validation", `${job.out}/validation.toml`);
  };
  return (
    <>
      <h2>Does my model hold?</h2>
      <p>
        The drive runs under the recorded command; the page shows where it leaves the recording, and what would explain
        it.
      </p>
      {made.length > 0 && !held.length && (
        <p class="banner">
          Every recording that works here made the values of {object}. Add another recording to test them.
        </p>
      )}
      <JobForm kind="validate" start={{ name: "validation", ...begin }} after={after} />
      <Files title="Validations in the folder" kinds={["validation"]} />
    </>
  );
}

/** A validation. Its state begins anew with each one. */
function Result({ path, now }: { path: string; now: Validation }) {
  const record = useSignal(0);
  const one = now.record[record.value]!;
  const zoom = useSignal<[number, number] | null>(null); // the part of the time that is shown
  const frame = useSignal<Frame<Head> | null>(null);
  const wrong = useSignal<Problem[]>([]);
  const view = useView(path);
  const changes = useComputed(() => {
    const field = fieldsOf(now).find((each) => each.key === key.value);
    return field && number.value !== null ? changed([field], { [key.value]: number.value }) : {};
  });
  useEffect(() => {
    [key.value, number.value] = [now.diagnosis.culprit?.find((cause) => cause.free.length)?.free[0] ?? "", null];
    if (now.editable) void openDrive(now.drive);
  }, []);
  useLive<Head>(
    () => {
      const span = zoom.value ?? now.record[record.value]!.span;
      const shown = { path, record: record.value, span, pixels: 1000 };
      return { what: "validation", ...shown, changes: changes.value, drive: now.drive };
    },
    (answer) => isShowable(answer, wrong) && (frame.value = answer),
  );
  const show = (index: number) => ([record.value, zoom.value] = [index, null]);
  return (
    <>
      <Problems of={wrong.value} />
      {view && <Answer view={view} withFindings={false} />}
      {now.synthetic && <p class="banner">Synthetic: the recordings were simulated.</p>}
      {!now.drive && (
        <p class="banner">
          The validated drive is no longer in this folder, because it was changed or removed. Validate again.
        </p>
      )}
      <div class="result">
        <Runs now={now} one={one} frame={frame} zoom={zoom} />
        <aside>
          <div class="panel">
            <RecordingsOf now={now} shown={record.value} show={show} />
            {now.drive && (
              <p>Drive: {inCatalogue(now.drive) ? now.drive : <a href={link("drive", now.drive)}>{now.drive}</a>}.</p>
            )}
            <ReportOf folder={folderOf(path)} />
          </div>
          <div class="panel">
            <Why now={now} />
            <Fits now={now} one={one} frame={frame} />
            <Suspect now={now} folder={folderOf(path)} />
          </div>
        </aside>
      </div>
      {view && (
        <Fold title="Numbers, stops, conditions and notes">
          <Values view={view} />
        </Fold>
      )}
      <Origins now={now} />
    </>
  );
}

/** The recordings with their badges; one of them is drawn. */
function RecordingsOf({ now, shown, show }: { now: Validation; shown: number; show: (index: number) => void }) {
  return (
    <Table
      label="Recordings of the validation"
      heads={["Recording", "Position, fit %", "Pressures, NRMSE %"]}
      rows={now.record.map((each, index) => {
        const [position, ...pressures] = now.channels.map(({ column }) => each[column].free);
        return [
          <>
            <Button class="link" aria-pressed={index === shown} act={() => show(index)} words={each.name} />{" "}
            {each.badge && <b class={`badge ${each.badge === "held out" ? "good" : "open"}`}>{each.badge}</b>}{" "}
            {each.file && (
              <a class="note" href={link("recording", each.file)} aria-label={`Open the recording ${each.name}`}>
                open
              </a>
            )}
          </>,
          digits(position!.fit_percent, 4),
          digits(100 * Math.max(...pressures.map(({ nrmse }) => nrmse ?? 0)), 3),
        ];
      })}
    />
  );
}

function Why({ now }: { now: Validation }) {
  const { culprit = [], clean, left } = now.diagnosis;
  const words = clean
    ? "The balances close: the residuals are sensor noise and less than 1 % of the terms."
    : "The balances do not close, but none of the known causes explains the residuals.";
  return (
    <section aria-label="Why the model is off">
      <h2>{clean && !culprit.length ? "The model at the measured states" : "Why the model is off"}</h2>
      {!culprit.length && <p>{words}</p>}
      {culprit.map((cause) => (
        <div key={cause.what} class="cause" data-cause={cause.what}>
          <p>{cause.text}</p>
          <meter min={0} max={1} value={cause.share} aria-label={`Share explained by ${cause.what}`} />{" "}
          {cause.free.map((one) => (
            <Button key={one} class="link" act={() => ((key.value = one), (number.value = null))}>
              Slider for {one}
            </Button>
          ))}
        </div>
      ))}
      {culprit.length > 0 && (
        <p class="note">{digits(100 * left, 2)} % of the residual remains without an explanation.</p>
      )}
    </section>
  );
}

interface ShownRun {
  now: Validation;
  one: ValidatedRecord;
  frame: Signal<Frame<Head> | null>;
}

const HEIGHTS = { position_m: 120, residual: 48, pressure: 60 };

/** Measured and simulated values of each channel, and their differences. */
function Runs({ now, one, frame, zoom }: ShownRun & { zoom: Signal<[number, number] | null> }) {
  const [low, high] = one.span;
  const [from, to] = zoom.value ?? one.span;
  const { window_s: window, channels } = now;
  const { off_s: off } = one[channels[0]!.column];
  const plot = ({ column, label, size, unit }: Validation["channels"][number], isResidual: boolean, bare: boolean) => {
    const { head, arrays } = frame.value!;
    const first = isResidual ? ["restarted", `from states, ${digits(window)} s`] : ["measured", "measured"];
    const runs = [first, ["free", "free run"], ...(head.fit ? [["changed", "changed"]] : [])];
    const columnOf = (run: string) => `${column}.${run}${isResidual ? ".residual" : ""}`;
    const height = column === "position_m" ? HEIGHTS.position_m : HEIGHTS.pressure;
    return (
      <Plot
        key={`${column} ${isResidual}`}
        title={isResidual ? `residual of ${label}` : label}
        curves={runs.map(([run, words]) => curveOf(arrays, arrays.get("time_s")!, columnOf(run!), words!))}
        height={isResidual ? HEIGHTS.residual : height}
        unit={unit}
        size={size}
        bare={bare}
        {...zooming(zoom)}
      />
    );
  };
  return (
    <section class="panel" aria-label="Runs beside the recording" data-from={from} data-to={to}>
      <h3>
        {one.name} {one.badge && <b class="badge">{one.badge}</b>}{" "}
        <span class="note">
          {off === undefined ? (
            "Drag in a plot to zoom. "
          ) : (
            <Button class="link" act={() => (zoom.value = [Math.max(off - window, low), Math.min(off + window, high)])}>
              Zoom to {instant(off, window / 100)} s, where the position deviates
            </Button>
          )}
          {one.start_s
            ? ` Times count from the beginning of the recording: 0 s in this plot is ${digits(one.start_s, 12)} s in the file.`
            : ""}
        </span>
      </h3>
      {!frame.value ? (
        <p role="status">Reading the runs.</p>
      ) : (
        <>
          <div class="plots">
            {channels.flatMap((channel, index) => [
              plot(channel, false, index < channels.length - 1),
              ...(index === 0 ? [plot(channel, true, true)] : []),
            ])}
          </div>
          <Fold title="Residuals of the pressures">
            <div class="plots">{channels.slice(1).map((channel) => plot(channel, true, false))}</div>
          </Fold>
        </>
      )}
    </section>
  );
}

/** Agreement of the free run in each channel, also with the changed value. */
function Fits({ now, one, frame }: ShownRun) {
  const changed = frame.value?.head.fit;
  return (
    <Table
      label="Fit of the free run"
      heads={["Fit of the free run", "%", ...(changed ? ["changed, %"] : [])]}
      rows={now.channels.map(({ column, label }) => {
        const cell = (name: string, fit: number | null | undefined) => ({
          text: digits(fit),
          data: { [`data-${name}`]: column, "data-si": fit },
        });
        return [
          label,
          cell("fit", one[column].free.fit_percent),
          ...(changed ? [cell("changed", changed[column])] : []),
        ];
      })}
    />
  );
}

const optionOf = ({ key, number: at, unit }: Field): Option => [key, `${key} = ${digits(at, 4)} ${unit}`];

/** Slider that moves one value of the drive towards the recording, followed by the fit that identifies it. */
function Suspect({ now, folder }: { now: Validation; folder: string }) {
  const fields = fieldsOf(now);
  const one = fields.find((field) => field.key === key.value);
  if (!now.editable || !fields.length) return null;
  const value = number.value ?? one?.number ?? 0;
  const [less, more] = [0.5, 1.5].map((factor) => factor * (one?.number ?? 0)).sort((a, b) => a - b);
  const isChanged = value !== one?.number;
  return (
    <section aria-label="Suspect">
      <h3>Try it: move a value towards the recording</h3>
      <p>
        <Select
          label="Value"
          value={key.value}
          options={[["", "choose"], ...fields.map(optionOf)]}
          put={(name) => ([key.value, number.value] = [name, null])}
        />
      </p>
      {one && (
        <SliderRow
          of={one}
          id="suspect"
          shown={isChanged ? value : digits(value, 4)}
          ends={[less || one.low!, more || one.high!]}
          kind={isChanged ? "changed" : one.kind}
          value={value}
          put={(next) => (number.value = Number.isFinite(next) ? next : null)}
        />
      )}
      {key.value && <Refit now={now} folder={folder} />}
    </section>
  );
}

/** Identify the suspect value from these recordings, write it into a new drive file, and show the differences. */
function Refit({ now, folder }: { now: Validation; folder: string }) {
  const has = (file: string) => kindOf(file) !== "";
  const fit = `${folder && `${folder}/`}fit-${key.value.replace(/[^\w]+/g, "-")}.toml`;
  const target = String(requestOf("apply").out ?? "");
  const name = now.drive.replace(/^catalogue:/, "").replace(/\.toml$/, "");
  const isWithout = now.record.some((one) => !one.file);
  const chosen = useSignal(""); // file that is compared with the drive
  return (
    <>
      <JobForm
        kind="identify"
        given={{ drive: now.drive, recordings: now.record.map((one) => one.file), out: fit }}
        start={{ free: key.value }}
        isReady={!isWithout && !has(fit)}>
        {has(fit) && <a href={link("friction", fit)}>{fit}</a>}
      </JobForm>
      {isWithout && (
        <p class="note">A recording of this validation is not in the folder any more, or others have its name.</p>
      )}
      {has(fit) && (
        <JobForm
          kind="apply"
          given={{ drive: now.drive, fit }}
          start={{ out: `${name}-identified.toml` }}
          isReady={!has(target)}
          jobs={[]}>
          {has(target) && (
            <>
              <a href={link("drive", target)}>{target}</a>
              <Button act={() => (chosen.value = target)}>Compare with {now.drive}</Button>
              <a class="button primary" href={link("validation", target)}>
                Validate it on held-out recordings
              </a>
            </>
          )}
        </JobForm>
      )}
      {chosen.value && <Comparison before={now.drive} after={chosen.value} />}
    </>
  );
}

function Origins({ now }: { now: Validation }) {
  if (!now.values.length) return null;
  return (
    <Fold title="Where each value comes from">
      <Table
        label="Values of the drive"
        heads={["Key", "Value", "Where it comes from", "95 % interval", "Recordings", "Fit"]}
        rows={now.values.map((one) => ({
          cells: [
            one.key,
            one.text,
            <>
              <span class={`kind ${one.kind}`}>{one.kind}</span> {one.origin.replace(/^assumed: /, "")}
            </>,
            one.interval,
            one.source?.map((each) => (
              <span key={each.name}>
                {each.file ? <a href={link("recording", each.file)}>{each.name}</a> : each.name}{" "}
              </span>
            )),
            one.fit && <a href={link("friction", one.fit)}>{one.fit}</a>,
          ],
          data: { "data-origin": one.key },
        }))}
      />
    </Fold>
  );
}
