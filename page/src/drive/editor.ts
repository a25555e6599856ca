/** Text editor, loaded when it is opened. Its styles are sheets of a shadow root, not elements. */
import { defaultKeymap, history, historyKeymap } from "@codemirror/commands";
import { HighlightStyle, StreamLanguage, syntaxHighlighting } from "@codemirror/language";
import { toml } from "@codemirror/legacy-modes/mode/toml";
import { lintGutter, setDiagnostics } from "@codemirror/lint";
import { EditorState } from "@codemirror/state";
import { drawSelection, EditorView, keymap, lineNumbers } from "@codemirror/view";
import { tags } from "@lezer/highlight";
import type { Problem } from "../server/server";

export interface Editor {
  show(text: string, problems: Problem[]): void;
  go(line: number): void;
  end(): void;
}

const theme = EditorView.theme({
  "&": { height: "100%", fontSize: "13px", color: "light-dark(#111111, #f2f2f2)", backgroundColor: "light-dark(#ffffff, #1b1d20)" },
  ".cm-gutters": { backgroundColor: "light-dark(#f3f3f3, #26292d)", color: "light-dark(#595959, #b4b4b4)", border: "none" },
  ".cm-cursor": { borderLeftColor: "light-dark(#111111, #f2f2f2)" },
  ".cm-scroller": { fontFamily: "ui-monospace, monospace" },
});

const colours = HighlightStyle.define([
  { tag: tags.string, color: "light-dark(#8a1c1c, #ffb3a7)" },
  { tag: [tags.number, tags.atom, tags.bool], color: "light-dark(#1f5f99, #8ec2f2)" },
  { tag: tags.comment, color: "light-dark(#4d5a4d, #a9bfa9)", fontStyle: "italic" },
  { tag: [tags.propertyName, tags.heading], color: "light-dark(#111111, #f2f2f2)" },
]);

export function edit(place: HTMLElement, text: string, changed: (text: string) => void): Editor {
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
    show(next, problems) {
      const now = view.state.doc.toString();
      if (next !== now) {
        silent = true;
        view.dispatch({ changes: { from: 0, to: now.length, insert: next } });
        silent = false;
      }
      const lines = view.state.doc.lines;
      const found = problems.map((one) => {
        const line = view.state.doc.line(Math.min(Math.max(one.line ?? 1, 1), lines));
        const message = [one.what, one.rule && `Rule: ${one.rule}`, one.remedy && `Hint: ${one.remedy}`].filter(Boolean).join("\n");
        return { from: line.from, to: line.to, severity: "error" as const, message };
      });
      view.dispatch(setDiagnostics(view.state, found.sort((a, b) => a.from - b.from)));
    },
    go(line) {
      const at = view.state.doc.line(Math.min(line, view.state.doc.lines));
      view.dispatch({ selection: { anchor: at.from }, scrollIntoView: true });
      view.focus();
    },
    end() {
      view.destroy();
    },
  };
}
