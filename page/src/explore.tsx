/** Sliders on a running simulation in a notebook: the widget of `pn.explore`, made of the page's parts. */
import { render as draw } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import "./explore.css";
import { changed, digits, followInk, isDark } from "./plots/looks";
import { curvesOf, Plot } from "./plots/plot";
import { type Frame, unpack } from "./server/frame";
import type { Field, RunHead } from "./server/generated";
import { Range } from "./workspace/fields";

type Slider = Required<Pick<Field, "key" | "text" | "number" | "unit" | "low" | "high">>;

interface Begin {
  name: string;
  sliders: Slider[];
}

type Changes = Record<string, string | number>;

interface Head extends Omit<RunHead, "path"> {
  view: string; // which of the views of one drive has asked
  changes: Changes;
}

type Heard = (content: unknown, buffers: DataView[]) => void;

/** Interface that a notebook offers to a widget (anywidget.dev). */
interface Model {
  get(name: "begin"): Begin;
  get(name: "changes"): Changes;
  send(content: unknown): void;
  on(event: "msg:custom", heard: Heard): void;
  off(event: "msg:custom", heard: Heard): void;
}

const numbersOf = (changes: Changes): Record<string, number> =>
  Object.fromEntries(Object.entries(changes).map(([key, value]) => [key, parseFloat(String(value))]));

function Explore({ model }: { model: Model }) {
  const begin = model.get("begin");
  const [numbers, setNumbers] = useState(() => numbersOf(model.get("changes")));
  const [answer, setAnswer] = useState<Frame<Head> | null>(null);
  const [wrong, setWrong] = useState<Head["problems"]>([]);
  const place = useRef<HTMLDivElement>(null);
  const link = useRef({ view: String(Math.random()), sent: 0, onTheWay: 0, most: 0, waiting: null as Changes | null });

  /** At most one request is in flight, and the newest one waits. */
  const pump = () => {
    const at = link.current;
    if (at.waiting === null || at.onTheWay > 0) return;
    at.sent += 1;
    at.onTheWay += 1;
    at.most = Math.max(at.most, at.onTheWay);
    model.send({ number: at.sent, view: at.view, changes: at.waiting, pixels: 1000 });
    at.waiting = null;
  };
  const ask = (values: Record<string, number>) => {
    link.current.waiting = changed(begin.sliders, values);
    pump();
  };
  const put = (key: string, value: number) => {
    if (!Number.isFinite(value)) return;
    const next = { ...numbers, [key]: value };
    setNumbers(next);
    ask(next);
  };

  useEffect(() => {
    const heard: Heard = (_, [bytes]) => {
      const frame = unpack<Head>(new Uint8Array(bytes!.buffer, bytes!.byteOffset, bytes!.byteLength).slice().buffer);
      const isOwn = frame.head.view === link.current.view;
      if (isOwn) link.current.onTheWay -= 1;
      else setNumbers(numbersOf(frame.head.changes)); // the sliders of another view were moved
      setWrong(frame.head.problems ?? []);
      if (!frame.head.problems) setAnswer(frame);
      const { sent, most } = link.current;
      if (isOwn) Object.assign(place.current!.dataset, { sent, drawn: frame.head.number, most });
      pump();
    };
    model.on("msg:custom", heard);
    ask(numbers);
    return () => model.off("msg:custom", heard);
  }, []);

  const head = answer?.head;
  return (
    <div class={isDark() ? "pneudrive dark" : "pneudrive"} ref={place}>
      <strong>{begin.name}</strong>
      {begin.sliders.map((one) => (
        <label key={one.key}>
          <span>{one.key}</span>
          <Range
            name={one.key}
            value={numbers[one.key] ?? one.number}
            ends={[one.low, one.high]}
            words={`${digits(numbers[one.key] ?? one.number)} ${one.unit}`}
            put={(value) => put(one.key, Number(value.toPrecision(5)))}
          />
          <output>
            {digits(numbers[one.key] ?? one.number, 5)} {one.unit}
          </output>
        </label>
      ))}
      {wrong?.map((one) => (
        <p class="wrong" role="alert" key={one.what}>
          {one.what}. {one.remedy}
        </p>
      ))}
      {head?.assumed !== undefined && <p>Simulated; {head.assumed} values are assumed.</p>}
      <div class="plots">
        {head?.panels?.map((panel) => (
          <Plot key={panel.title} {...panel} curves={curvesOf(answer!, panel)} />
        ))}
      </div>
      <ul>
        {head?.panels?.flatMap((panel) =>
          panel.curves.map((one) => (
            <li key={one.column} data-end={one.column} data-si={head.ends![one.column]}>
              {one.label} at the end: {digits((head.ends![one.column] ?? Number.NaN) / panel.size, 6)} {panel.unit}
            </li>
          )),
        )}
      </ul>
    </div>
  );
}

export default {
  render({ model, el }: { model: Model; el: HTMLElement }): () => void {
    const unfollow = followInk(el);
    draw(<Explore model={model} />, el);
    return () => {
      unfollow();
      draw(null, el);
    };
  },
};
