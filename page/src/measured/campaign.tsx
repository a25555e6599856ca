/** View of a running campaign: state, cycles, map so far, journal, and requests if the server allows them. */

import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { FigureView } from "../plots/figure";
import { duration } from "../plots/looks";
import { pointsFigure } from "../plots/points";
import { link, route } from "../routes";
import { ask, attempting, frame, type Problem, Refused, read, typed } from "../server/server";
import { word } from "../workspace/command";
import { kindOf, list, nameOf, studies } from "../workspace/files";
import { JobForm } from "../workspace/form";
import { follow, JobList, jobs } from "../workspace/jobs";
import { Copied, InFolder, Problems, ReportOf, Select } from "../workspace/parts";
import { Answer, Findings, useView } from "../workspace/result";

interface Campaign {
  name: string;
  rig: string;
  synthetic: boolean;
  done: number;
  extra: number;
  planned: number | null;
  remaining_s: number | null;
  state: string | null;
  text: string;
  cycle: string;
  flags: Record<string, number>;
  problems: string[];
  log: string[];
  groups: { label: string; points: { key: string; speed: number; friction: number; flags: string[] }[] }[];
}

const found = signal<Campaign | null>(null);
const wrong = signal<Problem[]>([]);
export const unread = signal<Problem[]>([]); // why the campaign could not be read, at the last look
const attempt = attempting(wrong);
const protocol = signal("quick-look");
const name = signal("first");
export const pace = signal("");
const LOOK_MS = 500;
const HOLD_MS = 1000; // abort is held down this long
const MM = 1000;
const CYCLE_MS = 200; // between two looks at the cycle in progress

interface Cycle {
  cycle: string;
  left: string;
  samples: number;
  position: number[];
  force: number[];
}

interface Plan {
  text: string;
  time_s: number;
  cycles: number;
  command: string;
  python: string;
}

const cycle = signal<Cycle | null>(null);
const plan = signal<Plan | null>(null);

/** Read the campaign once. Answers that arrive after `isGone` are dropped. */
export async function look(path: string, isGone: () => boolean): Promise<void> {
  try {
    const now = await read<Campaign>("/api/campaign", { path });
    if (isGone()) return;
    /* The map is drawn again only if it grew. */
    const grew = JSON.stringify(now.groups) !== JSON.stringify(found.value?.groups);
    found.value = grew || !found.value ? now : { ...now, groups: found.value.groups };
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
      await new Promise((resolve) => setTimeout(resolve, pauseMs));
    }
  };
  void run();
  return () => void (gone = true);
}

export function CampaignView() {
  const { path: object } = route.value;
  const path = kindOf(object) === "protocol" ? "" : object;
  useEffect(() => void (object && !path && (protocol.value = object)), [object, path]);
  useEffect(() => {
    found.value = null;
    wrong.value = unread.value = [];
    void follow();
    if (!path) return;
    return repeat(LOOK_MS, (isGone) => look(path, isGone));
  }, [path]);
  const isRunning = Boolean(path && found.value?.state);
  useEffect(() => {
    cycle.value = null;
    if (!isRunning) return;
    const end = repeat(CYCLE_MS, async (isGone) => {
      try {
        const { head, arrays } = await frame<Pick<Cycle, "cycle" | "left" | "samples">>("/api/cycle", { path });
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
      {path ? found.value && <Watched now={found.value} path={path} /> : <Start />}
    </div>
  );
}

/** A line of the journal with its time as people write it. */
const dated = (line: string): string => line.replace(/^(\d{4}-\d\d-\d\d)T(\d\d:\d\d:\d\d)\S*/, "$1 $2 ");

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
            <div class="panel" data-cycle={running.cycle} data-samples={running.samples}>
              <FigureView
                shown={pointsFigure({
                  name: `Cycle in progress: ${running.cycle}, ${running.samples} samples`,
                  ...{ x: "position, mm", y: "force, N" },
                  panels: [
                    {
                      title: `Cycle in progress: ${running.cycle}, ${running.samples} samples`,
                      groups: [{ label: "", points: [], curve: { x: running.position, y: running.force } }],
                    },
                  ],
                })}
              />
            </div>
          )}
          {now.groups.length > 0 && (
            <div class="panel">
              <FigureView
                shown={pointsFigure({
                  name: "Friction so far",
                  caption: "Quick estimates.",
                  ...{ x: "speed, mm/s", y: "friction, N", isLog: true },
                  panels: [
                    {
                      title: "Friction so far",
                      groups: now.groups.map(({ label, points }) => ({
                        label,
                        points: points.map((point) => ({ x: MM * point.speed, y: point.friction, spread: null })),
                      })),
                    },
                  ],
                })}
              />
            </div>
          )}
        </div>
        <aside>
          <section class="panel" aria-label="Findings">
            <h3>What these data cannot tell</h3>
            {view && <Findings of={view.findings} />}
            {now.problems.map((one) => (
              <p class="note" key={one}>
                {one}
              </p>
            ))}
            {Object.entries(now.flags).map(([flag, count]) => (
              <p class="note" key={flag}>
                flag {flag}: {count}
              </p>
            ))}
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
      <pre class="journal" tabIndex={0} role="group" aria-label="Journal">
        {now.log.map(dated).reverse().join("\n")}
      </pre>
    </>
  );
}

function Requests({ now, path }: { now: Campaign; path: string }) {
  const timer = useRef(0);
  const isRunning = now.state !== null;
  const send = (word: string) => attempt(() => ask("/api/campaign", { path, word }));
  const resume = () => attempt(async () => (await ask("/api/campaigns", { resume: path, ...paced() }), void follow()));
  const hold = () => {
    clearTimeout(timer.current);
    timer.current = window.setTimeout(() => void send("abort"), HOLD_MS);
  };
  const release = () => clearTimeout(timer.current);
  if (!isRunning)
    return now.synthetic && now.done < (now.planned ?? 0) ? (
      <p>
        <button type="button" onClick={() => void resume()}>
          Resume on the simulated rig
        </button>
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
      <button type="button" onClick={() => void send("pause")}>
        Pause after the cycle
      </button>
      <button type="button" onClick={() => void send("stop")}>
        Stop the axis now
      </button>
      <button type="button" onClick={() => void send("resume")}>
        Resume
      </button>
      <button
        type="button"
        onPointerDown={hold}
        onPointerUp={release}
        onPointerLeave={release}
        onKeyDown={(event) => !event.repeat && (event.key === "Enter" || event.key === " ") && hold()}
        onKeyUp={release}
        onBlur={release}>
        Abort (hold for 1 s)
      </button>
      <strong>Not an emergency stop.</strong>
    </p>
  );
}

export const paced = () => (pace.value.trim() ? { pace: typed("Times real time", pace.value) } : {});

function Start() {
  const files = studies.value?.files ?? [];
  const protocols = [
    ...(studies.value?.protocols ?? []),
    ...files.filter((one) => one.kind === "protocol").map((one) => one.path),
  ];
  const campaigns = files.filter((one) => one.kind === "campaign");
  const start = () =>
    attempt(async () => {
      const job = await ask<{ number: number; out: string }>("/api/campaigns", {
        protocol: protocol.value,
        name: name.value,
        ...paced(),
      });
      void follow();
      const here = route.peek();
      const isHere = () => route.peek() === here;
      const isOver = () => jobs.value.some((one) => one.number === job.number && one.state !== "running");
      /* The folder exists as soon as its first file exists. */
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
        await new Promise((resolve) => setTimeout(resolve, 100));
      }
    });
  const asked = () => ({ protocol: protocol.value });
  return (
    <>
      <p>Run a protocol on the simulated rig. A real rig is started in a terminal: pneudrive campaign run.</p>
      <div class="fieldset">
        <Select
          label="Protocol"
          value={protocol.value}
          options={protocols}
          put={(name) => ([protocol.value, plan.value] = [name, null])}
        />
        <label class="choice">
          Into campaigns/ <input value={name.value} onInput={(event) => (name.value = event.currentTarget.value)} />
        </label>
        <label class="choice">
          Times real time{" "}
          <input
            value={pace.value}
            placeholder="fastest"
            onInput={(event) => (pace.value = event.currentTarget.value)}
          />
        </label>
      </div>
      <p class="row">
        <button
          type="button"
          class="primary"
          onClick={() => void attempt(async () => void (plan.value = await ask<Plan>("/api/plan", asked())))}>
          Plan and check
        </button>
        <button type="button" onClick={() => void start()}>
          Run
        </button>
      </p>
      {plan.value && (
        <section aria-label="Plan" data-plan={plan.value.cycles} data-si={plan.value.time_s}>
          <pre tabIndex={0} role="group" aria-label="Plan and pre-flight check">
            {plan.value.text}
          </pre>
          <Copied command={plan.value.command} python={plan.value.python} />
        </section>
      )}
      <JobList kinds={["campaign", "design", "characterise"]} />
      <InFolder files={campaigns} title="Campaigns" view="campaign" />
    </>
  );
}
