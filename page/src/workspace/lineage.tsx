/** Lineage of a file: its inputs by the hashes that the file carries, and the files made from it. */

import { effect, signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { route } from "../routes";
import type { Lineage, Made, Stale } from "../server/generated";
import { ask, attempts, problemsOf, read } from "../server/server";
import { useRequest } from "./answers";
import { Button } from "./fields";
import { list, studies } from "./files";
import { follow } from "./jobs";
import { Problems, useCopied } from "./parts";
import { ObjectLink } from "./tree";

/** Text of each state of an input. */
const STATES: Record<Made["state"], string> = {
  same: "unchanged",
  changed: "changed since the file was made",
  differs: "its values changed, or values were set for this run",
  missing: "not in the folder any more, or renamed",
  named: "known only by name: the result does not contain its hash",
  unread: "not checked: too long, or no longer readable",
};

/** Contents of the files, in a line each. */
const headlines = signal<Record<string, string>>({});
let told: unknown = null; // the list whose lines are read

/** Read the lines of the present list, while a view shows them. */
export function useHeadlines(): Record<string, string> {
  const now = studies.value;
  useEffect(() => {
    if (!now || now === told) return;
    const timer = setTimeout(() => {
      if (now === told) return; // another list of the view asked
      told = now;
      void attempt(async () => void (headlines.value = await read<Record<string, string>>("/api/headlines")));
    }, QUIET_MS);
    return () => clearTimeout(timer);
  }, [now]);
  return headlines.value;
}

export const stale = signal<Stale>({ stale: {}, unchecked: 0 });
const traced = signal("");
const [wrong, attempt] = attempts();

const QUIET_MS = 1000; // after the list: what is opened at once does not wait for the hashes
let waiting = 0;

/** Check, while the list is shown, which results are older than their inputs. */
effect(() => {
  if (!studies.value) return;
  clearTimeout(waiting);
  waiting = setTimeout(() => void (route.peek().view === "studies" && checkAll()), QUIET_MS);
});

const checkAll = (): Promise<unknown> => read<Stale>("/api/stale").then((found) => (stale.value = found), problemsOf);

/** Show the lineage of a file. */
export const trace = (path: string): void => void (traced.value = path);

function Inputs({ of }: { of: Made[] }) {
  if (!of.length) return null;
  return (
    <ul class="lineage">
      {of.map((one, index) => (
        <li key={index} data-input={one.path || one.name} data-state={one.state}>
          {one.kind}: {one.path ? <ObjectLink path={one.path} /> : one.name}{" "}
          <span class={one.state === "changed" ? "missed" : "note"}>
            {STATES[one.state]}
            {one.digest && `, SHA-256 ${one.digest}…`}
          </span>
          <Inputs of={one.inputs} />
        </li>
      ))}
    </ul>
  );
}

/** Lineage of the requested file. */
export function Chain() {
  const { value: path } = traced;
  const [now, problems] = useRequest<Lineage>("/api/lineage", path ? { path } : null, [stale.value]);
  useEffect(() => {
    if (now) document.getElementById("lineage")?.scrollIntoView({ block: "nearest" });
  }, [now?.path]);
  const [copy, copied] = useCopied(now?.again ?? null, attempt, "making it again");
  const again = async () => {
    await follow((await ask<{ number: number }>("/api/jobs", now!.again)).number);
    await list();
  };
  return (
    <section id="lineage" aria-label="Where a result comes from">
      <Problems of={[...problems, ...wrong.value]} />
      {now && (
        <>
          <h2>Where {now.path} comes from</h2>
          {now.stale.length > 0 && (
            <p class="banner" role="status">
              Out of date: {now.stale.join(", ")} {now.stale.length > 1 ? "are" : "is"} no longer what it was made from.
            </p>
          )}
          {!now.inputs.length && <p>It does not list any input.</p>}
          <Inputs of={now.inputs} />
          {now.made.length > 0 && <h3>Made from it</h3>}
          <ul class="lineage">
            {now.made.map((one) => (
              <li key={one} data-made={one}>
                <ObjectLink path={one} />
              </li>
            ))}
          </ul>
          <p class="row">
            {now.again && (
              <>
                <Button act={() => attempt(again)}>Make it again under a new name</Button>
                {copy}
              </>
            )}
            <Button act={() => trace("")}>Close</Button>
          </p>
          {now.again && copied}
        </>
      )}
    </section>
  );
}
