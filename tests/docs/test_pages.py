"""Every shell block of tutorial and how-to does what it shows, at a robot that is simulated."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import pytest

from tests.docs.newcomer import Newcomer, bring
from tests.docs.pages import SHELLS, blocks, name, pages
from tests.unit.training.walkers import day, put

EDS: Final = Path(__file__).parents[2] / "eds" / "files"
PAGE_S: Final = 300  # a page with a simulator, on a busy machine

# Blocks that a test cannot run, a page: they need hardware, a display, root, or a service elsewhere.
BY_HAND: Final[Mapping[str, int]] = {
    "how-to/add-an-imu.md": 1,
    "how-to/bench.md": 5,
    "how-to/first-robot.md": 2,
    "how-to/measure-the-cost.md": 1,
    "how-to/predict.md": 1,
    "how-to/record.md": 2,
    "how-to/release.md": 1,
    "how-to/run-as-a-service.md": 1,
    "how-to/train.md": 2,
    "how-to/wire-a-joint.md": 1,
    "how-to/wire-a-sensor.md": 2,
    "tutorial/first-walk.md": 1,
}


def _vendors_file(home: Path) -> None:
    bring(EDS / "schunk_prl.eds", home)
    (home / "schunk_prl.eds").rename(home / "my_drive.eds")


def _three_wearers(home: Path) -> None:
    """In the store of whoever has this home: three who stand, walk and sit, each for eight seconds."""
    data = home / ".local" / "share" / "gwrms"
    data.mkdir(parents=True)
    wearers = [day(f"20261121T{hour}30Z-{hour}aaaa", hour, wearer=f"P{hour}") for hour in (15, 16, 17)]
    put((data / "store").as_uri(), data / "spool", wearers)


# What a page takes for granted.
GIVEN: Final[Mapping[str, Callable[[Path], None]]] = {
    "how-to/wire-a-joint.md": _vendors_file,
    "how-to/train.md": _three_wearers,
}


def _has_shell(page: Path) -> bool:
    return any(block.is_shell and not block.by_hand for block in blocks(page))


@pytest.mark.usefixtures("store_libraries")  # they open sockets once, for good
@pytest.mark.timeout(PAGE_S)
@pytest.mark.parametrize("page", [page for page in pages() if _has_shell(page)], ids=name)
def test_what_the_page_shows_happens(page: Path) -> None:
    with Newcomer() as newcomer:
        if name(page) in GIVEN:
            GIVEN[name(page)](newcomer.home)
        for block in blocks(page):
            newcomer.type(block)
        newcomer.end()


def test_nobody_hides_a_block_from_being_run() -> None:
    found = {name(page): sum(block.is_shell and block.by_hand for block in blocks(page)) for page in pages()}
    assert {page: count for page, count in found.items() if count} == BY_HAND


@pytest.mark.parametrize("page", pages(), ids=name)
def test_what_is_typed_stands_in_a_block_that_is_run(page: Path) -> None:
    for block in blocks(page):
        if block.language not in SHELLS:
            assert not block.text.startswith(("$ ", "gwrms ", "./dev ")), block.text
        else:
            assert block.language in ("sh", "console"), "write ```sh, or ```console with its output"
            assert set(block.words.split()) <= {"by-hand", "terminal"}, block.words
