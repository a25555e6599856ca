/** View of a fit: its values, their origin, and the next measurements. */
import { signal } from "@preact/signals";
import { FigureView } from "../plots/figure";
import { digits } from "../plots/looks";
import { type Point, pointsFigure } from "../plots/points";
import { link } from "../routes";
import { ask, attempting, type Problem, read, typed } from "../server/server";
import { follow, JobList } from "../workspace/jobs";
import { Copied, Problems, Table } from "../workspace/parts";

interface Axis {
  name: string;
  unit: string;
}

interface BehindFit {
  why: string;
  ellipses: { x: Axis; y: Axis; correlation: number; points: [number, number][] }[];
  residuals: [speed: number, residual: number][];
  profiles: (Axis & Profile)[];
  designs: boolean;
  command?: string;
  python?: string;
}

interface Next {
  points: { speed_m_s: number; gauge_a_pa: number; gauge_b_pa: number; repeats: number }[];
  seconds: number;
  expected: (Axis & { now: number | null; then: number | null })[];
  command: string;
  python: string;
}

export interface Profile {
  value: number;
  low: (number | null)[];
  high: (number | null)[];
  probability: number[];
}

const behind = signal<(BehindFit & { of: string }) | null>(null);
const next = signal<(Next & { of: string }) | null>(null);
const points = signal("");
const name = signal("next-points");
const wrong = signal<Problem[]>([]);
const attempt = attempting(wrong);
const MM = 1000; // mm in a metre
const BAR = 1e5; // Pa

/** Clear the details when another fit is shown. */
export function forget(): void {
  behind.value = next.value = null;
  wrong.value = [];
}

/**
 * Return the outline of a profile: from the lower end of the widest interval to the value, and to the upper end.
 * Open ends are left out.
 */
export function outline({ value, low, high, probability }: Profile): { x: number[]; y: number[] } {
  const ends = [
    ...low.map((x, k) => [x, probability[k]!] as const).reverse(),
    [value, 0] as const,
    ...high.map((x, k) => [x, probability[k]!] as const),
  ];
  const known = ends.filter((one): one is readonly [number, number] => one[0] !== null);
  return { x: known.map((one) => one[0]), y: known.map((one) => 100 * one[1]) };
}

const pointAt = ([speed, y]: [number, number]): Point => ({ x: MM * speed, y, spread: null });

const titled = ({ name: of, unit }: Axis) => (unit && unit !== "1" ? `${of}, ${unit}` : of);

/** Read the details of a fit, and lead to them. */
export async function showBehind(path: string): Promise<void> {
  await attempt(async () => void (behind.value = { ...(await read<BehindFit>("/api/behind", { path })), of: path }));
  requestAnimationFrame(() => document.getElementById("behind")?.scrollIntoView());
}

/** Residuals, profiles, ellipses and next points of a fit, read when they are opened. */
export function Behind({ path }: { path: string }) {
  const found = behind.value?.of === path ? behind.value : null; // another fit may be shown meanwhile
  return (
    <section id="behind" aria-label="Behind the fit">
      <Problems of={wrong.value} />
      {!found && (
        <p class="row">
          <button type="button" onClick={() => void showBehind(path)}>
            Residuals, profiles and next points of {path}
          </button>
        </p>
      )}
      {found && (
        <>
          {found.why && <p class="note">{found.why}</p>}
          {found.residuals.length > 0 && (
            <FigureView
              shown={pointsFigure({
                name: "Residuals over speed",
                ...{ x: "speed, mm/s", y: "measured minus fitted friction, N", isLog: true },
                panels: [{ title: "", groups: [{ label: "", points: found.residuals.map(pointAt) }] }],
              })}
            />
          )}
          {found.profiles.length > 0 && (
            <FigureView
              shown={pointsFigure({
                ...{ name: "Profiles", x: "", y: "" },
                caption:
                  "Interval of each value at every probability, by profile likelihood: all other values are fitted again at each point. If the curve of a side ends below 95 %, the data do not limit the value on this side.",
                panels: found.profiles.map((profile) => ({
                  ...{ title: `Profile of ${profile.name}`, x: titled(profile), y: "probability of the interval, %" },
                  groups: [{ label: "", points: [], curve: outline(profile) }],
                })),
              })}
            />
          )}
          {found.ellipses.length > 0 && (
            <FigureView
              shown={pointsFigure({
                ...{ name: "Values that change together", x: "", y: "" },
                caption:
                  "Ellipses of first order; their projections are 95 % intervals. If a profile is asymmetric, trust the profile and not the ellipse.",
                panels: found.ellipses.map(({ x, y, correlation, points: at }) => ({
                  ...{
                    title: `${y.name} over ${x.name}: correlation ${digits(correlation, 2)}`,
                    x: titled(x),
                    y: titled(y),
                  },
                  groups: [
                    { label: "", points: [], curve: { x: at.map(([one]) => one), y: at.map(([, one]) => one) } },
                  ],
                })),
              })}
            />
          )}
          {found.command && found.python && (
            <Copied of="behind the fit" command={found.command} python={found.python} />
          )}
          {found.designs && <NextPoints path={path} />}
        </>
      )}
    </section>
  );
}

function NextPoints({ path }: { path: string }) {
  const count = () => (points.value.trim() ? typed("Points", points.value) : null);
  const propose = () =>
    attempt(async () => {
      const many = count();
      next.value = {
        ...(await read<Next>("/api/next", { path, ...(many !== null && { points: String(many) }) })),
        of: path,
      };
    });
  const write = () =>
    attempt(async () => {
      await follow(
        (await ask<{ number: number }>("/api/jobs", { kind: "design", fit: path, points: count(), name: name.value }))
          .number,
      );
    });
  const found = next.value?.of === path ? next.value : null;
  return (
    <>
      <h2>Next points to measure</h2>
      <p class="row">
        <label>
          Points, repeats included{" "}
          <input
            inputMode="numeric"
            size={6}
            value={points.value}
            placeholder="auto"
            title="Without a number: twice the values"
            onInput={(event) => ((points.value = event.currentTarget.value), (next.value = null))}
          />
        </label>
        <button type="button" onClick={() => void propose()}>
          Propose on the simulated rig
        </button>
      </p>
      {found && (
        <>
          <Table
            label="Next points"
            heads={["Speed, mm/s", "Chamber a, bar gauge", "Chamber b, bar gauge", "Repeats"]}
            rows={found.points.map((one, index) => ({
              cells: [
                digits(MM * one.speed_m_s, 3),
                digits(one.gauge_a_pa / BAR, 3),
                digits(one.gauge_b_pa / BAR, 3),
                one.repeats,
              ],
              data: { "data-next": index, "data-si": one.speed_m_s },
            }))}
          />
          <p>
            About {digits(found.seconds / 60, 3)} min of strokes. Expected half-width of each 95 % interval, now and
            after a fit of old and new values together:
          </p>
          <Table
            label="Expected intervals"
            heads={["Value", "Now", "Then", "Unit"]}
            rows={found.expected.map((one) => [
              one.name,
              ...[one.now, one.then].map((half) => (half === null ? "open" : digits(half, 3))),
              one.unit,
            ])}
          />
          <p class="row">
            <label>
              Protocol <input value={name.value} onInput={(event) => (name.value = event.currentTarget.value)} />
              .toml
            </label>
            <button type="button" onClick={() => void write()}>
              Write the protocol
            </button>
            <a href={link("campaign")}>Plan a campaign</a>
          </p>
          <Copied of="next points" command={found.command} python={found.python} />
          <JobList of={`${name.value}.toml`} />
        </>
      )}
    </>
  );
}
