/** Buttons, fields and texts, each in one line of a view. They know nothing of the server. */
import type { Signal } from "@preact/signals";
import type { ComponentChildren, JSX } from "preact";

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

interface PickProps {
  label: ComponentChildren;
  hint: string; // shown in place of a value
  options: Option[];
  put: (value: string) => void;
  disabled?: boolean;
  class?: string;
}

/** A menu of actions. It does not keep the chosen one. */
export const Pick = ({ label, hint, options, put, disabled, class: look }: PickProps) => (
  <label class={look}>
    {label}{" "}
    <select
      value=""
      disabled={disabled}
      onChange={({ currentTarget: menu }) => {
        if (menu.value) put(menu.value);
        menu.value = "";
      }}>
      <option value="">{hint}</option>
      <Options of={options} />
    </select>
  </label>
);
