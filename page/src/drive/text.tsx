/** Text of a file, in an editor that is loaded when it is shown. */
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { Problem } from "../server/server";
import type { Editor } from "./editor";

/** Return the editor of a text, and a function that goes to a line of it. Another file (`of`) has another editor. */
export function useEditor(
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
