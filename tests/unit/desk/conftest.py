"""A desk with one robot, and what its gateway writes down."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from server_gui.core.desk.desk import Desk
from tests.support.desk import Bench, described, looked
from tests.support.journals import RobotsJournal


@pytest.fixture
def bench() -> Bench:
    """A desk with one robot that has described itself and told its parameters."""
    made = Bench(Desk())
    made.add("exo-01").take([described(), looked()])
    return made


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[RobotsJournal]:
    made = RobotsJournal(tmp_path)
    yield made
    made.close()
