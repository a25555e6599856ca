/** Text editor, loaded when it is opened. Its styles are sheets of a shadow root, not elements. */
import { defaultKeymap, history, historyKeymap } from "@codemirror/commands";
import { HighlightStyle, StreamLanguage, syntaxHighlighting } from "@codemirror/language";
import { toml } from "@codemirror/legacy-modes/mode/toml";
import { lintGutter, setDiagnostics } from "@codemirror/lint";
import { EditorState } from "@codemirror/state";
import { drawSelection, EditorView, keymap, lineNumbers } from "@codemirror/view";
import { tags } from "@lezer/highlight";
import type { Problem } from "../server/generated";

export type Editor = ReturnType<typeof edit>;

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

export function edit(place: HTMLElement, text: string, changed: (text: string) => void) {
  const root = place.shadowRoot ?? place.attachShadow({ mode: "open" });
  let silent = false;
  const view = new EditorView({
    root,
    parent: root,
    state: EditorState.create({
      doc: text,
      extensions: [
        lineNumbers(),
        lintGutter(),
        history(),
        drawSelection(),
        keymap.of([...defaultKeymap, ...historyKeymap]), // Tab leaves the editor
        StreamLanguage.define(toml),
        syntaxHighlighting(colours),
        EditorView.contentAttributes.of({ "aria-label": "Text of the file, TOML", tabindex: "0" }),
        theme,
        EditorView.updateListener.of((update) => {
          if (update.docChanged && !silent) changed(view.state.doc.toString());
        }),
      ],
    }),
  });
  return {
    show(next: string, problems: Problem[]) {
      const now = view.state.doc.toString();
      if (next !== now) {
        silent = true;
        view.dispatch({ changes: { from: 0, to: now.length, insert: next } });
        silent = false;
      }
      const lines = view.state.doc.lines;
      const found = problems.map((one) => {
        const line = view.state.doc.line(Math.min(Math.max(one.line ?? 1, 1), lines));
        const words = [one.what, one.rule && `Rule: ${one.rule}`, one.remedy && `Hint: ${one.remedy}`];
        const message = words.filter(Boolean).join("\n");
        return { from: line.from, to: line.to, severity: "error" as const, message };
      });
      found.sort((a, b) => a.from - b.from);
      view.dispatch(setDiagnostics(view.state, found));
    },
    go(line: number) {
      const at = view.state.doc.line(Math.min(line, view.state.doc.lines));
      view.dispatch({ selection: { anchor: at.from }, scrollIntoView: true });
      view.focus();
    },
    end() {
      view.destroy();
    },
  };
}
