/** Space on a plane canvas: what is drawn of a surface over a grid, back to front, with axes, for any turn and tilt. */

export type Place = [x: number, y: number, z: number];

/** What is drawn, in a box: x and y from -0.5 to 0.5, z from 0 to `TALL`. */
export interface Scene {
  x: number[]; // of the nodes, rising
  y: number[];
  /** Of the nodes, one row for each y; null: there are points alone. */
  z: number[][] | null;
  inside: boolean[][] | null;
  points: { x: number; y: number; z: number; foot: number }[];
  axes: [Axis, Axis, Axis];
}

export interface Axis {
  title: string;
  ticks: { at: number; text: string }[]; // at: in the box
}

export interface Ink {
  text: string;
  grid: string;
  paper: string;
  of: (z: number) => string; // a colour for a height
}

export interface Shown {
  turn: number; // degrees about the vertical; 0: x to the right, y away from who looks
  tilt: number; // degrees; 90: from above
  width: number;
  height: number;
}

export const TALL = 0.62;
const DOT = 5; // pixels
const MANY = 1000; // points: smaller ones
const MESH = 6; // cells between two lines on the surface
const MARGIN = { side: 64, top: 30, bottom: 56 };
const LEAST = 45; // pixels of an axis that is worth its labels
const radians = (degrees: number) => (degrees / 180) * Math.PI;

/** Where a place of the box is seen from afar: to the right, up, and how far away. */
export function seen(turn: number, tilt: number): (...at: Place) => Place {
  const [c, s] = [Math.cos(radians(turn)), Math.sin(radians(turn))];
  const [level, steep] = [Math.cos(radians(tilt)), Math.sin(radians(tilt))];
  return (x, y, z) => {
    const away = x * s + y * c;
    return [x * c - y * s, z * level + away * steep, away * level - z * steep];
  };
}

/** The numbers from 0 to `count` - 1, those that are farther away first, along an axis that leads away where `sign` > 0. */
export const backFirst = (count: number, sign: number): number[] => Array.from({ length: count }, (_, k) => (sign > 0 ? count - 1 - k : k));

/** The interval of rising nodes that holds a value; the first or the last one beyond them. */
export function cellOf(nodes: number[], value: number): number {
  let k = 0;
  while (k < nodes.length - 2 && value >= nodes[k + 1]!) k += 1;
  return k;
}

/** Points by the cell of the grid below or above which they lie; made once for a scene. */
export function byCell({ x, y, points }: Scene): Map<number, number[]> {
  const out = new Map<number, number[]>();
  points.forEach((one, k) => {
    const cell = cellOf(y, one.y) * x.length + cellOf(x, one.x);
    const there = out.get(cell);
    if (there) there.push(k);
    else out.set(cell, [k]);
  });
  return out;
}

/** Draw a scene; returns where its points are, pixels: x and y of each in turn. */
export function draw(ink: CanvasRenderingContext2D, scene: Scene, cells: Map<number, number[]>, how: Shown, colours: Ink): Float64Array {
  const { width, height } = how;
  const look = seen(how.turn, how.tilt);
  const corners = [-0.5, 0.5].flatMap((x) => [-0.5, 0.5].flatMap((y) => [0, TALL].map((z) => look(x, y, z))));
  const [right, up] = [0, 1].map((k) => corners.map((one) => one[k]!)) as [number[], number[]];
  const [left, below] = [Math.min(...right), Math.min(...up)];
  const [wide, high] = [Math.max(...right) - left, Math.max(...up) - below];
  const scale = Math.min((width - 2 * MARGIN.side) / wide, (height - MARGIN.top - MARGIN.bottom) / high);
  const [x0, y0] = [0.5 * (width - scale * wide) - scale * left, height - MARGIN.bottom - 0.5 * (height - MARGIN.top - MARGIN.bottom - scale * high) + scale * below];
  const at = (...place: Place): Spot => {
    const [x, y] = look(...place);
    return [x0 + scale * x, y0 - scale * y];
  };
  const [lean, deep] = [Math.sin(radians(how.turn)), Math.cos(radians(how.turn))]; // how far x and y lead away
  const back = { x: lean > 0 ? 0.5 : -0.5, y: deep > 0 ? 0.5 : -0.5 };
  ink.clearRect(0, 0, width, height);
  ink.font = "12px system-ui";
  walls(ink, scene.axes, at, back, colours);
  const spots = surface(ink, scene, cells, at, [lean, deep], colours);
  names(ink, scene.axes, at, back, width, colours);
  return spots;
}

type Spot = [number, number]; // of the canvas, pixels
type At = (...place: Place) => Spot;
type Back = { x: number; y: number };

function line(ink: CanvasRenderingContext2D, from: Spot, to: Spot): void {
  ink.moveTo(...from);
  ink.lineTo(...to);
}

/** The floor and the two walls behind the surface, with a line for each tick. */
function walls(ink: CanvasRenderingContext2D, [xs, ys, zs]: Scene["axes"], at: At, back: Back, colours: Ink): void {
  ink.strokeStyle = colours.grid;
  ink.lineWidth = 1;
  ink.beginPath();
  for (const x of [-0.5, 0.5, ...xs.ticks.map((one) => one.at)]) {
    line(ink, at(x, -0.5, 0), at(x, 0.5, 0));
    line(ink, at(x, back.y, 0), at(x, back.y, TALL));
  }
  for (const y of [-0.5, 0.5, ...ys.ticks.map((one) => one.at)]) {
    line(ink, at(-0.5, y, 0), at(0.5, y, 0));
    line(ink, at(back.x, y, 0), at(back.x, y, TALL));
  }
  for (const z of [0, TALL, ...zs.ticks.map((one) => one.at)]) {
    line(ink, at(-0.5, back.y, z), at(0.5, back.y, z));
    line(ink, at(back.x, -0.5, z), at(back.x, 0.5, z));
  }
  ink.stroke();
}

/** The cells of the grid, those behind first, and the points of each when all cells around it are there. */
function surface(ink: CanvasRenderingContext2D, scene: Scene, cells: Map<number, number[]>, at: At, [lean, deep]: [number, number], colours: Ink): Float64Array {
  const { x, y, z, points } = scene;
  const [spots, feet] = [new Float64Array(2 * points.length), new Float64Array(points.length)];
  const rise = at(0, 0, 0)[1] - at(0, 0, 1)[1];
  points.forEach((one, k) => {
    [spots[2 * k], spots[2 * k + 1]] = at(one.x, one.y, one.z);
    feet[k] = spots[2 * k + 1]! + (one.z - one.foot) * rise;
  });
  const size = points.length > MANY ? DOT / 2 : DOT;
  const square = (k: number) => ink.rect(spots[2 * k]! - size / 2, spots[2 * k + 1]! - size / 2, size, size);
  const isBelow = (k: number) => points[k]!.z < points[k]!.foot;
  const dots = (some: number[]) => {
    ink.strokeStyle = ink.fillStyle = colours.text;
    ink.lineWidth = 1;
    ink.beginPath();
    for (const k of some) {
      ink.moveTo(spots[2 * k]!, feet[k]!);
      ink.lineTo(spots[2 * k]!, spots[2 * k + 1]!);
      if (isBelow(k)) square(k);
    }
    ink.stroke();
    ink.beginPath();
    for (const k of some) if (!isBelow(k)) square(k);
    ink.fill();
    ink.beginPath();
    for (const k of some) if (isBelow(k)) square(k);
    ink.fillStyle = colours.paper;
    ink.fill();
  };
  const nodes = z?.map((row, j) => row.map((height, i) => at(x[i]!, y[j]!, height)));
  const [rows, columns] = [backFirst(y.length - 1, deep), backFirst(x.length - 1, lean)];
  for (let q = 0; q <= rows.length; q++)
    for (let p = 0; p <= columns.length; p++) {
      const [i, j] = [columns[p], rows[q]];
      if (nodes && i !== undefined && j !== undefined) quad(ink, scene, nodes, i, j, colours);
      const behind = p && q ? cells.get(rows[q - 1]! * x.length + columns[p - 1]!) : undefined;
      if (behind) dots(behind);
    }
  return spots;
}

function quad(ink: CanvasRenderingContext2D, { z, inside }: Scene, nodes: Spot[][], i: number, j: number, colours: Ink): void {
  const corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]] as const;
  const [a, b, c, d] = corners.map(([p, q]) => nodes[q]![p]!) as [Spot, Spot, Spot, Spot];
  const isInside = corners.every(([p, q]) => inside![q]![p]!);
  ink.beginPath();
  ink.moveTo(...a);
  for (const one of [b, c, d]) ink.lineTo(...one);
  ink.closePath();
  ink.fillStyle = ink.strokeStyle = colours.of(0.25 * corners.reduce((sum, [p, q]) => sum + z![q]![p]!, 0));
  ink.lineWidth = 0.7;
  ink.globalAlpha = isInside ? 0.92 : 0.35;
  ink.fill();
  if (isInside) ink.stroke(); // closes the seams
  ink.beginPath();
  if (!isInside && (i - j) % 2 === 0) line(ink, a, c);
  if (i % MESH === 0) line(ink, a, d);
  if (j % MESH === 0) line(ink, a, b);
  ink.strokeStyle = colours.text;
  ink.globalAlpha = isInside ? 0.3 : 0.6;
  ink.stroke();
  ink.globalAlpha = 1;
}

/** The numbers and the names of the axes, at the edges in front; an axis that is seen from its end has none. */
function names(ink: CanvasRenderingContext2D, [xs, ys, zs]: Scene["axes"], at: At, back: Back, width: number, colours: Ink): void {
  ink.fillStyle = colours.text;
  const middle = at(0, 0, 0)[0];
  const put = (text: string, x: number, y: number, isUpright = false) => {
    const room = isUpright ? 12 : ink.measureText(text).width / 2 + 2;
    ink.save();
    ink.textAlign = "center";
    ink.translate(Math.min(Math.max(x, room), width - room), y);
    if (isUpright) ink.rotate(-Math.PI / 2);
    ink.fillText(text, 0, 0);
    ink.restore();
  };
  const floor = (axis: Axis, place: (at: number) => Spot) => {
    const [from, to, half] = [place(-0.5), place(0.5), place(0)];
    if (Math.hypot(to[0] - from[0], to[1] - from[1]) < LEAST) return;
    const isUpright = Math.abs(to[1] - from[1]) > 2 * Math.abs(to[0] - from[0]);
    const side = Math.abs(half[0] - middle) < 12 ? 0 : Math.sign(half[0] - middle);
    let last = Number.NaN;
    for (const one of axis.ticks) {
      const [x, y] = place(one.at);
      const apart = Math.hypot(x - from[0], y - from[1]);
      const need = isUpright ? 14 : ink.measureText(one.text).width + 6;
      if (Math.abs(apart - last) < need) continue;
      last = apart;
      ink.textAlign = side === 0 ? "center" : side > 0 ? "left" : "right";
      ink.fillText(one.text, x + 5 * side, y + (isUpright ? 4 : 15));
    }
    const widest = Math.max(...axis.ticks.map((one) => ink.measureText(one.text).width));
    if (isUpright) put(axis.title, half[0] + side * (widest + 20), half[1], true);
    else put(axis.title, half[0] + side * (30 + 0.5 * ink.measureText(axis.title).width), half[1] + 36);
  };
  floor(xs, (x) => at(x, -back.y, 0));
  floor(ys, (y) => at(-back.x, y, 0));
  const edges: At[] = [(_x, _y, z) => at(back.x, -back.y, z), (_x, _y, z) => at(-back.x, back.y, z)];
  const edge = edges[0]!(0, 0, 0)[0] < edges[1]!(0, 0, 0)[0] ? edges[0]! : edges[1]!;
  const [foot, top] = [edge(0, 0, 0), edge(0, 0, TALL)];
  if (foot[1] - top[1] < LEAST) return;
  ink.textAlign = "right";
  for (const one of zs.ticks) ink.fillText(one.text, foot[0] - 6, edge(0, 0, one.at)[1] + 4);
  put(zs.title, foot[0], top[1] - 10);
}
