/** Platform on legs at a sample of a run, on a canvas. The server has projected its points. */
import { useLayoutEffect, useRef } from "preact/hooks";
import { digits, isDark } from "../plots/looks";
import type { Frame, Numbers } from "../server/frame";
import type { SentPlatform } from "../server/generated";

const FONT = "11px system-ui, sans-serif";

interface Shown {
  now: Frame<object>;
  platform: SentPlatform;
  sample: number; // of the arrays of motion
}

/** Draw a platform at a sample, with the path of its origin until then. */
function draw(
  canvas: HTMLCanvasElement,
  { labels, lines, path, width, height }: SentPlatform,
  points: Numbers,
  sample: number,
): void {
  const ink = getComputedStyle(canvas).color;
  const scale = devicePixelRatio || 1;
  [canvas.width, canvas.height] = [Math.round(width * scale), Math.round(height * scale)];
  const pen = canvas.getContext("2d")!;
  pen.scale(scale, scale);
  pen.lineJoin = "round";
  const stride = 2 * (1 + lines.reduce((sum, one) => sum + one.moving, 0));
  let at = sample * stride;
  for (const line of lines) {
    pen.beginPath();
    for (const [x, y] of line.points) pen.lineTo(x, y);
    for (const end = at + 2 * line.moving; at < end; at += 2) pen.lineTo(points[at]!, points[at + 1]!);
    pen.strokeStyle = pen.fillStyle = ink;
    pen.globalAlpha = line.fill;
    if (line.fill) pen.fill();
    pen.globalAlpha = line.opacity;
    pen.lineWidth = line.width;
    pen.setLineDash(line.dash);
    pen.stroke();
  }
  pen.setLineDash([]);
  pen.globalAlpha = 1;
  pen.beginPath();
  for (let one = 1; one <= sample + 1; one++) pen.lineTo(points[one * stride - 2]!, points[one * stride - 1]!);
  pen.strokeStyle = path[isDark() ? 1 : 0];
  pen.lineWidth = 1.6;
  pen.stroke();
  pen.font = FONT;
  [pen.textAlign, pen.textBaseline] = ["center", "middle"];
  for (const [text, x, y] of labels) pen.fillText(text, x, y);
}

export function PlatformAt({ now, platform, sample }: Shown) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const points = now.arrays.get(`platform/${platform.name}`)!;
  const dark = isDark();
  useLayoutEffect(() => draw(canvas.current!, platform, points, sample), [points, sample, dark]);
  return (
    <div class="platform" data-platform={platform.name} data-sample={sample}>
      <canvas
        ref={canvas}
        role="img"
        aria-label={`Platform ${platform.name}, isometric. The table has its values.`}
        style={{ maxWidth: `${platform.width}px` }}
      />
      <table aria-label={`Values of ${platform.name}`}>
        <tbody>
          {platform.outputs.map(({ column, label, unit, size }) => {
            const value = now.arrays.get(`motion/${column}`)![sample]!;
            return (
              <tr key={column}>
                <th scope="row">{label}</th>
                <td data-output={column} data-si={value}>
                  {digits(Math.round((1e6 * value) / size) / 1e6, 4)} {unit}
                </td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </div>
  );
}
