"""Every shell block of tutorial and how-to does what it shows, at a robot that is simulated."""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import pytest

from tests.docs.newcomer import Newcomer
from tests.docs.pages import SHELLS, Command, blocks, name, pages
from tests.unit.insole.encode import Sender
from tests.unit.training.walkers import day, put

EDS: Final = Path(__file__).parents[2] / "eds" / "files"
PAGE_S: Final = 300  # a page with a simulator, on a busy machine

# Blocks that a test cannot run, a page in their order, and why not.
BY_HAND: Final[Mapping[str, tuple[str, ...]]] = {
    "how-to/bench.md": (
        "a recorded robot's own bus and serial port",
        "root, to make an interface of the kernel",
        "a CAN adapter with real drives",
    ),
    "how-to/containers.md": ("Docker", "Docker", "Docker"),
    "how-to/first-robot.md": ("the package index, and leave to write into /opt", "two computers, and root"),
    "how-to/measure-the-cost.md": (
        "a control loop on the robot's computer, which the simulated robot has not",
    ),
    "how-to/pair.md": ("root", "a person on the robot, with its code", "two computers", "root"),
    "how-to/predict.md": ("recordings of others, of some hundred megabytes",),
    "how-to/install.md": ("the package index",),
    "how-to/record.md": ("root, and systemd",),
    "how-to/release.md": ("a clone to build, and the package index", "a remote that takes the tag"),
    "how-to/run-as-a-service.md": ("root, and systemd",),
    "how-to/train.md": ("a wearer who steps for more than a minute, and a model of others", "a Dask cluster"),
    "how-to/wire-a-joint.md": ("root, and a CAN adapter",),
    "how-to/wire-a-sensor.md": ("somebody who loads an insole with known weights",),
    "tutorial/first-walk.md": ("a display, and somebody who closes the window",),
}


def _vendors_file(newcomer: Newcomer) -> None:
    shutil.copy(EDS / "schunk_prl.eds", newcomer.home / "my_drive.eds")


def _a_sensor(newcomer: Newcomer) -> None:
    newcomer.start(Command("gwrms sim --dir ~/sensor", ('{"ready": true, …',)))


def _a_recorded_robot(newcomer: Newcomer) -> None:
    """Its bus, on which a node shows that it lives, and its left insole."""
    log = "".join(f"({1_795_255_200 + tenth / 10:.6f}) can0 702#05\n" for tenth in range(20))
    (newcomer.home / "candump-2026-11-21_101500.log").write_text(log, encoding="utf-8")
    insole = Sender()
    (newcomer.home / "left.bin").write_bytes(b"".join(insole.frame([200] * 16) for _ in range(200)))
    (newcomer.home / "left.bin.json").write_text('{"baudrate": 230400, "seconds": 1.0}', encoding="utf-8")


def _three_wearers(newcomer: Newcomer) -> None:
    """In the newcomer's store: three who stand, walk and sit, each for eight seconds."""
    data = newcomer.home / ".local" / "share" / "gwrms"
    data.mkdir(parents=True)
    wearers = [day(f"20261121T{hour}30Z-{hour}aaaa", hour, wearer=f"P{hour}") for hour in (15, 16, 17)]
    put((data / "store").as_uri(), data / "spool", wearers)


# What a page takes for granted.
GIVEN: Final[Mapping[str, Callable[[Newcomer], None]]] = {
    "how-to/add-an-imu.md": _a_sensor,
    "how-to/bench.md": _a_recorded_robot,
    "how-to/first-robot.md": _vendors_file,
    "how-to/wire-a-joint.md": _vendors_file,
    "how-to/train.md": _three_wearers,
}

# What a page names that only a real robot has, and what is here in its place.
STAND_INS: Final[Mapping[str, Mapping[str, str]]] = {
    "how-to/add-an-imu.md": {"/dev/ttyUSB0": "sensor/trunk"},
    "how-to/wire-a-sensor.md": {"/dev/serial/by-id/usb-insole-left": "robot/left_insole"},
}


def _has_shell(page: Path) -> bool:
    return any(block.is_shell and not block.by_hand for block in blocks(page))


@pytest.mark.usefixtures("store_libraries")  # they open sockets once, for good
@pytest.mark.timeout(PAGE_S)
@pytest.mark.parametrize("page", [page for page in pages() if _has_shell(page)], ids=name)
def test_what_the_page_shows_happens(page: Path) -> None:
    with Newcomer(STAND_INS.get(name(page), {})) as newcomer:
        if name(page) in GIVEN:
            GIVEN[name(page)](newcomer)
        for block in blocks(page):
            newcomer.type(block)
        newcomer.end()


def test_nobody_hides_a_block_from_being_run() -> None:
    found = {name(page): sum(block.is_shell and block.by_hand for block in blocks(page)) for page in pages()}
    assert {page: count for page, count in found.items() if count} == {
        page: len(reasons) for page, reasons in BY_HAND.items()
    }


@pytest.mark.parametrize("page", pages(), ids=name)
def test_what_is_typed_stands_in_a_block_that_is_run(page: Path) -> None:
    for block in blocks(page):
        if block.language not in SHELLS:
            assert not block.text.startswith(("$ ", "gwrms ", "./dev ")), block.text
        else:
            assert block.language in ("sh", "console"), "write ```sh, or ```console with its output"
            assert set(block.words.split()) <= {"by-hand", "terminal"}, block.words
