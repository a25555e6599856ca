"""The page of results of control has the values that were measured."""

import json

from benches.control_results import PAGE, VALUES, page


def test_the_page_is_that_of_the_measured_values():
    values = json.loads(VALUES.read_text(encoding="utf-8"))
    assert PAGE.read_text(encoding="utf-8") == page(values)
    assert f"| P1 | as described | {values['axes']['P1']['as described']['R1']:g} |" in PAGE.read_text(encoding="utf-8")
