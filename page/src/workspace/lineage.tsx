/** Lineage of a file: its inputs by the hashes that the file carries, and the files made from it. */

import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
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

const QUIET_MS = 1000; // after the list: what is opened at once does not wait for the content of files

/** Return what the server says of the files, and the hook that reads it after each list, while a view shows it. */
function aboutFiles<T>(address: string, none: T) {
  const found = signal(none);
  let of: unknown = null; // the list that it was read for
  const use = (): T => {
    const now = studies.value;
    useEffect(() => {
      const look = () => {
        if (now === of) return; // another part of the view has asked
        of = now;
        void read<T>(address).then((next) => (found.value = next), problemsOf);
      };
      const timer = now && now !== of ? setTimeout(look, QUIET_MS) : 0;
      return () => clearTimeout(timer);
    }, [now]);
    return found.value;
  };
  return [found, use] as const;
}

/** Contents of the files, in a line each. */
export const [, useHeadlines] = aboutFiles<Record<string, string>>("/api/headlines", {});
/** Results that are older than their inputs. */
export const [stale, useStale] = aboutFiles<Stale>("/api/stale", { stale: {}, unchecked: 0 });

const traced = signal("");
const [wrong, attempt] = attempts();

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
