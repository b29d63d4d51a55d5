"""The changes of CONTRIBUTING belong to folders and files that there are."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
TABLE = TEXT.partition("## Where a change belongs")[2].partition("\n## ")[0]


def test_they_are_numbered_without_a_gap() -> None:
    numbers = [int(number) for number in re.findall(r"^\| (\d+)\. ", TABLE, re.MULTILINE)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert len(numbers) >= 22


def test_each_change_has_tests_to_check_it_with() -> None:
    rows = [line.strip("| ").split(" | ") for line in TABLE.splitlines() if re.match(r"\| \d+\. ", line)]
    without = [row[0] for row in rows if len(row) != 3 or not re.search(r"`(tests/|\./dev bench)", row[2])]
    assert without == []


def test_every_place_is_there() -> None:
    paths = re.findall(r"`([a-z_0-9]+/[^`*]*)`", TABLE)
    assert len(paths) > 20
    assert [path for path in paths if not (ROOT / path).exists()] == []
