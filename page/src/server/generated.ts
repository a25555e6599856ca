/** Types of the server's answers. Written by `python tools/page.py types`; do not edit. */

/** First words of a severe finding: no view folds or limits it. */
export const SEVERE = ["Hazard: ", "Open check: ", "Not ready to order: "];
export type State = "good" | "open" | "bad";
export type Mark = Line | Band | Markers | Rule | Bars | Drawing;

export interface Listed {
  path: string;
  kind: string;
  size: number;
  changed: number;
}

export interface Axis {
  label: string;
  scale: string;
  low: number | null;
  high: number | null;
  below: number;
  above: number;
  names: string[];
  is_named: boolean;
  unit: string;
  size: number;
}

export interface Line {
  x: (number | null)[];
  y: (number | null)[];
  label: string;
  look: [color: string | number, dash: unknown, marker: string];
  width: number | null;
  steps: boolean;
  kind: "line";
}

export interface Band {
  x: (number | null)[];
  low: (number | null)[];
  high: (number | null)[];
  label: string;
  look: [color: string | number, dash: unknown, marker: string] | null;
  kind: "band";
}

export interface Markers {
  x: (number | null)[];
  y: (number | null)[];
  label: string;
  look: [color: string | number, dash: unknown, marker: string];
  low: (number | null)[] | null;
  high: (number | null)[] | null;
  size: number;
  filled: boolean;
  joined: boolean;
  names: string[];
  kind: "markers";
}

export interface Rule {
  x: number | [number, number] | null;
  y: number | [number, number] | null;
  label: string;
  look: [color: string | number, dash: unknown, marker: string];
  width: number;
  kind: "rule";
}

export interface Bars {
  at: (number | null)[];
  values: (number | null)[];
  label: string;
  look: [color: string | number, dash: unknown, marker: string];
  thickness: number;
  across: boolean;
  kind: "bars";
}

export interface Drawing {
  strokes: PenStroke[];
  x: [number, number];
  y: [number, number];
  equal: boolean;
  kind: "drawing";
}

export interface PenStroke {
  points: (number | null)[][];
  text: string;
  color: string;
  fill: string;
  width: number;
  size: number;
  dash: number[];
  opacity: number;
  tint: number;
  align: string;
  head: string;
  cap: string;
  bold: boolean;
}

export interface Panel {
  marks: Mark[];
  title: string;
  x: Axis;
  y: Axis;
}

export interface Figure {
  panels: (Panel | null)[];
  x: Axis;
  y: Axis;
  columns: number;
  row_in: number;
  share_x: string;
  share_y: string;
  heights: number[];
  title: string;
  tall: Panel | null;
  tall_first: boolean;
}

export interface ShownFigure {
  name: string;
  caption: string;
  figure: Figure;
}

export interface Finding {
  text: string;
  state: State;
  remedy: string;
}

export interface ShownTable {
  caption: string;
  head: string[];
  rows: string[][];
}

export interface SentValue {
  key: string;
  label: string;
  quantity: string;
  value: number | string | null;
  interval: [number, number] | null;
  text: string;
  unit: string;
  origin: string;
  limit: string;
  state: State;
}

export interface SentCurve {
  key: string;
  label: string;
  group: string;
  x_title: string;
  y_title: string;
  x: (number | null)[];
  y: (number | null)[];
  low: (number | null)[];
  high: (number | null)[];
  measured: boolean[];
}

export interface SentView {
  title: string;
  state: State;
  leading: SentValue[];
  findings: Finding[];
  head: string[];
  table: string[][];
  rows: SentValue[];
  curves: SentCurve[];
  tables: ShownTable[];
  figures: ShownFigure[];
  notes: string[];
}

export interface MachineCheck {
  name: string;
  value: number;
  limit: number | null;
  unit: string;
  is_kept: boolean | null;
  rule: string;
  remedies: string[];
}

export interface Shape {
  word: string;
  points: [number, number][];
  component: string;
  size: number;
  text: string;
  align: string;
  angles: [number, number];
  net: number;
}

export interface PistonShapes {
  barrel: [number, number, number, number];
  piston: [number, number];
  moves: Record<number, boolean[]>;
}

export interface CommandInput {
  key: string;
  label: string;
  kind: string;
  option: string;
  start: unknown;
  choices: [string, string][];
  most: number;
  hint: string;
  suffix: string;
  only: string[];
}

export interface ValuePair {
  key: string;
  before: string;
  after: string;
  interval_before: string;
  interval_after: string;
  change: number | null;
}

export interface Problem {
  file?: string;
  line: number | null;
  key: string | null;
  what: string;
  value: string | null;
  rule: string | null;
  remedy: string | null;
}

export interface CatalogueEntry {
  path: string;
  title: string;
}

/** State and content of the folder. An answer to a request with this state has nothing else. */
export interface Studies {
  state: string;
  folder: string;
  version: string;
  platform: string;
  build: string;
  protocols: string[];
  control: boolean;
  left_out: number;
  is_cut: boolean;
  files: Listed[];
  catalogue: CatalogueEntry[];
}

export interface Progress {
  done: number;
  total: number;
  task: string;
}

/** A job. `ends`: it was cancelled, and runs until it can stop. */
export interface Job {
  number: number;
  command: string;
  kind: string;
  out: string;
  state: "running" | "done" | "failed" | "cancelled";
  ends: boolean;
  tail: string;
  progress: Progress | null;
}

export interface Jobs {
  jobs: Job[];
}

export interface Form {
  title: string;
  fields: CommandInput[];
}

/** Lines that do the same in a shell and in Python. */
export interface Copied {
  command: string;
  python: string;
}

/** An input of a file, with its own inputs. */
export interface Made {
  kind: string;
  name: string;
  digest: string;
  path: string;
  state: "same" | "changed" | "differs" | "missing" | "named" | "unread";
  inputs: Made[];
}

export interface Lineage {
  path: string;
  inputs: Made[];
  made: string[];
  again: Record<string, unknown> | null;
  stale: string[];
}

export interface Stale {
  stale: Record<string, string[]>;
  unchecked: number;
}

/** A value of a description or a task. `copies`: components that its table describes together. */
export interface Field {
  key: string;
  text: string;
  origin: string;
  kind: "given" | "source" | "identified" | "assumed" | "default";
  number?: number;
  unit?: string;
  units?: string[];
  component?: string;
  copies?: string[];
  low?: number;
  high?: number;
}

export interface Follows {
  what: string;
  value: number;
  unit: string;
}

/** Check of a text. `valves`: those of a circuit with their lowest commands; `follows`: from a task. */
export interface Checked {
  problems: Problem[];
  name?: string;
  kind?: "drive" | "circuit";
  valves?: Record<string, number>;
  values?: Field[];
  notes?: string[];
  sliders?: string[];
  follows?: Follows[];
}

export interface TextFile {
  text: string;
  sha256: string | null;
}

export interface CircuitDrawing {
  shapes: Shape[];
  pistons: Record<string, PistonShapes>;
  nets: [string, string][][];
  ports: Record<string, Record<string, [number, number]>>;
  box: [number, number, number, number];
  words: string[];
}

export interface Kinds {
  kinds: [string, string][];
}

export interface Part {
  name: string;
  title: string;
}

export interface Parts {
  parts: Part[];
}

export interface Fmu {
  view: SentView;
  sha256: string;
  fmpy: string;
}

export interface CurveColumn {
  column: string;
  label: string;
}

/** Curves of a run with one unit. `left_out`: number of curves that are not drawn. */
export interface RunPanel {
  title: string;
  unit: string;
  size: number;
  curves: CurveColumn[];
  left_out?: number;
}

export interface Impact {
  time_s: number;
  end: string;
  cylinder?: string;
  speed_m_s: number;
  energy_j: number;
}

export interface RunEvent {
  time_s: number;
  what: string;
}

export interface SentPart {
  part: string;
  leg: number;
  points: [number, number, number][];
  moving: number;
}

export interface SentLeg {
  name: string;
  force: string;
  limits: [number | null, number | null];
}

export interface SentPath {
  label: string;
  points: [number, number, number][];
}

export interface SentOutput {
  column: string;
  label: string;
  unit: string;
  size: number;
}

export interface SentPlatform {
  name: string;
  traced: string;
  view: SentView;
  parts: SentPart[];
  legs: SentLeg[];
  reach: [number, number, number][];
  paths: SentPath[];
  outputs: SentOutput[];
}

/** A cylinder and the columns of its position and pressures. */
export interface MovingCylinder {
  name: string;
  stroke_m: number;
  position: string;
  pressures: [string, string];
}

export interface OtherRun {
  path: string;
  ends: Record<string, number>;
  largest: Record<string, number>;
}

export interface MemberBand {
  members: number;
  failed: number;
  why: string;
  refused: boolean;
  share: [number, number];
  ends: Record<string, [number, number]>;
}

export interface RunHead {
  number: number;
  path: string;
  problems?: Problem[];
  panels?: RunPanel[];
  warnings?: string[];
  impacts?: Impact[];
  more_impacts?: number;
  leading?: SentValue[];
  events?: RunEvent[];
  assumed?: number;
  samples?: number;
  ends?: Record<string, number>;
  others?: OtherRun[];
  loops?: string[];
  energy?: SentView;
  band?: MemberBand;
  platforms?: SentPlatform[];
  cylinders?: MovingCylinder[];
}

export interface Gain {
  key: string;
  number: number;
  unit: string;
  low: number;
  high: number;
  meaning: string;
  rule: string;
}

/** A run under control. Gains have the ranges of their sliders; `told` is the assumed drive. */
export interface ControlHead extends Copied {
  number: number;
  problems?: Problem[];
  panels: RunPanel[];
  samples: number;
  took_s: number;
  law: string;
  drive: string;
  gains: Gain[];
  mismatch: [string, string];
  warnings: string[];
  max_error_m: number | null;
  view: SentView;
  told: SentView;
  lost: boolean;
}

export interface StandardReference {
  name: string;
  text: string;
  usable: boolean;
}

export interface Choices {
  laws: string[];
  setups: string[];
  mismatches: string[];
  spreads: string[];
  references: StandardReference[];
}

export interface Measure {
  name: string;
  title: string;
  size: number;
  unit: string;
}

export interface CardReference {
  name: string;
  text: string;
}

export interface CardCell {
  law: string;
  reference: string;
  text: string;
  range: string[];
  value: number | null;
  best: boolean;
  lost: number;
}

export interface CardRun {
  law: string;
  reference: string;
  seed: number;
  value: number | null;
}

export interface Card extends Copied {
  measure: string;
  spread: string;
  total: number;
  finished: boolean;
  done: number;
  laws: string[];
  references: CardReference[];
  measures: Measure[];
  cells: CardCell[];
  each: CardRun[];
  failed: string[];
  told: SentView;
}

export interface ErrorUnit {
  unit: string;
  size: number;
}

export interface Tracks {
  laws: string[];
  error: ErrorUnit;
}

/** A value that 1 % of the samples exceed, its limit, and the values between which 98 % lie. */
export interface Limit {
  name: string;
  value: number | null;
  limit: number | null;
  unit: string;
  margin: number | null;
  interval: [number | null, number | null] | null;
}

/** A simulated choice. Limits of the task come first, then air and load ratio. */
export interface Candidate {
  name: string;
  title: string;
  parts: string;
  cylinder: string;
  setting: string;
  draws: number;
  met: number;
  at_least: number;
  time_out: number | null;
  time_back: number | null;
  energy: number | null;
  air: number | null;
  load_ratio: number | null;
  margin: number | null;
  binding: string;
  limits: Limit[];
  misses: boolean;
  place: number | null;
  file: string;
}

/** A search, the best candidates first. It has view and sheet once it is done. `searched`: by any process. */
export interface Sizing {
  name: string;
  words: string;
  task: string;
  draws: number;
  candidates: Candidate[];
  view: SentView | null;
  sheet: SentView | null;
  done: boolean;
  searched: boolean;
  asked: Record<string, number> | null;
  provisional: string;
}

export interface Channel {
  column: string;
  label: string;
  unit: string;
}

/** A recording, its problems, or the fraction of its file that is read. */
export interface OpenedRecording {
  problems?: Problem[];
  share?: number;
  key?: string;
  channels?: Channel[];
  span?: [number, number];
  samples?: number;
  time?: boolean;
  layout?: string | null;
  notes?: string[];
}

export interface Stroke {
  from: number;
  to: number;
  direction: number;
  speed: number;
}

export interface FaultKind {
  count: number;
  places: [number, number][];
}

export interface Strokes {
  strokes: Stroke[];
  faults: Record<string, FaultKind>;
  note?: string;
}

export interface WindowHead {
  number: number;
  problems?: Problem[];
  path: string;
  key: string | null;
  missing: number;
  samples: number;
  raw: boolean;
  from: number;
  to: number;
}

export interface Guess {
  role: string;
  column: string;
  unit: string;
  why: string;
}

export interface Proposal {
  text: string;
  problem: string;
  kind: string;
  strokes: number;
  guesses: Guess[];
}

export interface MeasuredRow {
  recording: string;
  label: string;
  unit: string;
  time_s: [number, number];
  values: [number | null, number | null];
  difference: number | null;
  slope: number | null;
}

export interface MeasuredRows {
  rows: MeasuredRow[];
}

/** Speed and friction of a cycle, without an interval. */
export interface QuickPoint {
  x: number;
  y: number;
  spread: null;
}

export interface QuickGroup {
  label: string;
  points: QuickPoint[];
}

export interface Campaign {
  name: string;
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
  groups: QuickGroup[];
}

export interface CycleHead {
  cycle: string;
  left?: string;
  samples?: number;
}

export interface Plan extends Copied {
  text: string;
  time_s: number;
  cycles: number;
}

/** Friction y over speed x, or over gauge pressure x with the speed. */
export interface FrictionPoint {
  recording: string;
  direction: number;
  x: number;
  y: number;
  spread: number | null;
  flags: string;
}

export interface GaugePoint extends FrictionPoint {
  speed: number;
}

/** Friction of a fit over speed or gauge pressure, with its band and the measured range. */
export interface FrictionCurve {
  x: number[];
  y: (number | null)[];
  low: (number | null)[];
  high: (number | null)[];
  measured: [number | null, number | null];
}

/** Points of one seal and pressure, with the curve of the fit; `assembly` is seal, mounting and drive. */
export interface FrictionGroup {
  label: string;
  assembly: string;
  points: FrictionPoint[];
  curve?: FrictionCurve;
  gauges: [number, number];
}

export interface SliceGroup {
  label: string;
  assembly: string;
  points: GaugePoint[];
  curve?: FrictionCurve;
  speed: number;
}

/** Points of a map. `fit`: why curves are missing; `seals`: fit of each seal. */
export interface FrictionMap {
  groups: FrictionGroup[];
  fit: string;
  fits: string[];
  seals: Record<string, string>;
  recordings: Record<string, string>;
  left_out: number;
}

export interface Slice {
  chamber: "a" | "b";
  groups: SliceGroup[];
  python: string;
}

export interface BehindFit {
  view: SentView;
  designs: boolean;
  command?: string;
  python?: string;
}

export interface NextPoints extends Copied {
  view: SentView;
}

export interface Compared extends Copied {
  names: [string, string];
  sentence: string;
  figure: ShownFigure | null;
  values: ValuePair[];
  lines: string[];
}

export interface Culprit {
  what: string;
  share: number;
  text: string;
  free: string[];
}

export interface Diagnosis {
  left: number;
  clean: boolean;
  culprit?: Culprit[];
}

export interface Source {
  name: string;
  file: string;
}

export interface OriginOfValue {
  key: string;
  text: string;
  kind: string;
  origin: string;
  interval?: string;
  fit?: string;
  source?: Source[];
}

export interface ValidatedChannel {
  column: "position_m" | "pressure_a_pa" | "pressure_b_pa";
  label: string;
  size: number;
  unit: string;
}

export interface FreeRun {
  nrmse?: number | null;
  fit_percent?: number | null;
}

export interface ChannelResult {
  free: FreeRun;
  off_s?: number;
}

/** A recording of a validation with its agreement. `start_s`: its time 0 on the clock of the file. */
export interface ValidatedRecord {
  badge?: string;
  name: string;
  file: string;
  span: [number, number];
  start_s?: number;
  position_m: ChannelResult;
  pressure_a_pa: ChannelResult;
  pressure_b_pa: ChannelResult;
}

export interface Validation {
  name: string;
  drive: string;
  editable: boolean;
  window_s: number;
  synthetic: boolean;
  record: ValidatedRecord[];
  diagnosis: Diagnosis;
  suspects: Field[];
  values: OriginOfValue[];
  channels: ValidatedChannel[];
}

export interface ValidationHead {
  number: number;
  problems?: Problem[];
  fit?: Record<string, number | null>;
}
