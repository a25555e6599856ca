/** Text of a file, in an editor that is loaded when it is shown. */
import type { Signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { inCatalogue } from "../routes";
import type { Problem } from "../server/generated";
import { Button, TextInput } from "../workspace/fields";
import { list } from "../workspace/files";
import { isIn, Problems } from "../workspace/parts";
import type { Editor } from "./editor";
import { change, onDisk, opened, problems, said, save, takeFromDisk, wasSaved } from "./opened";

/** Return the editor of a text, and a function that goes to a line of it. Another file (`of`) has another editor. */
function useEditor(
  of: string,
  text: string,
  problems: Problem[],
  type: (text: string) => void,
): [ComponentChildren, (line: number) => void] {
  const place = useRef<HTMLDivElement>(null);
  const editor = useRef<Editor | null>(null);
  const newest = useRef({ text, problems });
  newest.current = { text, problems };
  const show = () => editor.current?.show(newest.current.text, newest.current.problems);
  useEffect(() => {
    if (!of) return;
    let isGone = false;
    void import("./editor").then(({ edit }) => {
      if (isGone || !place.current) return;
      editor.current = edit(place.current, newest.current.text, (next) => {
        newest.current.text = next; // before the next render: an older text would replace what is typed
        type(next);
      });
      show();
    });
    return () => {
      isGone = true;
      editor.current?.end();
      editor.current = null;
    };
  }, [of]);
  useEffect(show, [text, JSON.stringify(problems)]);
  return [<div ref={place} class="editor" />, (line) => editor.current?.go(line)];
}

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
  const [editor, goTo] = useEditor(now ? `text ${now.path}` : "", now?.text ?? "", inText, type);
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
      <Problems of={problems.value} own={own} onLine={goTo} />
      {now && !problems.value.length && <p class="note">No problems.</p>}
    </>
  );
  return [editor, state];
}
