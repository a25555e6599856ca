"""Commands that the documentation and the help show exist with their options; each help fits one screen."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import typer

import pneudrive as pn
from pneudrive import _core
from pneudrive.cli.main import app, run
from pneudrive.describe.components import component_class
from pneudrive.describe.files.load import circuit_schema
from pneudrive.describe.kinds import component_kinds
from pneudrive.describe.system import System

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^(?: {4,}|\$ )(pneudrive (?:.*\\\n)*.*)$", re.MULTILINE)
INLINE = re.compile(r"`(pneudrive [^`\n]+)`")
LINES = 40


def resolve(words):
    """Return the command of the words, its context's parent, and its arguments."""
    command, context = typer.main.get_command(app), None
    name = "pneudrive"
    while hasattr(command, "table") and words:
        context = command.make_context(name, [], parent=context, resilient_parsing=True)
        name, command, words = command.resolve_command(context, words)
    return command, context, words


def unknown_options(words):
    command, _, words = resolve(words)
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    return [word for word in words if word.startswith("--") and word.partition("=")[0] not in {*known, "--help"}]


def shown(pattern):
    for page in PAGES:
        for text in pattern.findall(page.read_text("utf-8")):
            yield page.relative_to(ROOT).as_posix(), text.replace("\\\n", " ")


def test_commands_in_blocks_parse():
    seen = 0
    for page, line in shown(BLOCK):
        words = shlex.split(line.partition("   #")[0])[1:]
        if "&&" in words or any(word.startswith("[") or word == "..." for word in words):
            continue
        if words[0].startswith("-"):
            continue
        command, context, words = resolve(words)
        places = [word for word in words if word != "..."]
        try:
            command.make_context("command", places, parent=context)
        except Exception as error:
            pytest.fail(f"{page}: {line}: {error}")
        seen += 1
    assert seen > 60


def test_inline_commands_have_known_options():
    seen = 0
    for page, line in shown(INLINE):
        words = shlex.split(line)[1:]
        if words[0].startswith(("-", ".")):
            continue
        assert unknown_options([word for word in words if word != "..."]) == [], (page, line)
        seen += 1
    assert seen > 40


def command_paths(group, *before):
    """Yield every shown command of a group and of its inner groups."""
    for name in group.list_commands(None):
        yield (*before, name)
        if hasattr(inner := group.get_command(None, name), "table"):
            yield from command_paths(inner, *before, name)


@pytest.mark.parametrize("path", list(command_paths(typer.main.get_command(app))), ids=" ".join)
def test_help_fits_one_screen_and_ends_with_examples(path, printed, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    text = printed([*path, "--help"]).rstrip()
    assert len(text.splitlines()) <= LINES
    assert max(map(len, text.splitlines())) <= 80
    command = resolve(list(path))[0]
    lines = (command.epilog or "").splitlines()[2:]
    assert lines or hasattr(command, "table")
    assert text.endswith("\n".join(("", *(f"  {line}" for line in lines))))
    for line in "\n".join(lines).replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words[0] == "pneudrive":
            assert unknown_options(words[1:]) == []


# --- A component that the core lists is in schema, file, trajectory, drawing, session and tables without a line of
# Python.
#
# Its table is one that the core writes, for a formula, under a name that nothing in Python knows. What runs is that
# formula: the name is turned back where the core takes the circuit, as a core with this component would know it itself.

KIND = "toy/gap"
FORMULA = {
    "name": "gap",
    "parameters": {"permeance": {"unit": "m3/(s Pa)", "above": 0, "meaning": "Permeance of the gap"}},
    "output": {"mass_flow": "opening*permeance*(p_up - p_down)*rho_0"},
}
FILE = """
connections = ["mains -> gap -> tank"]
initial = { tank = "2 bar abs" }
[components]
mains = { kind = "reservoir", pressure = "7 bar abs" }
tank = { kind = "tank", volume = "1 l" }
gap = { kind = "toy/gap", permeance = "1 dm3/(s bar)" }
"""


@pytest.fixture
def by_formula():
    parts = {"mains": {"kind": "reservoir", "pressure": "7 bar abs"}, "tank": {"kind": "tank", "volume": "1 l"}}
    gap = {"kind": "restriction/formula", "formula": FORMULA, "permeance": "1 dm3/(s bar)"}
    return pn.Circuit(
        components=parts | {"gap": gap}, connections=["mains -> gap -> tank"], initial={"tank": "2 bar abs"}
    )


@pytest.fixture
def listed(by_formula, monkeypatch):
    """Let the core list the toy, and run it."""
    written = next(one["formula"] for one in json.loads(by_formula.core_json())["components"] if one["name"] == "gap")
    entry = _core.formula_component("restriction/formula", json.dumps(written))
    del entry["warnings"]
    entry |= {"kind": KIND, "title": "Toy gap", "formula": None}
    core, components = _core.Circuit, _core.components()

    def known(text, names):
        form = json.loads(text)
        for one in form["components"]:
            if one["kind"] == KIND:
                one |= {"kind": "restriction/formula", "formula": written}
        return core(json.dumps(form), names)

    caches = (component_kinds, component_class, System.compiled)
    monkeypatch.setattr(_core, "components", lambda: [*components, entry])
    monkeypatch.setattr(_core, "Circuit", known)
    for cache in caches:
        cache.cache_clear()
    yield
    monkeypatch.undo()
    for cache in caches:
        cache.cache_clear()


def test_a_component_of_the_core_needs_no_line_of_python(listed, by_formula, tmp_path, printed):
    tomllib = pytest.importorskip("tomllib")
    validator = jsonschema.Draft202012Validator(circuit_schema())
    assert validator.is_valid(tomllib.loads(FILE))
    for wrong in ("permeance = -1", "permeance = true", 'permeanc = "1 dm3/(s bar)"'):
        assert not validator.is_valid(tomllib.loads(FILE.replace('permeance = "1 dm3/(s bar)"', wrong)))

    circuit = pn.Circuit.load(FILE)
    assert circuit.components["gap"].permeance_m3_s_pa == pytest.approx(1e-8)
    assert pn.Circuit.load(circuit.to_toml()) == circuit
    with pytest.raises(pn.errors.DescriptionError, match=r"gap\.permeance.* is out of bounds"):
        pn.Circuit.load(FILE.replace('"1 dm3', '"-1 dm3'))

    run_of_it, wanted = (one.simulate({"gap": 1.0}, "1 s") for one in (circuit, by_formula))
    flow = run_of_it["gap.mass_flow"]
    assert flow.attrs["units"] == "kg/s"
    assert "mass flow from port 1 to port 2" in flow.attrs["long_name"]
    assert np.array_equal(flow, wanted["gap.mass_flow"])
    assert float(flow[0]) == pytest.approx(1e-8 * 5e5 * 1.185)
    assert {"gap.command", "gap.mass_flow_kg_s"} <= {one.name for one in circuit.start().variables}

    card = printed(["components", KIND])
    assert all(word in card for word in ("Toy gap", "permeance", "dm3/(s bar)", "Permeance of the gap", "mass_flow"))
    picture = tmp_path / "picture.svg"
    (tmp_path / "circuit.toml").write_text(FILE)
    assert run(["draw", str(tmp_path / "circuit.toml"), "--out", str(picture)]) == 0
    assert "gap" in picture.read_text()
