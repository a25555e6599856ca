"""Each sentence of the table is said somewhere, and code says none that the table does not have."""

import re
from pathlib import Path

import pneudrive
from pneudrive.friction.sentences import table

PACKAGE = Path(pneudrive.__file__).parent


def test_sentences_of_code_and_table_are_the_same():
    code = "".join(path.read_text("utf-8") for path in (PACKAGE / "friction").rglob("*.py"))
    topics = "|".join(table())
    fixed = set(re.findall(rf'"((?:{topics})\.(?!parquet)\w+)"', code))
    open_ends = set(re.findall(rf'f["\']((?:{topics})\.)\{{', code))  # kinds of one topic, by name
    listed = {f"{topic}.{name}" for topic, sentences in table().items() for name in sentences}
    assert fixed <= listed
    assert {name for name in listed - fixed if not name.startswith(tuple(open_ends))} == set()
    for topic, sentences in table().items():
        for name, said in sentences.items():
            parts = {"text": said} if isinstance(said, str) else said
            assert "text" in parts, f"{topic}.{name}"
            assert set(parts) <= {"text", "remedy"}, f"{topic}.{name}"
            assert not parts["text"].startswith(" ")
