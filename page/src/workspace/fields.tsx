/** Buttons, fields and texts, each in one line of a view. They know nothing of the server. */
import { type Signal, signal } from "@preact/signals";
import type { ComponentChildren, ComponentType, JSX } from "preact";
import { useEffect } from "preact/hooks";
import { pretty } from "../plots/looks";

type ButtonProps = JSX.IntrinsicElements["button"] & { act?: () => unknown; words?: ComponentChildren };

/** A button that acts; a link in the form of a button has the class `link`. */
export const Button = ({ act, words, children = words, ...others }: ButtonProps) => (
  <button type="button" {...(act && { onClick: () => void act() })} {...others}>
    {children}
  </button>
);

type FoldProps = Omit<JSX.IntrinsicElements["details"], "title"> & { title: ComponentChildren };

/** A part of a view that is folded below its title. */
export const Fold = ({ title, children, ...others }: FoldProps) => (
  <details {...others}>
    <summary>{title}</summary>
    {children}
  </details>
);

/** Lines of text as they are. A keyboard can scroll them. */
export const Lines = ({ name, ...others }: JSX.IntrinsicElements["pre"] & { name: string }) => (
  <pre tabIndex={0} role="group" aria-label={name} {...others} />
);

/** A name that a line may break after each point and underscore, or at other places. */
export const Breakable = ({ words, at = /(?<=[._])/ }: { words: string; at?: RegExp }) => (
  <>
    {words.split(at).map((part) => (
      <>
        {part}
        <wbr />
      </>
    ))}
  </>
);

/** Remarks below each other. */
export const Remarks = ({ of }: { of: string[] }) => (
  <>
    {of.map((one) => (
      <p class="note" key={one}>
        {one}
      </p>
    ))}
  </>
);

/** Value of a field with its setter, or a signal that is both. */
export type Bound<T> = { of: Signal<T> } | { value: T; put: (value: T) => unknown };

export const bound = <T,>(by: Bound<T>): [value: T, put: (value: T) => unknown] =>
  "of" in by ? [by.of.value, (value) => (by.of.value = value)] : [by.value, by.put];

/** Return a list with a thing at its end, or without it if it is there. */
export const toggled = <T,>(list: T[], one: T): T[] =>
  list.includes(one) ? list.filter((other) => other !== one) : [...list, one];

type TickProps = Bound<boolean> & {
  label: ComponentChildren; // or a name that only a screen reader tells
  name?: string;
  class?: string;
};

/** A box to tick with its label. Without a label, it has a name. */
export function Tick({ label, name, class: look, ...by }: TickProps) {
  const [value, put] = bound(by);
  const box = (
    <input type="checkbox" aria-label={name} checked={value} onChange={(event) => put(event.currentTarget.checked)} />
  );
  if (label === "") return box;
  return (
    // biome-ignore lint/a11y/noLabelWithoutControl: the box is its control
    <label class={look}>
      {box} {label}
    </label>
  );
}

/** Boxes to tick below a legend. The chosen values keep the order of choosing. */
export const Ticks = (props: {
  legend: string;
  options: Option[];
  chosen: string[];
  put: (chosen: string[]) => void;
}) => (
  <fieldset>
    <legend>{props.legend}</legend>
    <div class="row">
      {props.options.map(pairOf).map(([key, label]) => {
        const put = () => props.put(toggled(props.chosen, key));
        return <Tick key={key} label={label} value={props.chosen.includes(key)} put={put} />;
      })}
    </div>
  </fieldset>
);

type TextProps = Pick<JSX.IntrinsicElements["input"], "placeholder" | "required" | "size"> & {
  label: ComponentChildren;
  of: Signal<string>;
};

/** A field of a text that is kept in a signal. */
export const TextInput = ({ label, of, ...others }: TextProps) => (
  <label>
    {label} <input value={of.value} onInput={(event) => (of.value = event.currentTarget.value)} {...others} />
  </label>
);

interface RangeProps {
  label?: ComponentChildren;
  name?: string | undefined; // that only a screen reader tells
  id?: string;
  value: number;
  ends: [number, number];
  words: string; // of the value
  put: (value: number) => void;
  steps?: number;
}

/** A slider between two ends, with its label if it has one. */
export function Range({ label, name, id, value, ends: [low, high], words, put, steps = 400 }: RangeProps) {
  const slider = (
    <input
      id={id}
      type="range"
      min={0}
      max={steps}
      step={1}
      aria-label={name}
      value={Math.round((steps * (value - low)) / (high - low))}
      aria-valuetext={words}
      onInput={(event) => put(low + ((high - low) * event.currentTarget.valueAsNumber) / steps)}
    />
  );
  if (!label) return slider;
  return (
    // biome-ignore lint/a11y/noLabelWithoutControl: the slider is its control
    <label>
      {label} {slider}
    </label>
  );
}

/** A value that can be chosen, with its text if that is another. */
export type Option = string | [key: string, text: string];

export const pairOf = (option: Option): [key: string, text: string] =>
  Array.isArray(option) ? option : [option, option];

export const Options = ({ of }: { of: Option[] }) => (
  <>
    {of.map(pairOf).map(([key, text]) => (
      <option key={key} value={key}>
        {text}
      </option>
    ))}
  </>
);

type SelectProps = Bound<string> &
  Pick<JSX.IntrinsicElements["select"], "disabled"> & {
    label: ComponentChildren;
    options: Option[];
    class?: string;
    hint?: string; // of a menu of actions, which does not keep the chosen one
  };

/** A choice with its label; an option is a value, or a value with its text. */
export function Select({ label, options, class: look = "choice", hint, disabled, ...by }: SelectProps) {
  const [value, put] = bound(by);
  const change = ({ currentTarget: menu }: { currentTarget: HTMLSelectElement }) => {
    const chosen = menu.value;
    if (hint) menu.value = "";
    if (chosen || !hint) put(chosen);
  };
  return (
    <label class={look}>
      {label}{" "}
      <select value={value} disabled={disabled} onChange={change}>
        {hint && <option value="">{hint}</option>}
        <Options of={options} />
      </select>
    </label>
  );
}

type Data = Record<string, unknown>;
export type Cell = ComponentChildren | { text: ComponentChildren; data: Data };
type Row = Cell[] | { cells: Cell[]; data: Data };

/** Return a cell as its content and the data that it carries. */
const parted = (cell: Cell): { text: ComponentChildren; data: Data } =>
  cell !== null && typeof cell === "object" && "data" in cell ? cell : { text: cell as ComponentChildren, data: {} };

const NUMBER = /^[-−]?\d+/;
const FIGURE_SPACE = "\u2007"; // as wide as a digit

/** Return the figure spaces before each text of a column that put its decimal points below each other. */
export function pads(texts: string[]): string[] {
  const wide = texts.map((one) => NUMBER.exec(one)?.[0].length ?? 0);
  const most = wide.filter(Boolean).length > 1 ? Math.max(...wide) : 0;
  return wide.map((one) => (one && most > one ? FIGURE_SPACE.repeat(most - one) : ""));
}

/** Return the text with which a content begins. */
function beginning(of: ComponentChildren): string {
  if (Array.isArray(of)) return of.map(beginning).find(Boolean) ?? "";
  if (of !== null && typeof of === "object" && "props" in of) return beginning(of.props.children);
  return typeof of === "string" || typeof of === "number" ? String(of).trimStart() : "";
}

interface TableProps {
  heads: Cell[];
  rows: Row[]; // the first cell of a row names it; a row of one cell is the heading of those below it
  label: string;
  class?: string;
  frame?: "scroll" | "wide"; // whether a high table scrolls, or only a wide one
}

/** Table with a name in the first cell of each row. A text has units as people write them. */
export function Table({ heads, rows, label, class: look, frame = "scroll" }: TableProps) {
  const all = rows.map((row) => (Array.isArray(row) ? { cells: row, data: {} } : row));
  const columns = heads.map((_, k) => pads(all.map(({ cells }) => beginning(parted(cells[k]).text))));
  const group = { scope: "rowgroup", colSpan: heads.length };
  return (
    <div class={frame} tabIndex={0} role="region" aria-label={label}>
      <table class={look}>
        <thead>
          <tr>
            {heads.map(parted).map(({ text, data }, index) => (
              <th scope="col" key={index} {...data}>
                {text || <span class="hidden">value</span>}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {all.map(({ cells: [name, ...cells], data: rowData }, index) => (
            <tr key={index} {...rowData}>
              {name === "" ? (
                <td />
              ) : (
                <th {...(cells.length ? { scope: "row" } : group)}>{name as ComponentChildren}</th>
              )}
              {cells.map(parted).map(({ text, data }, k) => (
                <td
                  key={k}
                  data-head={beginning(parted(heads[k + 1]).text)}
                  data-pad={columns[k + 1]![index] || undefined}
                  {...data}>
                  {typeof text === "string" ? pretty(text) : text}
                </td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

/** Return the component of a module. Nothing is shown until it is loaded. */
export function lazy<Props extends object>(load: () => Promise<{ default: ComponentType<Props> }>) {
  const loaded = signal<ComponentType<Props> | null>(null);
  return function Lazy(props: Props) {
    useEffect(() => void load().then((module) => (loaded.value = module.default)), []);
    const Loaded = loaded.value;
    return Loaded && <Loaded {...props} />;
  };
}
