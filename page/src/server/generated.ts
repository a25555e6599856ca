/** Types of the server's answers. Written by `python tools/page.py types`; do not edit. */

/** First words of a severe finding: no view folds or limits it. */
export const SEVERE = ["Hazard: ", "Open check: ", "Not ready to order: "];
export type State = "good" | "open" | "bad";
export type Mark = Line | Band | Markers | Rule | Bars | Heat | Drawing;

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
  names: (string)[];
  is_si: boolean;
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
  names: (string)[];
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
  hatched: boolean;
  kind: "bars";
}

export interface Heat {
  x: (number | null)[];
  y: (number | null)[];
  z: (number | null)[][];
  label: string;
  kind: "heat";
}

export interface Drawing {
  strokes: (PenStroke)[];
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
  dash: (number)[];
  opacity: number;
  tint: number;
  align: string;
  head: string;
  cap: string;
  bold: boolean;
}

export interface Panel {
  marks: (Mark)[];
  title: string;
  x: Axis;
  y: Axis;
  right: (Mark)[];
  right_y: Axis;
  legend: string | null;
}

export interface Figure {
  panels: (Panel | null)[];
  x: Axis;
  y: Axis;
  columns: number;
  row_in: number;
  rest_in: number;
  width_in: number;
  share_x: string;
  share_y: string;
  heights: (number)[];
  widths: (number)[];
  legend: string;
  entries: number;
  title: string;
  text_scale: number;
  has_margins: boolean;
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
  measured: (boolean)[];
}

export interface SentView {
  title: string;
  state: State;
  leading: (SentValue)[];
  findings: (Finding)[];
  head: (string)[];
  table: ((string)[])[];
  rows: (SentValue)[];
  curves: (SentCurve)[];
  tables: (ShownTable)[];
  figures: (ShownFigure)[];
  notes: (string)[];
}

export interface MachineCheck {
  name: string;
  value: number | null;
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
  moves: Record<number, (boolean)[]>;
}

export interface SentPart {
  part: string;
  leg: number;
  points: ([number, number, number])[];
  moving: number;
}

export interface SentLeg {
  name: string;
  force: string;
  limits: [number | null, number | null];
}

export interface SentPath {
  label: string;
  points: ([number, number, number])[];
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
  parts: (SentPart)[];
  legs: (SentLeg)[];
  reach: ([number, number, number])[];
  paths: (SentPath)[];
  outputs: (SentOutput)[];
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
