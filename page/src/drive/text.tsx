/** Text of a file, in an editor that is loaded when it is shown. */
import type { Signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useRef } from "preact/hooks";
import { inCatalogue } from "../routes";
import { Button, lazy, TextInput } from "../workspace/fields";
import { list } from "../workspace/files";
import { isIn, Problems } from "../workspace/parts";
import { change, onDisk, opened, problems, said, save, takeFromDisk, wasSaved } from "./opened";

const Editor = lazy(() => import("./editor"));

/**
 * Return the editor of the open text, and its name, state and problems. A text of another path is not shown; a new file
 * gets the name of `name`.
 */
export function useOpenText(path: string, name: Signal<string>): [editor: ComponentChildren, state: ComponentChildren] {
  const now = opened.value?.path === path ? opened.value : null;
  const fileName = now?.sha256 ? now.path.slice(now.path.lastIndexOf("/") + 1) : "unnamed.toml";
  const own = now?.isTask ? "task" : fileName; // as the server calls the text
  const inText = problems.value.filter((one) => isIn(one, own));
  const type = (text: string) => void change(text, true);
  const goTo = useRef((_line: number) => {});
  const editor = (
    <div class="editor">
      {now && <Editor key={`text ${now.path}`} text={now.text} problems={inText} type={type} goTo={goTo} />}
    </div>
  );
  const isSaved = !now || now.text === now.saved;
  const isOld = !isSaved && said.value === wasSaved(path); // it was typed on since
  const state = (
    <>
      <p class="row">
        {path && !inCatalogue(path) ? (
          <Button aria-disabled={isSaved} act={() => isSaved || save(path)} words="Save" />
        ) : (
          <>
            <TextInput label="Name of the file" of={name} placeholder="axis.toml" />
            <Button class="primary" disabled={!now || !name.value} act={() => save(name.value).then(list)}>
              Save as a new file
            </Button>
          </>
        )}
        <span role="status">{(!isOld && said.value) || (isSaved ? "" : "Not saved.")}</span>
      </p>
      {now && onDisk.value && (
        <p class="row">
          <span role="status">{now.path} has changed on disk since you opened it.</span>
          <Button act={takeFromDisk}>Drop these changes and show the file</Button>
        </p>
      )}
      <Problems of={problems.value} own={own} onLine={(line) => goTo.current(line)} />
      {now && !problems.value.length && <p class="note">No problems.</p>}
    </>
  );
  return [editor, state];
}
