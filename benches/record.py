"""``make record``: the figures of the last ``make bench`` become those that README and the documentation quote."""

from __future__ import annotations

import re
import shutil
import sys

from benches.quoted import CASES, OUT, RESULTS, quoted, speed_table

README = RESULTS.parents[1] / "README.md"


def renewed(text: str) -> str:
    """Return README's text with the recorded figures: rows of its table, time of a run and of a member."""
    for words, row in zip(CASES.values(), speed_table(), strict=True):
        text = re.sub(rf"(?m)^\| {re.escape(words)} \|.*$", row, text)
    numbers = quoted()
    text = re.sub(r"takes [\d.]+ ms\b", f"takes {numbers['simulate_ms']} ms", text)
    return re.sub(r"take \d+ us each", f"take {numbers['ensemble_member_us']} us each", text)


def main() -> None:
    """Copy the results, and write README."""
    if not (OUT / "results.json").is_file():
        sys.exit(f"{OUT / 'results.json'} does not exist: first run make bench")
    for name in ("results.json", "results.md"):
        shutil.copy(OUT / name, RESULTS.with_name(name))
    README.write_text(renewed(README.read_text("utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
