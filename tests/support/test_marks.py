"""The table of what waits for the night names what there is."""

from pathlib import Path

import pytest

from tests.conftest import SMOKE, table_of_marks

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", [SMOKE, *(name for name, _ in table_of_marks())])
def test_what_is_marked_is_there(name: str) -> None:
    file, _, test = name.partition("::")
    text = (ROOT / file).read_text(encoding="utf-8")
    function = test.partition("[")[0].rpartition("::")[2]
    assert f"def {function}(" in text or not test


def test_whatever_waits_has_a_mark_that_is_known(request: pytest.FixtureRequest) -> None:
    known = {mark.partition(":")[0] for mark in request.config.getini("markers")}
    assert {mark for _, mark in table_of_marks()} <= known
    assert len(table_of_marks()) > 5
