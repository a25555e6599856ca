/** Small parts that several views use. */
import type { ComponentChildren, InputHTMLAttributes } from "preact";
import { useEffect, useState } from "preact/hooks";
import { isUnsaved } from "../drive/opened";
import { digits, pretty } from "../plots/looks";
import type { Field, Problem, SentValue } from "../server/generated";
import { ask, type attempts, connection, read, useAnswer } from "../server/server";
import { type Bound, Breakable, Button, bound, Lines, Range } from "./fields";

const placeOf = ({ file, line }: Problem): string => [file, line !== null && `line ${line}`].filter(Boolean).join(", ");

/** Return whether a problem is in the text of that name, not in a file that the text names. */
export const isIn = ({ file }: Problem, name: string): boolean => !file || file === name;

/** List of problems. For the text `own`, each line number is a button that leads to the line. */
export function Problems({ of, onLine, own = "" }: { of: Problem[]; onLine?: (line: number) => void; own?: string }) {
  return (
    <div class="problems" role="status" aria-live="polite">
      {of.map((one, index) => (
        <div class="problem" key={index}>
          <p>
            {one.line !== null && onLine && (!own || isIn(one, own)) ? (
              <Button class="link" act={() => onLine(one.line!)} words={`line ${one.line}`} />
            ) : (
              placeOf(one) && <b>{placeOf(one)}:</b>
            )}{" "}
            {one.what}.
          </p>
          {one.value !== null && <pre>{one.value}</pre>}
          {one.rule && <p>Rule: {one.rule}</p>}
          {one.remedy && <p>Hint: {one.remedy}</p>}
        </div>
      ))}
    </div>
  );
}

const WORDS: Record<string, string> = {
  lost: "The server does not answer. The page tries again; nothing is lost. If the server was stopped, start it again and open the address that it prints.",
  full: "The server already draws curves in as many tabs as it can. Close another tab, and this tab continues.",
  locked: "This tab has no token of the server. Open the address that pneudrive web printed, and this tab continues.",
};

export function ConnectionLine() {
  const words = WORDS[connection.value];
  return (
    <div role="status" aria-live="assertive" class={words ? "banner" : ""} data-connection={connection.value}>
      {words}
    </div>
  );
}

/** Lines to copy. `of` names their subject if a view has several. Work without a command is shown in Python only. */
export function Copied({ command, python, of = "" }: { command?: string; python: string; of?: string }) {
  const [done, setDone] = useState("");
  useEffect(() => setDone(""), [command, python]);
  const copy = async (what: string, text: string) => {
    try {
      await navigator.clipboard.writeText(text);
      setDone(`Copied the ${what}.`);
    } catch {
      setDone("Not copied: the browser does not allow it. Select the lines and copy them.");
    }
  };
  const texts = Object.entries({ command, Python: python }).filter(([, text]) => text);
  return (
    <section class="copied" aria-label={`The same as a command and as Python${of && `: ${of}`}`}>
      <p>
        In the folder of the workspace.{" "}
        {texts.map(([name, text]) => (
          <>
            <Button act={() => copy(name, text!)}>Copy the {name}</Button>{" "}
          </>
        ))}
        <span role="status">{done}</span>
      </p>
      {texts.map(([name, text]) => (
        <Lines name={name.replace("c", "C")} data-copy={name.toLowerCase()}>
          {text}
        </Lines>
      ))}
    </section>
  );
}

/** Return a button that shows a job as lines to copy, and these lines. They disappear when the job changes. */
export function useCopied(job: object | null, attempt: ReturnType<typeof attempts>[1], of = "", door = "/api/work") {
  const [held, hold] = useState({ asked: "", command: "", python: "" });
  const asked = JSON.stringify(job);
  const copy = () =>
    attempt(async () => hold({ asked, ...(await ask<{ command: string; python: string }>(door, job)) }));
  const button = <Button disabled={!job} act={() => copy()} words="Copy as command or Python" />;
  return [button, held.asked === asked && <Copied of={of} command={held.command} python={held.python} />] as const;
}

interface TextProps extends Pick<InputHTMLAttributes, "aria-label" | "class" | "inputMode" | "placeholder"> {
  value: number | string;
  put: (value: string) => unknown; // false: the text is rejected, and the value is shown again
}

/** Field of a text. An answer that arrives during typing does not replace the typed text. */
export function TextField({ value, put, ...looks }: TextProps) {
  const [typed, type] = useState<string | null>(null);
  useEffect(() => type(null), [value]);
  return (
    <input
      {...looks}
      value={typed ?? value}
      onInput={(event) => type(event.currentTarget.value)}
      onChange={(event) => put(event.currentTarget.value) === false && type(null)}
    />
  );
}

type NumberProps = (Bound<number> | { value: number | string; put: (value: number) => void }) & {
  label?: string;
  low?: number;
  high?: number;
  whole?: boolean;
};

/**
 * Field of a number. A text that is not a number within the limits gives a message and changes nothing.
 * A field of type "number" would drop a comma silently.
 */
export function NumberField({ label, low = -Infinity, high = Infinity, whole = false, ...by }: NumberProps) {
  const [value, put] = bound(by as Bound<number>);
  const [wrong, setWrong] = useState("");
  useEffect(() => setWrong(""), [value]);
  const change = (text: string) => {
    const given = text.trim() === "" ? Number.NaN : Number(text);
    const isRight = Number.isFinite(given) && given >= low && given <= high && (!whole || Number.isInteger(given));
    if (isRight) put(given);
    const ends = [low > -Infinity ? ` from ${low}` : "", high < Infinity ? ` up to ${high}` : ""].join("");
    const kind = whole ? "whole number" : "number with a point before decimals";
    setWrong(isRight ? "" : `"${text}" is rejected: enter a ${kind}${ends}`);
    return isRight;
  };
  return (
    <>
      <TextField class="number" inputMode="decimal" aria-label={label} value={value} put={change} />
      {wrong && (
        <span class="missed" role="alert">
          {wrong}
        </span>
      )}
    </>
  );
}

interface SliderProps {
  of: Pick<Field, "key" | "unit" | "low" | "high">;
  id: string;
  label?: string; // absent: the key
  title?: string;
  value: number;
  shown?: number | string; // in the field; absent: the value
  ends?: [number, number];
  kind: string;
  state?: string; // the word of the kind; absent: the kind
  put: (value: number) => void;
  children?: ComponentChildren;
}

/** A value with its slider, its field and its unit. */
export function SliderRow(props: SliderProps) {
  const { key, unit = "", low, high } = props.of;
  const { id, label = key, title, value, shown = value, kind, state = kind, put, children } = props;
  return (
    <div class="slider">
      <label for={id}>
        <Breakable words={label} at={/(?<=\.)/} />
      </label>
      <Range
        id={id}
        value={value}
        ends={props.ends ?? [low!, high!]}
        words={`${digits(value)} ${unit}`}
        put={(next) => put(Number(next.toPrecision(5)))}
      />
      <NumberField label={`${key}, ${unit || "number"}`} value={shown} put={put} />
      <span class="unit">{unit}</span>
      <span class={`kind ${kind}`} title={title}>
        {state}
      </span>
      {children}
    </div>
  );
}

const KEPT = { good: "kept", open: "open", bad: "not kept" };

/** The leading values of a result, with their limits and states. */
export function Leading({ of }: { of: SentValue[] }) {
  if (!of.length) return null;
  return (
    <dl class="leading">
      {of.map((one) => (
        <div key={one.key} class={one.state} data-leading={one.key}>
          <dt>{one.quantity}</dt>
          <dd class={typeof one.value === "string" ? "words" : "number"}>{pretty(`${one.text || "–"} ${one.unit}`)}</dd>
          {one.limit && (
            <dd>
              limit {pretty(one.limit)} <span class={`pill ${one.state}`}>{KEPT[one.state]}</span>
            </dd>
          )}
        </div>
      ))}
    </dl>
  );
}

/** Return a time of the file system as text, with its year unless it is the present one. */
export function day(seconds: number): string {
  const at = new Date(1000 * seconds);
  const year = at.getFullYear() === new Date().getFullYear() ? {} : ({ year: "numeric" } as const);
  return at.toLocaleString("en-GB", { day: "numeric", month: "short", ...year, hour: "2-digit", minute: "2-digit" });
}

/** Note in a view that reads the file of a description while the page has unsaved changes of this file. */
export function Unsaved({ path }: { path: string }) {
  return isUnsaved(path) ? <p class="note">Changes of {path} that are not saved do not count here.</p> : null;
}

/** Links that open or save the report of a folder, or its sheet. Nothing is shown without a folder. */
export function ReportOf({ folder, changed, word = "report" }: { folder: string; changed?: unknown; word?: string }) {
  const [report] = useAnswer(folder, () => read<{ address: string }>("/api/report", { path: folder }), [changed]);
  if (!report?.address) return null;
  const { address } = report;
  return (
    <p class="row">
      <a href={address} target="_blank" rel="noopener">
        Open the {word}
      </a>
      <a href={address} download={`${folder.replace(/^.*?results\//, "").replaceAll("/", "-")}-report.html`}>
        Save the {word}
      </a>
    </p>
  );
}
