/** Width of an element that follows the window. */
import type { RefObject } from "preact";
import { useLayoutEffect, useRef, useState } from "preact/hooks";

/** Return a reference for an element, and its width, pixels; `first` before it has a place. */
export function useWidth<T extends Element>(first = 0): [RefObject<T | null>, number] {
  const element = useRef<T>(null);
  const [width, setWidth] = useState(first);
  useLayoutEffect(() => {
    const observer = new ResizeObserver(() => setWidth(element.current?.clientWidth || first)); // also once at the start
    observer.observe(element.current!);
    return () => observer.disconnect();
  }, []);
  return [element, width];
}
