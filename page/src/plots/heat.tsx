/**
 * Heat map of friction over speed and pressure. Cells are measured or from the fit, and hatched where the fit is
 * extrapolated.
 */
import { digits, fitting } from "./looks";

interface Heated {
  edges: number[];
  rows: { label: string; cells: ([friction: number, kind: string] | null)[] }[];
}

const MOST_LEFT = 190;
const MOST_CELL = { width: 26, height: 20 };
const BELOW = 62;
const MM = 1000;
const KINDS: Record<string, string> = {
  measured: "mean of the measured points",
  fit: "from the fit, between measured speeds",
  extrapolated: "from the fit, beyond the measured speeds",
};

/** Return a colour between that of the lowest and that of the highest value. */
export const colour = (share: number): string =>
  `color-mix(in srgb, var(--heat-high) ${Math.round(100 * share)}%, var(--heat-low))`;

export function Heat({ of }: { of: Heated }) {
  const values = of.rows.flatMap((row) => row.cells.flatMap((cell) => (cell ? [cell[0]] : [])));
  if (of.rows.length < 2 || values.length < 2) return null;
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const share = (value: number) => (high > low ? (value - low) / (high - low) : 0.5);
  const columns = of.edges.length - 1;
  const width = fitting(MOST_LEFT + columns * MOST_CELL.width + 24);
  const left = Math.min(MOST_LEFT, 0.38 * width);
  const cell = { width: (width - left - 24) / columns, height: MOST_CELL.height };
  const height = of.rows.length * cell.height;
  return (
    <figure class="plot heat" data-heat={of.rows.length}>
      <figcaption>Friction over speed and pressure</figcaption>
      <svg
        viewBox={`0 0 ${width} ${height + BELOW}`}
        role="img"
        aria-label={`Friction from ${digits(low)} to ${digits(high)} N over speed and chamber pressures; the table below has the points`}>
        <defs>
          <pattern id="hatch" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">
            <line x1="0" y1="0" x2="0" y2="6" class="hatch" />
          </pattern>
        </defs>
        {of.rows.map((row, y) => (
          <g key={row.label}>
            <text x={left - 8} y={(y + 0.7) * cell.height} text-anchor="end">
              {row.label}
            </text>
            {row.cells.map((one, x) => {
              if (!one) return null;
              const at = {
                x: left + x * cell.width,
                y: y * cell.height,
                width: cell.width - 1,
                height: cell.height - 1,
              };
              return (
                <g key={x}>
                  <rect
                    {...at}
                    fill={colour(share(one[0]))}
                    data-kind={one[1]}
                    class={one[1] === "measured" ? "measured" : ""}>
                    <title>{`${row.label}, ${digits(MM * of.edges[x]!, 3)} to ${digits(MM * of.edges[x + 1]!, 3)} mm/s: ${digits(one[0])} N, ${KINDS[one[1]]}`}</title>
                  </rect>
                  {one[1] === "extrapolated" && <rect {...at} fill="url(#hatch)" pointer-events="none" />}
                </g>
              );
            })}
          </g>
        ))}
        {of.edges.map(
          (edge, x) =>
            x % 4 === 0 && (
              <text key={x} x={left + x * cell.width} y={height + 16} text-anchor="middle">
                {digits(MM * edge, 3)}
              </text>
            ),
        )}
        <text x={left + (columns * cell.width) / 2} y={height + 34} text-anchor="middle">
          speed, mm/s
        </text>
        {Array.from({ length: 40 }, (_, k) => (
          <rect key={k} x={left + 4 * k} y={height + 44} width={4} height={12} fill={colour(k / 39)} />
        ))}
        <text x={left - 8} y={height + 55} text-anchor="end">
          {digits(low, 3)} N
        </text>
        <text x={left + 168} y={height + 55}>
          {digits(high, 3)} N
        </text>
      </svg>
      <p class="note">
        Framed: mean of the measured points. Without a frame: from the fit. Hatched: from the fit, beyond the measured
        speeds.
      </p>
    </figure>
  );
}
