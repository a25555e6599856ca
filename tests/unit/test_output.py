"""What users read: names to the letter, for brackets in them are no markup; of many alike warnings some."""

from rich.table import Table

from pneudrive.cli import main
from pneudrive.cli.terminal import console
from pneudrive.errors import warn


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


def test_warnings_that_differ_only_in_numbers_are_printed_three_times_and_counted(capsys):
    with main._plain_warnings():
        for number in range(10):
            warn(f"the gas cools to -{number}.5 degC in chamber b at 0.{number} s")
            warn(f"recording r{number} is odd")
    notes = capsys.readouterr().err.splitlines()
    assert sum("gas" in note for note in notes) == 4
    assert notes[-1].startswith("Note: 7 more with other numbers")
    assert sum("recording" in note for note in notes) == 10
