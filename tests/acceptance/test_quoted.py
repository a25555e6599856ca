"""A number that pages quote stands in one file: README is compared with it, the documentation takes it from there."""

import re
from pathlib import Path

from benches.quoted import quoted, speed_table
from benches.record import renewed
from pneudrive.control.mismatch import ready_mismatches

ROOT = Path(__file__).resolve().parents[2]


def test_readme_has_the_measured_times():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for row in speed_table():
        assert row in text
    numbers = quoted()
    assert f"takes {numbers['simulate_ms']} ms" in text
    assert f"take {numbers['ensemble_member_us']} us each" in text
    assert f"at {numbers['inside_seals']} held-out pressures" in text


def test_recorded_figures_replace_those_of_readme():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    older = re.sub(r"(?<=\| )\d+(\.\d)?(?= \|)|(?<=takes )[\d.]+(?= ms)|(?<=take )\d+(?= us)", "7.77", text)
    assert older.count("7.77") >= 11
    assert renewed(older.replace("take 7.77 us", "take 7 us")) == text


def test_every_substitution_of_the_documentation_is_known():
    pages = [(page, page.read_text(encoding="utf-8")) for page in (ROOT / "docs").rglob("*.md")]
    used = {name for _, text in pages for name in re.findall(r"{{ (\w+) }}", text)}
    assert used
    assert used <= quoted().keys()


def test_no_page_repeats_the_time_of_a_peer():
    """Times of peers stand in benches/results.md and in README, which is compared; other pages take substitutions."""
    for page in (ROOT / "docs").rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"\d+\s+times[^.]{0,80}(odeint|LSODA|CVODE)", text), page


def test_the_page_of_controllers_names_every_ready_mismatch():
    text = (ROOT / "docs/guide/control.md").read_text(encoding="utf-8")
    assert [name for name in ready_mismatches() if f"`{name}`" not in text] == []
