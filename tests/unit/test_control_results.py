"""The page of results of control has the values that were measured."""

import json

from benches.control_results import PAGE, VALUES, page


def test_the_page_is_that_of_the_measured_values():
    assert PAGE.read_text(encoding="utf-8") == page(json.loads(VALUES.read_text(encoding="utf-8")))
