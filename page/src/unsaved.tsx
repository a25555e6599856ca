import { isUnsaved } from "./opened";

/** A word where a view reads the file of a description whose text in the page is another one. */
export function Unsaved({ path }: { path: string }) {
  return isUnsaved(path) ? <p class="note">Changes of {path} that are not saved do not count here.</p> : null;
}
