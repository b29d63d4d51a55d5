"""Each test that docs/explanation/promises.md names is there."""

import re
from pathlib import Path

TOP = Path(__file__).parents[3]
TEXT = (TOP / "docs" / "explanation" / "promises.md").read_text(encoding="utf-8")


def test_every_test_that_is_named_exists() -> None:
    files = re.findall(r"`(tests/[\w/]+\.py)`", TEXT)
    assert files
    assert [name for name in files if not (TOP / name).is_file()] == []
    known = {
        name
        for folder in ("unit/recording", "unit/store", "unit/cloud", "scenario")
        for file in (TOP / "tests" / folder).glob("test_*.py")
        for name in re.findall(r"^def (test_\w+)", file.read_text(encoding="utf-8"), re.MULTILINE)
    }
    named = set(re.findall(r"`(test_\w+)`", TEXT))
    assert named
    assert named - known == set()


def test_it_is_found_from_where_people_look() -> None:
    for page in ("docs/how-to/record.md", "docs/explanation/recording.md"):
        assert "promises.md" in (TOP / page).read_text(encoding="utf-8")
