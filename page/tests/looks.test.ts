import { expect, test } from "vitest";

const SOURCES = import.meta.glob<string>("../src/**/*.{css,ts,tsx}", { query: "?raw", import: "default", eager: true });
const TOKENS = SOURCES["../src/tokens.css"]!;

/** Both colours of a token. */
const token = (name: string) => {
  const [, light, dark] = new RegExp(`--${name}: light-dark\\((#\\w+), (#\\w+)\\)`).exec(TOKENS)!;
  return { light: light!, dark: dark! };
};

type Colour = [number, number, number];

const linear = (text: string): Colour =>
  [1, 3, 5]
    .map((at) => parseInt(text.slice(at, at + 2), 16) / 255)
    .map((one) => (one <= 0.04045 ? one / 12.92 : ((one + 0.055) / 1.055) ** 2.4)) as Colour;
const times = (matrix: number[][], by: Colour): Colour =>
  matrix.map((row) => row.reduce((sum, one, k) => sum + one * by[k]!, 0)) as Colour;

/** Colours as people see them: all cones, and without the long, middle or short one (Machado, Oliveira and Fernandes 2009). */
const SIGHTS: Record<string, number[][]> = {
  normal: [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ],
  protanopia: [
    [0.152286, 1.052583, -0.204868],
    [0.114503, 0.786281, 0.099216],
    [-0.003882, -0.048116, 1.051998],
  ],
  deuteranopia: [
    [0.367322, 0.860646, -0.227968],
    [0.280085, 0.672501, 0.047413],
    [-0.01182, 0.04294, 0.968881],
  ],
  tritanopia: [
    [1.255528, -0.076749, -0.178779],
    [-0.078411, 0.930809, 0.147602],
    [0.004733, 0.691367, 0.3039],
  ],
};
const TO_XYZ = [
  [0.4124, 0.3576, 0.1805],
  [0.2126, 0.7152, 0.0722],
  [0.0193, 0.1192, 0.9505],
];
const WHITE = [0.9505, 1, 1.089];

function lab(colour: Colour): Colour {
  const [x, y, z] = times(TO_XYZ, colour.map((one) => Math.min(Math.max(one, 0), 1)) as Colour).map((one, k) => {
    const share = one / WHITE[k]!;
    return share > 0.008856 ? Math.cbrt(share) : 7.787 * share + 16 / 116;
  }) as Colour;
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}

const luminance = (text: string): number => times([TO_XYZ[1]!], linear(text))[0]!;

test.each(["light", "dark"] as const)("curves on %s paper are seen and told apart by colour-blind readers", (paper) => {
  const background = token("surface")[paper];
  const colours = [1, 2, 3, 4, 5, 6, 7, 8].map((place) => token(`look-${place}`)[paper]);
  for (const one of colours) {
    const [low, high] = [luminance(one), luminance(background)].sort((a, b) => a - b);
    expect((high! + 0.05) / (low! + 0.05)).toBeGreaterThan(3);
  }
  for (const matrix of Object.values(SIGHTS)) {
    const seen = colours.map((one) => lab(times(matrix, linear(one))));
    for (const [k, one] of seen.entries())
      for (const other of seen.slice(k + 1))
        expect(Math.hypot(...one.map((value, axis) => value - other[axis]!))).toBeGreaterThan(20);
  }
});

test("only the tokens set colours and sizes of text", () => {
  const set =
    /#[0-9a-f]{6}\b|#[0-9a-f]{3,4}\b(?=[;"' ])|\brgba?\(|\bhsl\(|light-dark\(#|font-size: *[\d.]|font-weight: *[5-9]\d\d/i;
  const found = Object.entries(SOURCES).flatMap(([name, text]) =>
    (name.endsWith("tokens.css") ? "" : text)
      .split("\n")
      .filter((line) => set.test(line))
      .map((line) => `${name}: ${line.trim()}`),
  );
  expect(found).toEqual([]);
});
