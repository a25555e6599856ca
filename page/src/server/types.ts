/** Types of the server's answers. Written by `python tools/page.py types`; do not edit. */

/** First words of a severe finding: no view folds or limits it. */
export const SEVERE = ["Hazard: ", "Open check: ", "Not ready to order: "];

export interface Listed {
  path: string;
  kind: string;
  size: number;
  changed: number;
}

export interface SentValue {
  key: string;
  label: string;
  quantity: string;
  value: number | string | null;
  text: string;
  unit: string;
  origin: string;
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
  head: (string)[];
  table: ((string)[])[];
  rows: (SentValue)[];
  curves: (SentCurve)[];
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

export interface SentLine {
  width: number;
  opacity: number;
  dash: (number)[];
  fill: number;
  points: ([number, number])[];
  moving: number;
}

export interface SentOutput {
  column: string;
  label: string;
  unit: string;
  size: number;
}

export interface SentPlatform {
  name: string;
  width: number;
  height: number;
  lines: (SentLine)[];
  labels: ([string, number, number])[];
  path: [string, string];
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
