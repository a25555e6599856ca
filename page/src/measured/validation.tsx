/**
 * View that checks a drive against its recordings: free runs, verdicts, causes of the difference, and origin of
 * each value.
 */

import { computed, signal } from "@preact/signals";
import { Fragment } from "preact";
import { useEffect } from "preact/hooks";
import { open as openDrive, valid } from "../drive/opened";
import { changed, digits, instant } from "../plots/looks";
import { curveOf, Plot } from "../plots/plot";
import { inCatalogue, link, route, undoable } from "../routes";
import type { Frame } from "../server/frame";
import type { Compared, Field, ValidationHead as Head, ValidatedRecord, Validation } from "../server/generated";
import { ask, attempts, isShowable, problemsOf, read, useLive } from "../server/server";
import { Button, Fold, type Option, Select, Table } from "../workspace/fields";
import { folderOf, kindOf, list } from "../workspace/files";
import { follow, JobForm, jobs, requestOf, useHeldOut } from "../workspace/jobs";
import { Files } from "../workspace/listed";
import { Problems, ReportOf, SliderRow } from "../workspace/parts";
import { Answer, useView, Values } from "../workspace/result";
import Differences from "./differences";

const found = signal<Validation | null>(null);
const [wrong, attempt] = attempts();
const frame = signal<Frame<Head> | null>(null);
const record = signal(0);
const span = signal<[number, number]>([0, 1]);
const key = undoable(signal(""));
const number = undoable(signal<number | null>(null));

const INPUTS = ["drive", "circuit", "fit", "recording"];
const path = computed(() =>
  route.value.view === "validation" && !INPUTS.includes(kindOf(route.value.path)) ? route.value.path : "",
);
/** Values that can have a slider: those of the file, and those that a cause names but the file lacks. */
const fields = computed(() =>
  [...(found.value?.suspects ?? []), ...(valid.value?.values ?? [])].filter((one) => one.number !== undefined),
);
const field = computed(() => fields.value.find((one) => one.key === key.value));
const changes = computed(() =>
  field.value && number.value !== null ? changed([field.value], { [key.value]: number.value }) : {},
);

async function load(at: string): Promise<void> {
  found.value = frame.value = number.value = difference.value = null;
  wrong.value = [];
  record.value = 0;
  try {
    const one = await read<Validation>("/api/validation", { path: at });
    if (path.value !== at) return;
    frame.value = null; // of the one before, which may have been answered meanwhile
    found.value = one;
    span.value = one.record[0]!.span;
    key.value = one.diagnosis.culprit?.find((cause) => cause.free.length)?.free[0] ?? "";
    if (one.editable) await openDrive(one.drive);
  } catch (error) {
    const problems = problemsOf(error);
    if (path.value === at) wrong.value = problems;
  }
}

function request(): Record<string, unknown> | null {
  if (!found.value || !path.value) return null;
  const shown = { path: path.value, record: record.value, span: span.value, pixels: 1000 };
  return { what: "validation", ...shown, changes: changes.value, drive: found.value.drive };
}

export default function ValidationView() {
  useEffect(() => void follow(), []);
  useLive<Head>(request, (answer) => isShowable(answer, wrong) && (frame.value = answer));
  useEffect(() => {
    if (path.value) void load(path.value);
  }, [path.value]);
  if (!path.value) return <Start />;
  return (
    <div class="validation">
      <h2>
        {found.value ? `Does ${found.value.name} hold?` : path.value}{" "}
        <a class="note" href={link("validation")}>
          A new validation, and all of them
        </a>
      </h2>
      <Problems of={wrong.value} />
      {!found.value && !wrong.value.length && <p role="status">Reading {path.value}.</p>}
      {found.value && <Result now={found.value} />}
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
    : object
      ? { drive: object, ...(made.length && { recordings: held }) }
      : {};
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

function Result({ now }: { now: Validation }) {
  const one = now.record[record.value] ?? now.record[0]!;
  const view = useView(path.value);
  return (
    <>
      {view && <Answer view={view} withFindings={false} />}
      {now.synthetic && <p class="banner">Synthetic: the recordings were simulated.</p>}
      {!now.drive && (
        <p class="banner">
          The validated drive is no longer in this folder, because it was changed or removed. Validate again.
        </p>
      )}
      <div class="result">
        <Runs now={now} one={one} />
        <aside>
          <div class="panel">
            <RecordingsOf now={now} />
          </div>
          <div class="panel">
            <Why now={now} />
            <Fits now={now} one={one} />
            <Suspect now={now} />
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
function RecordingsOf({ now }: { now: Validation }) {
  const show = (index: number) => ([record.value, span.value] = [index, now.record[index]!.span]);
  return (
    <>
      <Table
        label="Recordings of the validation"
        heads={["Recording", "Position, fit %", "Pressures, NRMSE %"]}
        rows={now.record.map((each, index) => {
          const channels = now.channels.map(({ column }) => each[column]);
          const pressures = channels.slice(1).map(({ free }) => free.nrmse ?? 0);
          return [
            <>
              <Button class="link" aria-pressed={index === record.value} act={() => show(index)}>
                {each.name}
              </Button>{" "}
              {each.badge && <b class={`badge ${each.badge === "held out" ? "good" : "open"}`}>{each.badge}</b>}{" "}
              {each.file && (
                <a class="note" href={link("recording", each.file)} aria-label={`Open the recording ${each.name}`}>
                  open
                </a>
              )}
            </>,
            digits(channels[0]!.free.fit_percent, 4),
            digits(100 * Math.max(...pressures), 3),
          ];
        })}
      />
      {now.drive && (
        <p>Drive: {inCatalogue(now.drive) ? now.drive : <a href={link("drive", now.drive)}>{now.drive}</a>}.</p>
      )}
      <ReportOf folder={folderOf(path.value)} />
    </>
  );
}

function Why({ now }: { now: Validation }) {
  const { culprit = [], clean, left } = now.diagnosis;
  return (
    <section aria-label="Why the model is off">
      <h2>{clean && !culprit.length ? "The model at the measured states" : "Why the model is off"}</h2>
      {!culprit.length && (
        <p>
          {clean
            ? "The balances close: the residuals are sensor noise and less than 1 % of the terms."
            : "The balances do not close, but none of the known causes explains the residuals."}
        </p>
      )}
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

function Runs({ now, one }: { now: Validation; one: ValidatedRecord }) {
  const shown = frame.value;
  const { off_s: off } = one[now.channels[0]!.column];
  return (
    <section class="panel" aria-label="Runs beside the recording" data-from={span.value[0]} data-to={span.value[1]}>
      <h3>
        {one.name} {one.badge && <b class="badge">{one.badge}</b>}{" "}
        <span class="note">
          {off === undefined ? (
            "Drag in a plot to zoom. "
          ) : (
            <Button class="link" act={() => (span.value = near(off, now.window_s, one.span))}>
              Zoom to {instant(off, now.window_s / 100)} s, where the position deviates
            </Button>
          )}
          {one.start_s
            ? ` Times count from the beginning of the recording: 0 s in this plot is ${digits(one.start_s, 12)} s in the file.`
            : ""}
        </span>
      </h3>
      {!shown ? (
        <p role="status">Reading the runs.</p>
      ) : (
        <>
          <div class="plots">
            {now.channels.map((channel, index) => (
              <Fragment key={channel.column}>
                <ChannelPlot channel={channel} of={one} isOff={false} bare={index < now.channels.length - 1} />
                {index === 0 && <ChannelPlot channel={channel} of={one} isOff bare window={now.window_s} />}
              </Fragment>
            ))}
          </div>
          <Fold title="Residuals of the pressures">
            <div class="plots">
              {now.channels.slice(1).map((channel) => (
                <ChannelPlot key={channel.column} channel={channel} of={one} isOff bare={false} window={now.window_s} />
              ))}
            </div>
          </Fold>
        </>
      )}
    </section>
  );
}

/** Return the span of a window to both sides of a time. */
const near = (time: number, window: number, [low, high]: [number, number]): [number, number] => [
  Math.max(time - window, low),
  Math.min(time + window, high),
];

const HEIGHTS = { first: 120, off: 48, other: 60 };

/** Measured and simulated values of a channel, or their difference. */
function ChannelPlot(props: {
  channel: Validation["channels"][number];
  of: ValidatedRecord;
  isOff: boolean;
  bare: boolean;
  window?: number;
}) {
  const { channel, of, isOff, bare, window = 0 } = props;
  const { column, label, size, unit } = channel;
  const { arrays, head } = frame.value!;
  const x = arrays.get("time_s")!;
  const first = isOff ? ["restarted", `from states, ${digits(window)} s`] : ["measured", "measured"];
  const runs = [first, ["free", "free run"], ...(head.fit ? [["changed", "changed"]] : [])];
  const curves = runs.map(([run, words]) => curveOf(arrays, x, `${column}.${run}${isOff ? ".residual" : ""}`, words!));
  const [from, to] = span.value;
  return (
    <Plot
      title={isOff ? `residual of ${label}` : label}
      curves={curves}
      height={isOff ? HEIGHTS.off : column === "position_m" ? HEIGHTS.first : HEIGHTS.other}
      unit={unit}
      size={size}
      bare={bare}
      range={span.value}
      onZoom={(low, high) => (span.value = [low, high])}
      onReset={from <= of.span[0] && to >= of.span[1] ? undefined : () => (span.value = of.span)}
    />
  );
}

/** Agreement of the free run in each channel, also with the changed value. */
function Fits({ now, one }: { now: Validation; one: ValidatedRecord }) {
  const changed = frame.value?.head.fit;
  return (
    <p role="group" aria-label="Fit of the free run">
      {now.channels.map(({ column, label }) => {
        const fit = one[column].free.fit_percent;
        return (
          <span key={column}>
            {label}{" "}
            <b data-fit={column} data-si={fit}>
              {digits(fit)} %
            </b>
            {changed && (
              <>
                {" → "}
                <b data-changed={column} data-si={changed[column]}>
                  {digits(changed[column])} %
                </b>
              </>
            )}{" "}
          </span>
        );
      })}
    </p>
  );
}

const optionOf = ({ key, number: at, unit }: Field): Option => [key, `${key} = ${digits(at, 4)} ${unit}`];

/** Slider that moves one value of the drive towards the recording, followed by the fit that identifies it. */
function Suspect({ now }: { now: Validation }) {
  const one = field.value;
  if (!now.editable || !fields.value.length) return null;
  const value = number.value ?? one?.number ?? 0;
  const [less, more] = [0.5, 1.5].map((factor) => factor * (one?.number ?? 0)).sort((a, b) => a - b);
  const isChanged = value !== one?.number;
  const put = (next: number) => (number.value = Number.isFinite(next) ? next : null);
  return (
    <section aria-label="Suspect">
      <h3>Try it: move a value towards the recording</h3>
      <p>
        <Select
          label="Value"
          value={key.value}
          options={[["", "choose"], ...fields.value.map(optionOf)]}
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
          put={put}
        />
      )}
      {key.value && <Refit now={now} />}
    </section>
  );
}

const difference = signal<Compared | null>(null);

/** Identify the suspect value from these recordings, write it into a new drive file, and show the differences. */
function Refit({ now }: { now: Validation }) {
  const has = (file: string) => kindOf(file) !== "";
  const folder = folderOf(path.value);
  const fit = `${folder && `${folder}/`}fit-${key.value.replace(/[^\w]+/g, "-")}.toml`;
  const target = String(requestOf("apply").out ?? "");
  const name = now.drive.replace(/^catalogue:/, "").replace(/\.toml$/, "");
  const isWithout = now.record.some((one) => !one.file);
  const compare = () =>
    attempt(async () => void (difference.value = await ask("/api/compare", { before: now.drive, after: target })));
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
              <Button act={() => compare()}>Compare with {now.drive}</Button>
              <a class="button primary" href={link("validation", target)}>
                Validate it on held-out recordings
              </a>
            </>
          )}
        </JobForm>
      )}
      {difference.value && <Differences {...difference.value} />}
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
