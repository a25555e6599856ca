/** Text editor, loaded when it is opened. Its styles are sheets of a shadow root, not elements. */
import { defaultKeymap, history, historyKeymap } from "@codemirror/commands";
import { HighlightStyle, StreamLanguage, syntaxHighlighting } from "@codemirror/language";
import { toml } from "@codemirror/legacy-modes/mode/toml";
import { lintGutter, setDiagnostics } from "@codemirror/lint";
import { EditorState } from "@codemirror/state";
import { drawSelection, EditorView, keymap, lineNumbers } from "@codemirror/view";
import { tags } from "@lezer/highlight";
import type { RefObject } from "preact";
import { useEffect, useRef } from "preact/hooks";
import type { Problem } from "../server/generated";

const theme = EditorView.theme({
  "&": { height: "100%", fontSize: "var(--table)", color: "var(--ink)", backgroundColor: "var(--surface)" },
  ".cm-gutters": { backgroundColor: "var(--ground)", color: "var(--caption)", border: "none" },
  ".cm-cursor": { borderLeftColor: "var(--ink)" },
  ".cm-scroller": { fontFamily: "var(--mono)" },
});

const colours = HighlightStyle.define([
  { tag: tags.string, color: "var(--code-string)" },
  { tag: [tags.number, tags.atom, tags.bool], color: "var(--code-number)" },
  { tag: tags.comment, color: "var(--code-comment)", fontStyle: "italic" },
  { tag: [tags.propertyName, tags.heading], color: "var(--ink)" },
]);

interface EditorProps {
  text: string;
  problems: Problem[];
  type: (text: string) => void;
  goTo: RefObject<(line: number) => void>; // goes to a line, from outside
}

/** The text with its problems. Another file needs another editor. */
export default function Editor({ text, problems, type, goTo }: EditorProps) {
  const place = useRef<HTMLDivElement>(null);
  const editor = useRef<EditorView | null>(null);
  const shown = useRef(text); // changed before the next render: an older text would replace what is typed
  shown.current = text;
  useEffect(() => {
    const root = place.current!.attachShadow({ mode: "open" });
    const listen = EditorView.updateListener.of(({ docChanged, state }) => {
      const next = state.doc.toString();
      if (docChanged && next !== shown.current) type((shown.current = next));
    });
    const extensions = [
      lineNumbers(),
      lintGutter(),
      history(),
      drawSelection(),
      keymap.of([...defaultKeymap, ...historyKeymap]), // Tab leaves the editor
      StreamLanguage.define(toml),
      syntaxHighlighting(colours),
      EditorView.contentAttributes.of({ "aria-label": "Text of the file, TOML", tabindex: "0" }),
      theme,
      listen,
    ];
    const made = new EditorView({ root, parent: root, state: EditorState.create({ doc: text, extensions }) });
    editor.current = made;
    goTo.current = (line) => {
      const at = made.state.doc.line(Math.min(line, made.state.doc.lines));
      made.dispatch({ selection: { anchor: at.from }, scrollIntoView: true });
      made.focus();
    };
    return () => made.destroy();
  }, []);
  useEffect(() => {
    const view = editor.current!;
    const now = view.state.doc.toString();
    if (shown.current !== now) view.dispatch({ changes: { from: 0, to: now.length, insert: shown.current } });
    const { doc } = view.state;
    const found = problems.map((one) => {
      const line = doc.line(Math.min(Math.max(one.line ?? 1, 1), doc.lines));
      const words = [one.what, one.rule && `Rule: ${one.rule}`, one.remedy && `Hint: ${one.remedy}`];
      const message = words.filter(Boolean).join("\n");
      return { from: line.from, to: line.to, severity: "error" as const, message };
    });
    found.sort((a, b) => a.from - b.from);
    view.dispatch(setDiagnostics(view.state, found));
  }, [text, JSON.stringify(problems)]);
  return <div ref={place} />;
}
