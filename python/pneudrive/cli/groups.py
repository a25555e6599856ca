"""Groups of commands with lazy imports, so that start-up stays fast."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

import typer
from typer.core import TyperGroup

from pneudrive.cli.examples import EXAMPLES
from pneudrive.documented import parts_of
from pneudrive.errors import CommandError, nearest

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence


class LazyGroup(TyperGroup):
    """Group of commands from a table: name -> module with a function or a group of that name.

    Each command module imports heavy libraries only inside its function.
    """

    table: ClassVar[Mapping[str, str]] = {}
    sections: ClassVar[Mapping[str, Sequence[str]]] = {}
    hidden_names: ClassVar[frozenset[str]] = frozenset()

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401
        """Parse the arguments of the group; without arguments, show its help."""
        return super().parse_args(ctx, args or ["--help"])

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401 - typer keeps its context type private
        """Return the names in the order of the table."""
        return list(self.table)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ANN401
        """Import one command; None for an unknown name."""
        if cmd_name not in self.table:
            return None
        found = getattr(import_module(self.table[cmd_name]), cmd_name)
        hidden = cmd_name in self.hidden_names
        if isinstance(found, typer.Typer):
            group = typer.main.get_command(found)
            group.name, group.hidden = cmd_name, hidden
            return group
        text, described = parts_of(found, "Options")
        single = typer.Typer(add_completion=False, rich_markup_mode=None)
        lines = EXAMPLES.get(f"{ctx.command_path} {cmd_name}".removeprefix("pneudrive "), ())
        epilog = "\n  ".join(("\b\nExamples:", *lines)) if lines else None  # \b: click keeps the lines
        single.command(name=cmd_name, hidden=hidden, epilog=epilog, help=text)(found)
        command = typer.main.get_command(single)
        own: dict[str, Any] = {parameter.name: parameter for parameter in command.params}
        for name, (form, words) in described.items():
            own[name].help, own[name].metavar = words, form or own[name].metavar
        return command

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401
        """Write the commands with the first sentence of their help, by section."""
        for section, names in (self.sections or {"Commands": list(self.table)}).items():
            commands = [(name, self.get_command(ctx, name)) for name in names]
            rows = [(name, found.get_short_help_str(200)) for name, found in commands if not found.hidden]
            if rows:
                with formatter.section(section):
                    formatter.write_dl(rows)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401
        """Find the command at the beginning of the arguments.

        Raises
        ------
        CommandError
            The command does not exist; the message gives the nearest name.
        """
        if args and not args[0].startswith("-") and args[0] not in self.table:
            shown = [name for name in self.table if name not in self.hidden_names]
            path = f"{ctx.command_path} {args[0]}".removeprefix("pneudrive ")
            raise CommandError(f"there is no command '{path}'", remedy=nearest(args[0], shown))
        return super().resolve_command(ctx, args)


def command_paths(table: Mapping[str, str], hidden: frozenset[str] = frozenset()) -> Iterator[tuple[str, ...]]:
    """Yield every command of a table as a list of words; commands of a group follow the group."""
    for name, module in table.items():
        if name in hidden:
            continue
        yield (name,)
        found = getattr(import_module(module), name)
        if isinstance(found, typer.Typer):
            kind = found.info.cls
            yield from ((name, *rest) for rest in command_paths(kind.table, kind.hidden_names))  # type: ignore[union-attr]


def group(
    table: Mapping[str, str],
    hidden: frozenset[str] = frozenset(),
    *,
    sections: Mapping[str, Sequence[str]] | None = None,
    completion: bool = False,
) -> typer.Typer:
    """Return a group of lazily imported commands.

    Parameters
    ----------
    table : mapping
        Command -> module, which has a function or a group with the command's name.
    hidden : frozenset of str
        Commands that the help leaves out.
    sections : mapping, optional
        Title -> commands, for the help of the group.
    completion : bool
        Offer ``--install-completion`` and ``--show-completion``; only for the root.

    Returns
    -------
    typer.Typer
    """
    fields = {"table": table, "hidden_names": hidden, "sections": sections or {}}
    kind = type("Group", (LazyGroup,), fields)
    return typer.Typer(
        cls=kind,
        pretty_exceptions_enable=False,
        add_completion=completion,
        rich_markup_mode=None,
    )
