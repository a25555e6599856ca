"""Commands from functions: arguments and options from the signature, help and examples from the docstring.

A positional parameter is an argument, a keyword-only parameter is an option. Their texts are below the heading
``Options`` in the docstring of the function, of its module, or of `pneudrive.cli.options`. The heading ``Examples``
follows. A command module imports computing modules by `pneudrive.lazy_names.used_later`, so that help and shell
completion load only the command modules.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from functools import wraps
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeAlias, get_origin

import typer
from typer.core import TyperGroup

import pneudrive as pn
from pneudrive.cli import options
from pneudrive.documented import parts_of
from pneudrive.errors import CommandError, nearest

#: Title in a help -> commands.
Sections: TypeAlias = Mapping[str, Sequence[str]]
#: Parameters for a description file. Commands with such a parameter also accept catalogue folders.
_DESCRIBED = {"drive", "circuit", "task", "first"}
_CATALOGUE = inspect.Parameter("catalogue", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=list[Path] | None)
_EXAMPLES = "\n\nExamples\n--------\n"


def examples_of(function: Callable[..., Any]) -> list[str]:
    """Return the lines below ``Examples`` in the docstring of a command."""
    return inspect.cleandoc(function.__doc__ or "").partition(_EXAMPLES)[2].splitlines()


def _declared(parameter: inspect.Parameter) -> inspect.Parameter:
    """Declare a parameter for typer: keyword-only as an option, any other as an argument."""
    if parameter.annotation is typer.Context or get_origin(parameter.annotation) is Annotated:
        return parameter
    default: Any = ... if parameter.default is parameter.empty else parameter.default
    if parameter.kind is not parameter.KEYWORD_ONLY:
        return parameter.replace(default=typer.Argument(default))
    flag = (f"--{parameter.name.replace('_', '-')}",) if default is False else ()  # without the opposite "--no-..."
    return parameter.replace(default=typer.Option(default, *flag))


def command_from(function: Callable[..., Any], name: str) -> Any:  # noqa: ANN401 - of click
    """Return the command of a function."""

    @wraps(function)
    def called(**values: Any) -> Any:  # noqa: ANN401
        folders = values.pop("catalogue", None)
        with pn.catalogue_folders(*folders) if folders else nullcontext():
            return function(**values)

    parameters = [_declared(each) for each in inspect.signature(function, eval_str=True).parameters.values()]
    if name == "catalogue" or not _DESCRIBED.isdisjoint(each.name for each in parameters):
        parameters.append(_declared(_CATALOGUE))
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {each.name: each.annotation for each in parameters}
    text, own = parts_of(function, "Options")
    texts = parts_of(options, "Options")[1] | parts_of(sys.modules[function.__module__], "Options")[1] | own
    lines = examples_of(function)
    single = typer.Typer(add_completion=False, rich_markup_mode=None)
    single.command(
        name=name,
        help=text.partition(_EXAMPLES)[0],
        epilog="\n  ".join(("\b\nExamples:", *lines)) if lines else None,  # \b: click keeps the lines
    )(called)
    command = typer.main.get_command(single)
    for parameter in command.params:
        if parameter.name in texts:
            form, parameter.help = texts[parameter.name]  # type: ignore[attr-defined]
            parameter.metavar = form or parameter.metavar
    return command


class LazyGroup(TyperGroup):
    """Group of commands, each imported at its first use.

    Attributes
    ----------
    table : mapping
        Command -> module with a function or a group of the same name.
    sections : mapping
        Title -> commands that help and completion show.
    """

    table: ClassVar[Mapping[str, str]] = {}
    sections: ClassVar[Sections] = {}

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 - typer keeps its context type private
        """Parse the arguments of the group; without arguments, show its help."""
        return super().parse_args(ctx, args or ["--help"])

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401
        """Return the names of the shown commands."""
        return list(chain(*self.sections.values()))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ANN401
        """Import one command; None for an unknown name."""
        if cmd_name not in self.table:
            return None
        content = getattr(import_module(self.table[cmd_name]), cmd_name)
        if not isinstance(content, typer.Typer):
            return command_from(content, cmd_name)
        command = typer.main.get_command(content)
        command.name = cmd_name
        return command

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401
        """Write the commands with the first sentence of their help, by section."""
        for section, names in self.sections.items():
            with formatter.section(section):
                formatter.write_dl([(name, self.get_command(ctx, name).get_short_help_str(200)) for name in names])

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401
        """Find the command at the beginning of the arguments.

        Raises
        ------
        CommandError
            The command does not exist; the message gives the nearest name.
        """
        if args and not args[0].startswith("-") and args[0] not in self.table:
            path = f"{ctx.command_path} {args[0]}".removeprefix("pneudrive ")
            raise CommandError(f"there is no command '{path}'", remedy=nearest(args[0], self.list_commands(ctx)))
        return super().resolve_command(ctx, args)


def group(table: Mapping[str, str], text: str = "", sections: Sections | None = None) -> typer.Typer:
    """Return a group of commands.

    Parameters
    ----------
    table : mapping
        Command -> module, which has a function or a group with the command's name.
    text : str
        Help of the group.
    sections : mapping, optional
        Title -> commands that the help shows. Default: all commands under one title. Only the root group has sections.
        With sections, the group also offers ``--install-completion`` and ``--show-completion``.

    Returns
    -------
    typer.Typer
    """
    kind = type("Group", (LazyGroup,), {"table": table, "sections": sections or {"Commands": list(table)}})
    app = typer.Typer(cls=kind, pretty_exceptions_enable=False, add_completion=bool(sections), rich_markup_mode=None)
    if text:
        app.callback(help=text)(lambda: None)
    return app
