"""Names that users give are shown to the letter: brackets in them are no markup."""

from rich.table import Table

from pneudrive.cli.output import console


def test_names_with_brackets_are_shown_as_they_are(capsys):
    table = Table()
    table.add_column("seal")
    table.add_row("NBR [/dry]")
    shown = console()
    shown.print(table)
    shown.print("! [/dry]: [1, 2]")
    said = capsys.readouterr().out
    assert "NBR [/dry]" in said
    assert "! [/dry]: [1, 2]" in said
