"""The glossary is in order, and each thing lives where it says."""

import re
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "reference" / "glossary.md").read_text(encoding="utf-8")
OWN = TEXT.partition("## The product's own words")[2].partition("\n## ")[0]
ROWS = [[cell.strip() for cell in line.split(" | ")] for line in OWN.splitlines() if line.startswith("| ")][
    1:
]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0].strip("| "))
def test_a_word_of_ours_has_another_one_a_meaning_and_a_place(row: list[str]) -> None:
    _word, _elsewhere, meaning, lives = row
    assert meaning.endswith(".")
    paths = re.findall(r"`([^`]+)`", lives)
    assert paths
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_words_are_in_order() -> None:
    words = [re.sub(r"[^a-z ]", "", row[0].lower()).strip() for row in ROWS]
    assert [(one, other) for one, other in pairwise(words) if one > other] == []
