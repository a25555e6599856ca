/** Sliders on a running simulation in a notebook: the widget of `pn.explore`, made of the page's parts. */
import { render as draw } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import "./explore.css";
import { unpack, type Frame } from "./frame";
import { digits } from "./looks";
import { curveOf, Plot } from "./plot";

interface Field {
  key: string;
  text: string;
  number: number;
  unit: string;
  low: number;
  high: number;
}

interface Begin {
  name: string;
  sliders: Field[];
}

interface Head {
  number: number;
  problems?: { what: string; remedy: string | null }[];
  panels?: { title: string; unit: string; size: number; curves: { column: string; label: string }[] }[];
  ends?: Record<string, number>;
  assumed?: number;
}

type Heard = (content: unknown, buffers: DataView[]) => void;

/** What a notebook gives a widget (anywidget.dev). */
interface Model {
  get(name: "begin"): Begin;
  send(content: unknown): void;
  on(event: "msg:custom", heard: Heard): void;
  off(event: "msg:custom", heard: Heard): void;
}

const STEPS = 400;

function Explore({ model }: { model: Model }) {
  const begin = model.get("begin");
  const [numbers, setNumbers] = useState<Record<string, number>>({});
  const [answer, setAnswer] = useState<Frame<Head> | null>(null);
  const [wrong, setWrong] = useState<Head["problems"]>([]);
  const place = useRef<HTMLDivElement>(null);
  const link = useRef({ sent: 0, onTheWay: 0, most: 0, waiting: null as Record<string, string | number> | null });

  /** At most one request is on its way, the newest waits. */
  const pump = () => {
    const at = link.current;
    if (at.waiting === null || at.onTheWay > 0) return;
    at.sent += 1;
    at.onTheWay += 1;
    at.most = Math.max(at.most, at.onTheWay);
    model.send({ number: at.sent, changes: at.waiting, pixels: 1000 });
    at.waiting = null;
  };
  const ask = (values: Record<string, number>) => {
    const changes: Record<string, string | number> = {};
    for (const one of begin.sliders) {
      const value = values[one.key];
      if (value !== undefined && value !== one.number) changes[one.key] = one.unit ? `${value} ${one.unit}` : value;
    }
    link.current.waiting = changes;
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
      link.current.onTheWay -= 1;
      const view = bytes!;
      const frame = unpack<Head>(new Uint8Array(view.buffer, view.byteOffset, view.byteLength).slice().buffer);
      setWrong(frame.head.problems ?? []);
      if (!frame.head.problems) setAnswer(frame);
      Object.assign(place.current!.dataset, { sent: link.current.sent, drawn: frame.head.number, most: link.current.most });
      pump();
    };
    model.on("msg:custom", heard);
    ask({});
    return () => model.off("msg:custom", heard);
  }, []);

  const head = answer?.head;
  return (
    <div class="pneudrive" ref={place}>
      <strong>{begin.name}</strong>
      {begin.sliders.map((one) => (
        <label key={one.key}>
          <span>{one.key}</span>
          <input
            type="range"
            min={0}
            max={STEPS}
            value={Math.round((STEPS * ((numbers[one.key] ?? one.number) - one.low)) / (one.high - one.low))}
            aria-valuetext={`${digits(numbers[one.key] ?? one.number)} ${one.unit}`}
            aria-label={one.key}
            onInput={(event) => put(one.key, Number((one.low + ((one.high - one.low) * event.currentTarget.valueAsNumber) / STEPS).toPrecision(5)))}
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
          <Plot
            key={panel.title}
            title={panel.title}
            unit={panel.unit}
            size={panel.size}
            curves={panel.curves.map((one) => curveOf(answer!.arrays, answer!.arrays.get("time_s")!, one.column, one.label))}
          />
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
    draw(<Explore model={model} />, el);
    return () => draw(null, el);
  },
};
