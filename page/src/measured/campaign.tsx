/** View of a running campaign: state, cycles, map so far, journal, and requests if the server allows them. */

import { useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { FigurePanel } from "../plots/figure";
import { duration } from "../plots/looks";
import { pointsFigure } from "../plots/points";
import { link, route } from "../routes";
import type { Frame } from "../server/frame";
import type { Campaign, CycleHead, Plan, ShownFigure } from "../server/generated";
import { ask, attempts, frame, read, usePosted, useWatched } from "../server/server";
import { word } from "../workspace/command";
import { Button, Lines, Remarks } from "../workspace/fields";
import { kindOf, nameOf, pathsOf, studies } from "../workspace/files";
import { follow, JobForm, JobList, jobs, requestOf } from "../workspace/jobs";
import { Files } from "../workspace/listed";
import { Copied, Problems, ReportOf } from "../workspace/parts";
import { Answer, Findings, useView } from "../workspace/result";

const [wrong, attempt] = attempts();
const LOOK_MS = 500;
const HOLD_MS = 1000; // abort is held down this long
const CYCLE_MS = 200; // between two looks at the cycle in progress

export default function CampaignView() {
  const { path: object } = route.value;
  const path = kindOf(object) === "protocol" ? "" : object;
  const [now, problems] = useWatched(
    path,
    () => read<Campaign>("/api/campaign", { path }),
    () => LOOK_MS,
  );
  useEffect(() => void (wrong.value = []), [path]);
  const isBeginning = jobs.value.some((job) => job.out === path && job.state === "running"); // without a file yet
  return (
    <div class="campaign">
      <h2>{path || "Campaigns"}</h2>
      <Problems of={[...(isBeginning ? [] : problems), ...wrong.value]} />
      {path && (
        <p>
          <a href={link("campaign")}>All campaigns, and a new one</a>
        </p>
      )}
      {path && !now && <JobList of={path} />}
      {path ? now && <Watched now={now} path={path} /> : <Start protocol={object || "quick-look"} />}
    </div>
  );
}

/** A line of the journal with its time as people write it. */
const dated = (line: string): string => line.replace(/^(\d{4}-\d\d-\d\d)T(\d\d:\d\d:\d\d)\S*/, "$1 $2 ");

/** Force over position of the cycle in progress. */
function CycleFigure({ now: { head, arrays } }: { now: Frame<CycleHead> }) {
  const [position, force] = ["position_m", "force_n"].map((name) => Array.from(arrays.get(name) ?? []));
  if (position!.length < 2) return null;
  const name = `Cycle in progress: ${head.cycle}, ${head.samples} samples`;
  const groups = [{ label: "", points: [], curve: { x: position!, y: force! } }];
  const shown = pointsFigure({ name, x: ["position, mm", 1e-3], y: "force, N", panels: [{ title: name, groups }] });
  return <FigurePanel data-cycle={head.cycle} data-samples={head.samples} shown={shown} />;
}

function frictionFigure(groups: Campaign["groups"]): ShownFigure {
  const [name, caption] = ["Friction so far", "Quick estimates."];
  const panels = [{ title: name, groups }];
  return pointsFigure({ name, caption, x: ["speed, mm/s", 1e-3], y: "friction, N", isLog: true, panels });
}

function Watched({ now, path }: { now: Campaign; path: string }) {
  const total = now.planned ?? now.done;
  const isOver = !now.state && now.done > 0;
  const view = useView(isOver ? path : "", now.done);
  const isMoving = now.state && now.state !== "paused"; // what was measured last is no cycle in progress then
  const [live] = useWatched(
    isMoving ? path : "",
    () => frame<CycleHead>("/api/cycle", { path }),
    () => CYCLE_MS,
  );
  const running = live?.head.cycle ? live : null;
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
          {running && `, ${running.head.left} left by the clock`}
        </p>
      )}
      {view && <Answer view={view} withFindings={false} />}
      <Requests now={now} path={path} />
      <div class="result">
        <div class="result-figures">
          {running && <CycleFigure now={running} />}
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
  const send = (word: string) => attempt(() => ask("/api/campaign", { path, word }));
  const pace = Number(requestOf("campaign").pace);
  const again = { resume: path, ...(pace && { pace }) };
  const resume = () => attempt(async () => (await ask("/api/campaigns", again), void follow()));
  const hold = () => {
    clearTimeout(timer.current);
    timer.current = window.setTimeout(() => void send("abort"), HOLD_MS);
  };
  const release = () => clearTimeout(timer.current);
  if (now.state === null)
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

function Start({ protocol }: { protocol: string }) {
  const protocols = [...(studies.value?.protocols ?? []), ...pathsOf("protocol")];
  const chosen = requestOf("campaign").protocol;
  const planned = useSignal<unknown>(""); // protocol whose plan is asked for
  const [plan, problems] = usePosted<Plan>("/api/plan", planned.value === chosen ? { protocol: chosen } : null);
  const own = {
    title: "Run",
    door: "/api/campaigns",
    fields: [
      { key: "protocol", label: "Protocol", kind: "choice", choices: protocols },
      { key: "name", label: "Into campaigns/", kind: "text" },
      { key: "pace", label: "Times real time", kind: "number", hint: "fastest", start: null },
    ],
    body: ({ protocol, name, pace }: Record<string, unknown>) => ({ protocol, name, pace }),
  };
  return (
    <>
      <p>Run a protocol on the simulated rig. A real rig is started in a terminal: pneudrive campaign run.</p>
      <JobForm
        kind="campaign"
        own={own}
        start={{ protocol, name: "first", pace: "" }}
        jobs={["campaign", "design", "characterise"]}
        after={({ out }) => void (location.hash = link("campaign", out))}>
        <Button act={() => (planned.value = chosen)}>Plan and check</Button>
      </JobForm>
      <Problems of={problems} />
      {plan && (
        <section aria-label="Plan" data-plan={plan.cycles} data-si={plan.time_s}>
          <Lines name="Plan and pre-flight check">{plan.text}</Lines>
          <Copied {...plan} />
        </section>
      )}
      <Files title="Campaigns in the folder" kinds={["campaign"]} />
    </>
  );
}
