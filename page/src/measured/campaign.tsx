/** View of a running campaign: state, cycles, map so far, journal, and requests if the server allows them. */

import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { FigurePanel } from "../plots/figure";
import { duration } from "../plots/looks";
import { pointsFigure } from "../plots/points";
import { link, route } from "../routes";
import type { Campaign, CycleHead, Plan, Problem, ShownFigure } from "../server/generated";
import { ask, attempts, frame, pause, Refused, read, typed } from "../server/server";
import { word } from "../workspace/command";
import { Button, Lines, Remarks } from "../workspace/fields";
import { kindOf, list, nameOf, pathsOf, studies } from "../workspace/files";
import { follow, JobForm, JobList, jobs, requestOf } from "../workspace/jobs";
import { Files } from "../workspace/listed";
import { Copied, Problems, ReportOf } from "../workspace/parts";
import { Answer, Findings, useView } from "../workspace/result";

const found = signal<Campaign | null>(null);
const [wrong, attempt] = attempts();
export const unread = signal<Problem[]>([]); // why the campaign could not be read, at the last look
const LOOK_MS = 500;
const HOLD_MS = 1000; // abort is held down this long
const MM = 1000;
const CYCLE_MS = 200; // between two looks at the cycle in progress
const OPEN_MS = 100; // between two looks for the folder of a new campaign

type Cycle = CycleHead & Record<"position" | "force", number[]>;

const cycle = signal<Cycle | null>(null);
const plan = signal<Plan | null>(null);

/** Read the campaign once. Answers that arrive after `isGone` are dropped. */
export async function look(path: string, isGone: () => boolean): Promise<void> {
  try {
    const now = await read<Campaign>("/api/campaign", { path });
    if (isGone()) return;
    found.value = now;
    unread.value = [];
  } catch (error) {
    if (error instanceof Refused && error.status && !isGone()) unread.value = error.problems;
  }
}

/** Do something again and again with a pause; return a function that ends this. */
function repeat(pauseMs: number, step: (isGone: () => boolean) => Promise<void>): () => void {
  let gone = false;
  const run = async () => {
    while (!gone) {
      await step(() => gone);
      await pause(pauseMs);
    }
  };
  void run();
  return () => void (gone = true);
}

export default function CampaignView() {
  const { path: object } = route.value;
  const path = kindOf(object) === "protocol" ? "" : object;
  useEffect(() => {
    found.value = null;
    wrong.value = unread.value = [];
    void follow();
    return path ? repeat(LOOK_MS, (isGone) => look(path, isGone)) : undefined;
  }, [path]);
  const isRunning = Boolean(path && found.value?.state);
  useEffect(() => {
    cycle.value = null;
    if (!isRunning) return;
    const end = repeat(CYCLE_MS, async (isGone) => {
      try {
        const { head, arrays } = await frame<CycleHead>("/api/cycle", { path });
        const of = (name: string) => Array.from(arrays.get(name) ?? []);
        if (!isGone() && head.cycle)
          cycle.value = { ...head, position: of("position_m").map((one) => MM * one), force: of("force_n") };
      } catch {
        /* the other reader reports the error */
      }
    });
    return () => (end(), void (cycle.value = null));
  }, [path, isRunning]);
  return (
    <div class="campaign">
      <h2>{path || "Campaigns"}</h2>
      <Problems of={[...unread.value, ...wrong.value]} />
      {path && (
        <p>
          <a href={link("campaign")}>All campaigns, and a new one</a>
        </p>
      )}
      {path ? found.value && <Watched now={found.value} path={path} /> : <Start protocol={object || "quick-look"} />}
    </div>
  );
}

/** A line of the journal with its time as people write it. */
const dated = (line: string): string => line.replace(/^(\d{4}-\d\d-\d\d)T(\d\d:\d\d:\d\d)\S*/, "$1 $2 ");

function cycleFigure({ cycle, samples, position, force }: Cycle): ShownFigure {
  const name = `Cycle in progress: ${cycle}, ${samples} samples`;
  const groups = [{ label: "", points: [], curve: { x: position, y: force } }];
  return pointsFigure({ name, x: "position, mm", y: "force, N", panels: [{ title: name, groups }] });
}

function frictionFigure(measured: Campaign["groups"]): ShownFigure {
  const [name, caption] = ["Friction so far", "Quick estimates."];
  const groups = measured.map(({ label, points }) => ({
    label,
    points: points.map((point) => ({ x: MM * point.speed, y: point.friction, spread: null })),
  }));
  const axes = { x: "speed, mm/s", y: "friction, N", isLog: true };
  return pointsFigure({ name, caption, ...axes, panels: [{ title: name, groups }] });
}

function Watched({ now, path }: { now: Campaign; path: string }) {
  const total = now.planned ?? now.done;
  const isOver = !now.state && now.done > 0;
  const view = useView(isOver ? path : "", now.done);
  const running = now.state === "paused" ? null : cycle.value; // what was measured last is no cycle in progress then
  return (
    <>
      {now.synthetic && <p class="banner">Synthetic: the rig is simulated.</p>}
      <p class="row" role="status" data-state={now.state ?? "none"} data-done={now.done}>
        <b>{now.name}</b>
        <span>{now.state ?? (now.done && now.done >= total ? "finished" : "no process runs this campaign")}</span>
        <progress aria-label="Finished cycles" value={now.done} max={Math.max(total, 1)} />
        <span>
          {now.done} of {total} cycles{now.extra > 0 && `, ${now.extra} beyond the plan`}
          {now.remaining_s !== null && now.done < total && `, ${duration(now.remaining_s)} left on the rig`}
        </span>
      </p>
      {now.cycle && now.state !== "paused" && (
        <p class="note">
          now: {now.cycle}
          {running && `, ${running.left} left by the clock`}
        </p>
      )}
      {view && <Answer view={view} withFindings={false} />}
      <Requests now={now} path={path} />
      <div class="result">
        <div class="result-figures">
          {running && running.position.length > 1 && (
            <FigurePanel data-cycle={running.cycle} data-samples={running.samples} shown={cycleFigure(running)} />
          )}
          {now.groups.length > 0 && <FigurePanel shown={frictionFigure(now.groups)} />}
        </div>
        <aside>
          <section class="panel" aria-label="Findings">
            <h3>What these data cannot tell</h3>
            {view && <Findings of={view.findings} />}
            <Remarks
              of={[...now.problems, ...Object.entries(now.flags).map(([flag, count]) => `flag ${flag}: ${count}`)]}
            />
            <ReportOf folder={path} />
          </section>
          {isOver && (
            <JobForm
              kind="characterise"
              given={{ campaign: path, recordings: [] }}
              start={{ name: nameOf(path) }}
              jobs={[]}
            />
          )}
          <JobList kinds={["campaign", "design", "characterise"]} />
        </aside>
      </div>
      <h2>Journal, newest first</h2>
      <Lines class="journal" name="Journal">
        {now.log.map(dated).reverse().join("\n")}
      </Lines>
    </>
  );
}

function Requests({ now, path }: { now: Campaign; path: string }) {
  const timer = useRef(0);
  const isRunning = now.state !== null;
  const send = (word: string) => attempt(() => ask("/api/campaign", { path, word }));
  const resume = () =>
    attempt(
      async () => (await ask("/api/campaigns", { resume: path, ...paced(requestOf("campaign").pace) }), void follow()),
    );
  const hold = () => {
    clearTimeout(timer.current);
    timer.current = window.setTimeout(() => void send("abort"), HOLD_MS);
  };
  const release = () => clearTimeout(timer.current);
  if (!isRunning)
    return now.synthetic && now.done < (now.planned ?? 0) ? (
      <p>
        <Button act={() => resume()}>Resume on the simulated rig</Button>
      </p>
    ) : null;
  if (!studies.value?.control)
    return (
      <p class="note">
        This server only watches. Requests: pneudrive campaign pause {word(path)}, or start the server with --control.
      </p>
    );
  return (
    <p class="row" role="group" aria-label="Requests">
      <Button act={() => send("pause")}>Pause after the cycle</Button>
      <Button act={() => send("stop")}>Stop the axis now</Button>
      <Button act={() => send("resume")}>Resume</Button>
      <Button
        onPointerDown={hold}
        onPointerUp={release}
        onPointerLeave={release}
        onKeyDown={(event) => !event.repeat && (event.key === "Enter" || event.key === " ") && hold()}
        onKeyUp={release}
        onBlur={release}
        words="Abort (hold for 1 s)"
      />
      <strong>Not an emergency stop.</strong>
    </p>
  );
}

/** Part of a request: times real time, if it is typed. */
export const paced = (pace: unknown) =>
  String(pace ?? "").trim() ? { pace: typed("Times real time", String(pace)) } : {};

/** Wait until the folder of a job exists, which is as soon as its first file exists, and open it. */
async function openFirst(job: { number: number; out: string }): Promise<void> {
  const here = route.peek();
  const isHere = () => route.peek() === here;
  const isOver = () => jobs.value.some((one) => one.number === job.number && one.state !== "running");
  for (let look = 0; look < 100 && isHere(); look++) {
    try {
      await read("/api/campaign", { path: job.out });
      void list();
      if (isHere()) location.hash = link("campaign", job.out);
      return;
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      if (isOver()) return; // the list of jobs says why
    }
    await pause(OPEN_MS);
  }
}

function Start({ protocol }: { protocol: string }) {
  const protocols = [...(studies.value?.protocols ?? []), ...pathsOf("protocol")];
  const chosen = requestOf("campaign").protocol;
  useEffect(() => void (plan.value = null), [chosen]);
  const own = {
    title: "Run",
    door: "/api/campaigns",
    fields: [
      { key: "protocol", label: "Protocol", kind: "choice", choices: protocols },
      { key: "name", label: "Into campaigns/", kind: "text" },
      { key: "pace", label: "Times real time", kind: "text", hint: "fastest" },
    ],
    body: ({ protocol, name, pace }: Record<string, unknown>) => ({ protocol, name, ...paced(pace) }),
  };
  return (
    <>
      <p>Run a protocol on the simulated rig. A real rig is started in a terminal: pneudrive campaign run.</p>
      <JobForm
        kind="campaign"
        own={own}
        start={{ protocol, name: "first", pace: "" }}
        jobs={["campaign", "design", "characterise"]}
        after={openFirst}>
        <Button act={() => attempt(async () => void (plan.value = await ask<Plan>("/api/plan", { protocol: chosen })))}>
          Plan and check
        </Button>
      </JobForm>
      {plan.value && (
        <section aria-label="Plan" data-plan={plan.value.cycles} data-si={plan.value.time_s}>
          <Lines name="Plan and pre-flight check">{plan.value.text}</Lines>
          <Copied command={plan.value.command} python={plan.value.python} />
        </section>
      )}
      <Files title="Campaigns in the folder" kinds={["campaign"]} />
    </>
  );
}
