"""Every shell block of README, tutorial and how-to does what it shows, at a robot that is simulated."""

import shutil
import tarfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import pytest

from tests.fake_robot import FakeRobot
from tests.newcomer.newcomer import Newcomer, free_port
from tests.newcomer.pages import BY_HAND, CLOSED, ROOT, SHELLS, TERMINAL, Command, Page, blocks, pages
from tests.newcomer.walks import PASSED, WALKS
from tests.support.extras import brought, needed
from tests.support.installed import build
from tests.support.wheelhouse import pack
from tests.unit.training.walkers import day, put

EDS: Final = ROOT / "eds" / "files"
PAGE_S: Final = 600  # a page with a simulator, on a busy machine
MACHINE: Final = "~/robot"
READY: Final = '{"ready": true, …'

# Blocks that a test cannot run, a page in their order, and why not.
NOT_TYPED: Final[Mapping[str, tuple[str, ...]]] = {
    "how-to/bench.md": (
        "a recorded robot's own bus",
        "root, to make an interface of the kernel",
        "a CAN adapter with real drives",
    ),
    "how-to/commission.md": (
        "hands at a robot",
        "hands at a robot that has been homed",
        "a dialogue with hands at a simulated one",
    ),
    "how-to/containers.md": ("Docker", "Docker", "Docker"),
    "how-to/first-robot.md": ("root", "root", "two computers, and root"),
    "how-to/judge-an-edit.md": ("a walk of minutes, before and after an edit",),
    "how-to/what-changed.md": ("two recorded walks of minutes, some days apart",),
    "how-to/try-two-values.md": (
        "a walk of five minutes, with a value changed twenty times",
        "what came of that walk",
        "a walk of minutes, and somebody who watches",
    ),
    "how-to/measure-the-cost.md": (
        "a control loop on the robot's computer, which the simulated robot has not",
    ),
    "how-to/pair.md": (
        "root",
        "a person on the robot, with its code",
        "two computers",
        "root",
        "ssh, and root there",
    ),
    "how-to/predict.md": ("recordings of others, of some hundred megabytes",),
    "how-to/privacy.md": (
        "a wearer",
        "root, and an empty disk",
        "a bucket of one's own",
        "recordings of a wearer that are never brought back",
    ),
    "how-to/record.md": ("root, and systemd",),
    "how-to/release.md": ("a clone to build, and the package index", "a remote that takes the tag"),
    "how-to/run-as-a-service.md": ("root, and systemd",),
    "how-to/test-a-joint.md": (
        "a joint on a bench, and an emergency stop",
        "a recording of that joint",
        "a phrase that is typed when it is asked for",
    ),
    "how-to/train.md": ("a wearer who steps for more than a minute, and a model of others",),
    "how-to/wire-a-joint.md": ("root, and a CAN adapter",),
    "how-to/wire-a-sensor.md": ("somebody who loads an insole with known weights",),
}


def _vendors_file(newcomer: Newcomer) -> None:
    shutil.copy(EDS / "trinamic_tmcm_1270.eds", newcomer.home / "my_drive.eds")


def _a_sensor(newcomer: Newcomer) -> None:
    newcomer.start(Command("gwrms sim --dir ~/sensor", (READY,)))


def _a_recorded_robot(newcomer: Newcomer) -> None:
    """Its bus, on which a node shows that it lives, and its left insole."""
    _a_sensor(newcomer)
    log = "".join(f"({1_795_255_200 + tenth / 10:.6f}) can0 702#05\n" for tenth in range(20))
    (newcomer.home / "candump-2026-11-21_101500.log").write_text(log, encoding="utf-8")


def _three_wearers_and_a_cluster(newcomer: Newcomer) -> None:
    _three_wearers(newcomer)
    address = f"tcp://127.0.0.1:{free_port()}"
    newcomer.call("tcp://192.0.2.9:8786", address)
    dask = "python3 -m distributed.cli.dask_"
    newcomer.start(Command(f"{dask}scheduler --host {address} --no-dashboard", ("…", "…Scheduler at:…")))
    newcomer.start(Command(f"{dask}worker {address} --nthreads 1 --no-dashboard", ("…", "…Registered to:…")))


def _three_wearers(newcomer: Newcomer) -> None:
    """In the newcomer's store: three who stand, walk and sit, each for eight seconds."""
    data = newcomer.home / ".local" / "share" / "gwrms"
    data.mkdir(parents=True)
    wearers = [day(f"20261121T{hour}30Z-{hour}aaaa", hour, wearer=f"P{hour}") for hour in (15, 16, 17)]
    put((data / "store").as_uri(), data / "spool", wearers)


def _a_robot(newcomer: Newcomer) -> None:
    """Its file, and whatever it has that is plugged in."""
    newcomer.start(Command(f"gwrms sim --dir {MACHINE}", (READY,)))


def _a_robot_with_files(newcomer: Newcomer) -> None:
    _vendors_file(newcomer)
    _a_robot(newcomer)


def _a_robot_that_is_served(newcomer: Newcomer) -> None:
    _a_robot(newcomer)
    newcomer.start(Command(f"gwrms gateway {MACHINE}/robot.toml", ("listening on …",)))


def _a_clone_and_an_index(newcomer: Newcomer) -> None:
    """The sources, and what pip would find on the index, but for what only the desk has."""
    with tarfile.open(build("sdist", ROOT, newcomer.home)) as archive:
        archive.extractall(newcomer.home, filter="data")
    (newcomer.folder,) = newcomer.home.glob("gwrms-*/")
    index = newcomer.home / "index"
    index.mkdir()
    pack(brought("sim") | needed(["hatchling"]), index)
    newcomer.set(PIP_NO_INDEX="1", PIP_FIND_LINKS=str(index), PIP_DISABLE_PIP_VERSION_CHECK="1")


def _a_clone_and_a_vendors_file(newcomer: Newcomer) -> None:
    _a_clone_and_an_index(newcomer)
    shutil.copy(EDS / "trinamic_tmcm_1270.eds", newcomer.folder / "my_drive.eds")


# What a page takes for granted.
GIVEN: Final[Mapping[str, Callable[[Newcomer], None]]] = {
    "README.md: One command": Newcomer.clone,
    "README.md: You have a robot and want to monitor it": _a_robot_with_files,
    "README.md: You write software": _a_robot_that_is_served,
    "how-to/add-an-imu.md": _a_sensor,
    "how-to/bench.md": _a_recorded_robot,
    "how-to/first-robot.md": _a_clone_and_a_vendors_file,
    "how-to/install.md": _a_clone_and_an_index,
    "how-to/wire-a-joint.md": _vendors_file,
    "how-to/run-as-a-service.md": _a_robot,
    "how-to/train.md": _three_wearers_and_a_cluster,
    "tutorial/first-walk.md": Newcomer.clone,
}

# What a page names that only a real robot has, and what is here in its place.
STAND_INS: Final[Mapping[str, Mapping[str, str]]] = {
    "README.md: You have a robot and want to monitor it": {"ROBOT:": "127.0.0.1:", "/etc/gwrms": "~/robot"},
    "how-to/bench.md": {"/dev/ttyUSB0": "sensor/left_insole"},
    "how-to/first-robot.md": {"/opt/gwrms": "~/opt"},
    "how-to/install.md": {"[server]": "[sim]"},
    "how-to/run-as-a-service.md": {"/etc/gwrms": "~/robot"},
    "how-to/add-an-imu.md": {"/dev/ttyUSB0": "sensor/trunk"},
    "how-to/wire-a-sensor.md": {"/dev/serial/by-id/usb-insole-left": "robot/left_insole"},
}


def _typed(page: Page) -> str:
    """All that is typed of it."""
    return "".join(
        block.text for block in blocks(page) if block.is_script or (block.is_shell and not block.by_hand)
    )


TYPED: Final = {page.name: page for page in pages() if _typed(page)}


@pytest.mark.usefixtures("store_libraries")  # they open sockets once, for good
@pytest.mark.timeout(PAGE_S)
@pytest.mark.parametrize(("walk", "name"), [(walk, name) for walk in WALKS for name in WALKS[walk]])
def test_what_the_page_shows_happens(walk: str, name: str, programs: Path) -> None:
    page = TYPED[name]
    with Newcomer(programs, STAND_INS.get(page.name, {})) as newcomer:
        if page.name in GIVEN:
            GIVEN[page.name](newcomer)
        for block in blocks(page):
            newcomer.type(block)
        newcomer.end()


def test_the_script_of_the_readme_writes(capsys: pytest.CaptureFixture[str]) -> None:
    """At a fake robot; at a simulated one by night."""
    (script,) = (block for block in blocks(TYPED["README.md: You write software"]) if block.is_script)
    with FakeRobot() as robot:
        assert "127.0.0.1:7420" in script.text
        exec(script.text.replace("127.0.0.1:7420", robot.address))
        assert robot.parameters["gait.step_length"] == 0.42
    assert capsys.readouterr().out == "{'gait.step_length': 0.42}\n"


def test_every_page_on_which_something_is_typed_is_on_a_walk() -> None:
    assert sorted(name for walk in WALKS.values() for name in walk) == sorted(TYPED)


@pytest.mark.parametrize("walk", WALKS)
def test_a_walk_leads_past_what_its_user_needs(walk: str) -> None:
    typed = "".join(_typed(TYPED[name]) for name in WALKS[walk])
    assert [one for one in PASSED[walk] if one not in typed] == []


def test_nobody_hides_a_block_from_being_run() -> None:
    found = {page.name: sum(block.is_shell and block.by_hand for block in blocks(page)) for page in pages()}
    assert {page: count for page, count in found.items() if count} == {
        page: len(reasons) for page, reasons in NOT_TYPED.items()
    }


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_what_is_typed_stands_in_a_block_that_is_run(page: Page) -> None:
    for block in blocks(page):
        if block.language not in SHELLS:
            assert not block.text.startswith(("$ ", "gwrms ", "./dev ")), block.text
        else:
            assert block.language in ("sh", "console"), "write ```sh, or ```console with its output"
            assert set(block.words.split()) <= {BY_HAND, TERMINAL, CLOSED}, block.words
