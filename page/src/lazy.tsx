/** Parts of the page whose code is loaded when they are shown first. */
import { signal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect } from "preact/hooks";

/** Return the component of a module. Nothing is shown until it is loaded. */
export function lazy<Props extends object>(load: () => Promise<{ default: ComponentType<Props> }>) {
  const loaded = signal<ComponentType<Props> | null>(null);
  return function Lazy(props: Props) {
    useEffect(() => void load().then((module) => (loaded.value = module.default)), []);
    const Loaded = loaded.value;
    return Loaded && <Loaded {...props} />;
  };
}
