"""Structured text of IEC 61131-3, as far as exported laws use it: read by its grammar, and run."""

from __future__ import annotations

import math
import re
from typing import Any

TOKEN = re.compile(
    r"\s*(?:(\(\*.*?\*\))|(\d+\.\d+(?:E[+-]?\d+)?)|(\d+)|([A-Za-z]\w*)|(:=|\.\.|[-+*/()\[\],;:<])|(\S))", re.S
)
TYPES = ("LREAL", "BOOL")
FUNCTIONS = {
    "SEL": (3, "(({2}) if ({0}) else ({1}))"),
    "SQRT": (1, "sqrt({0})"),
    "EXP": (1, "exp({0})"),
    "LN": (1, "log({0})"),
    "SIN": (1, "sin({0})"),
    "COS": (1, "cos({0})"),
    "ABS": (1, "abs({0})"),
    "EXPT": (2, "pow({0}, {1})"),
}


class FunctionBlock:
    """A function block of one text. `inputs` and `outputs` are names; `of` holds all variables."""

    def __init__(self, text: str) -> None:
        self.tokens = []
        for comment, real, whole, word, sign, other in TOKEN.findall(text):
            assert not other, f"{other!r} is no token"
            if not comment:
                kind = "real" if real else "whole" if whole else "word" if word else "sign"
                self.tokens.append((kind, real or whole or word or sign))
        self.place, self.inputs, self.outputs = 0, [], []
        self.of: dict[str, Any] = {}
        self._take("FUNCTION_BLOCK")
        self.name = self._any("word")
        while self._next() in ("VAR_INPUT", "VAR_OUTPUT", "VAR", "VAR_TEMP"):
            self._variables()
        lines = self._statements("", ("END_FUNCTION_BLOCK",))
        self._take("END_FUNCTION_BLOCK")
        assert self.place == len(self.tokens)
        functions = {name: getattr(math, name) for name in ("sqrt", "exp", "log", "sin", "cos", "pow")}
        scope: dict[str, Any] = functions | {"of": self.of}
        exec(compile("def run():\n" + "\n".join(lines), self.name, "exec"), scope)
        self._run = scope["run"]

    def run(self, **inputs: float) -> dict[str, float]:
        """Call the block."""
        assert set(inputs) <= set(self.inputs)
        self.of.update(inputs)
        self._run()
        return {name: self.of[name] for name in self.outputs}

    def _next(self) -> str:
        return self.tokens[self.place][1]

    def _any(self, kind: str) -> str:
        own, text = self.tokens[self.place]
        assert own == kind, f"{text!r} where {kind} is needed"
        self.place += 1
        return text

    def _take(self, *texts: str) -> None:
        for text in texts:
            assert self._next() == text, f"{self._next()!r} where {text!r} is needed"
            self.place += 1

    def _taken(self, text: str) -> bool:
        found = self._next() == text
        self.place += found
        return found

    def _variables(self) -> None:
        section = self._any("word")
        while not self._taken("END_VAR"):
            name = self._any("word")
            assert name not in self.of, f"{name} is declared twice"
            self._take(":")
            count = 0
            if self._taken("ARRAY"):
                self._take("[", "0", "..")
                count = int(self._any("whole")) + 1
                self._take("]", "OF")
            kind = self._any("word")
            assert kind in TYPES
            value: Any = 0.0 if kind == "LREAL" else False
            if self._taken(":="):
                sign = -1.0 if self._taken("-") else 1.0
                value = sign * float(self._any("real"))
            self._take(";")
            self.of[name] = [value] * count if count else value
            names = {"VAR_INPUT": self.inputs, "VAR_OUTPUT": self.outputs}.get(section)
            if names is not None:
                names.append(name)

    def _statements(self, indent: str, ends: tuple[str, ...]) -> list[str]:
        indent, lines = indent + " ", []
        while self._next() not in ends:
            if self._taken("IF"):
                lines.append(f"{indent}if {self._expression()}:")
                self._take("THEN")
                lines += self._statements(indent, ("ELSE",))
                self._take("ELSE")
                lines.append(f"{indent}else:")
                lines += self._statements(indent, ("END_IF",))
                self._take("END_IF", ";")
                continue
            target = self._variable()
            self._take(":=")
            lines.append(f"{indent}{target} = {self._expression()}")
            self._take(";")
        return lines

    def _variable(self) -> str:
        name = self._any("word")
        assert name in self.of, f"{name} is not declared"
        if not isinstance(self.of[name], list):
            return f"of[{name!r}]"
        self._take("[")
        place = int(self._any("whole"))
        assert place < len(self.of[name]), f"{name}[{place}] is beyond the end"
        self._take("]")
        return f"of[{name!r}][{place}]"

    def _expression(self) -> str:
        left = self._sum()
        return f"{left} < {self._sum()}" if self._taken("<") else left

    def _sum(self) -> str:
        return self._chain(self._product, ("+", "-"))

    def _product(self) -> str:
        return self._chain(self._factor, ("*", "/"))

    def _chain(self, part: Any, signs: tuple[str, str]) -> str:
        text = part()
        while self._next() in signs:
            text = f"({text} {self._any('sign')} {part()})"
        return text

    def _factor(self) -> str:
        if self._taken("-"):
            return f"(-{self._factor()})"
        if self._taken("("):
            inner = self._expression()
            self._take(")")
            return f"({inner})"
        kind, text = self.tokens[self.place]
        if kind == "real":
            return self._any("real")
        if text in ("TRUE", "FALSE"):
            self.place += 1
            return text.title()
        if text in FUNCTIONS:
            self.place += 1
            self._take("(")
            given = [self._expression()]
            while self._taken(","):
                given.append(self._expression())
            self._take(")")
            count, form = FUNCTIONS[text]
            assert len(given) == count, f"{text} takes {count}"
            return form.format(*given)
        return self._variable()
