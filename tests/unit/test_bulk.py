"""Work in advance: the results keep their order, and threads never run far ahead of who takes them."""

from __future__ import annotations

import threading

import pytest

from pneudrive.batching import in_advance


def test_results_come_in_turn_and_little_is_done_that_nobody_takes():
    started = []
    found = in_advance(lambda n: started.append(n) or n * n, range(100), 2)
    taken = [next(found) for _ in range(10)]
    assert taken == [n * n for n in range(10)]
    found.close()
    assert 10 <= len(started) <= 10 + 5


def test_one_item_needs_no_thread():
    assert list(in_advance(lambda n: threading.current_thread(), [1], 4)) == [threading.current_thread()]


def test_what_is_raised_reaches_who_takes_it():
    found = in_advance(lambda n: 1 // n, [1, 1, 0, 1], 2)
    assert [next(found), next(found)] == [1, 1]
    with pytest.raises(ZeroDivisionError):
        next(found)
