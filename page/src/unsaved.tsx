import { isUnsaved } from "./opened";

/** Note in views that read the file of a description with unsaved changes. */
export function Unsaved({ path }: { path: string }) {
  return isUnsaved(path) ? <p class="note">Changes of {path} that are not saved do not count here.</p> : null;
}
