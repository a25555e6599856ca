/** Keys and wheel of a view that is moved and zoomed. */
import type { TargetedWheelEvent } from "preact";

interface ViewActions {
  zoom: (way: 1 | -1) => void; // closer or wider
  reset: () => void;
  step: (right: number, down: number) => void;
}

/** Return the handler of keys: arrows move, + and - zoom, 0 resets. */
export function viewKeys({ zoom, reset, step }: ViewActions): (event: KeyboardEvent) => void {
  const keys: Record<string, () => void> = {
    "+": () => zoom(1),
    "=": () => zoom(1),
    "-": () => zoom(-1),
    "0": reset,
    ArrowLeft: () => step(-1, 0),
    ArrowRight: () => step(1, 0),
    ArrowUp: () => step(0, -1),
    ArrowDown: () => step(0, 1),
  };
  return (event) => keys[event.key] && (event.preventDefault(), keys[event.key]!());
}

/** Return the handler of the wheel with Ctrl. */
export const onZoom =
  (zoom: (way: 1 | -1, event: TargetedWheelEvent<HTMLElement>) => void) =>
  (event: TargetedWheelEvent<HTMLElement>): void => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    zoom(event.deltaY < 0 ? 1 : -1, event);
  };
