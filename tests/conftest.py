"""Rules for every test: a leaked thread, child process, socket or terminal fails the test that leaked it."""

import atexit
import gc
import itertools
import os
import re
import signal
import threading
import time
from collections.abc import Generator, Iterator
from pathlib import Path

import psutil
import pytest
from hypothesis import HealthCheck, settings

from gateway.process import memory
from tests.stores import (  # noqa: F401  # fixtures, for every test
    backend,
    folder_url,
    new_store_url,
    store_libraries,
    store_url,
)

if "PYTEST_XDIST_WORKER" in os.environ:
    # It looks for 840 names in every module that is there: after Qt and the others, for seconds.
    import skops.io  # noqa: F401

# To lock half a gigabyte, as of a worker that has come far, and to free it again takes a tenth of a second of
# processor at every gateway that begins in it. In processes of its own a gateway locks what it has.
vars(memory)["_call"] = lambda *_: None

README = Path(__file__).with_name("README.md")
# Nothing is lost where these are torn from their neighbours: they share no robot.
LONG = (
    "tests/newcomer/test_pages.py",
    "tests/explore/",
    "tests/explore_store/",
    "tests/gui/walks/",
)
_tests = itertools.count()
ENDS_S = 30.0  # what is ending, and not leaked, has ended within, also on a computer that does much else
SMOKE = "tests/unit/store/test_store.py"  # of all that is tried on an S3 server too, this always is


def hear_ctrl_c() -> None:
    """A shell has what it starts with `&` ignore it, and so would whatever a test starts and ends with it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


hear_ctrl_c()
# What a busy computer needs longer for is no failure of a test.
settings.register_profile("nightly", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile(
    "quick", settings.get_profile("nightly"), max_examples=40
)  # a share of what is usual
if settings.get_current_profile_name() == "default":
    settings.load_profile("quick")


def table_of_marks() -> list[tuple[str, str]]:
    """What begins with which name gets which mark, as the table in README.md has it."""
    return re.findall(r"^\| `(tests/[^`]+)` \| (\w+) \|", README.read_text(encoding="utf-8"), re.MULTILINE)


def _marks_of(item: pytest.Item, marks: list[tuple[str, str]], names: tuple[str, ...]) -> Iterator[str]:
    """`names` are those of `marks`: to look for all at once takes a tenth of the time."""
    node_id = item.nodeid
    if node_id.startswith(names):
        yield from (mark for name, mark in marks if node_id.startswith(name))
    callspec = getattr(item, "callspec", None)
    if callspec is not None and callspec.params.get("backend") == "s3" and not node_id.startswith(SMOKE):
        yield "s3"


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """All that is collected stays: to look for garbage in it, now or later, takes each worker seconds."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()
        gc.set_threshold(20_000, 20, 50)  # to look for garbage as often as Python does takes 6 % of the time
        atexit.register(gc.unfreeze)  # else libraries tell at the end what they have leaked


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Let each worker begin at another part of a folder: the rest is compiled when it comes there.

    In a fresh checkout all would else compile the same file at the same moment, one after the other.
    """
    report = yield
    worker = os.environ.get("PYTEST_XDIST_WORKER", "")
    if worker and isinstance(collector, pytest.Directory) and report.result:
        share = int(worker.removeprefix("gw")) / int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
        first = int(share * len(report.result))
        report.result[:] = report.result[first:] + report.result[:first]
    return report


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> Generator[None, object, object]:
    """Mark what waits for the night, before `-m` chooses; then the longest tests begin first."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        items.sort(key=lambda item: item.nodeid.partition("::")[0])  # the same for all, who began elsewhere
    marks = table_of_marks()
    names = tuple(name for name, _ in marks)
    for item in items:
        for mark in _marks_of(item, marks, names):
            item.add_marker(mark)
    result = yield
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if workers > 1:
        items[:] = longest_first(items, workers)
    return result


def longest_first(items: list[pytest.Item], workers: int) -> list[pytest.Item]:
    """The items in as many parts as there are workers, each of which begins with its share of the long ones.

    So xdist hands them out at first (`--dist worksteal`); else some would begin when all others have ended.
    """
    long = [item for item in items if item.nodeid.startswith(LONG)]
    short = [item for item in items if not item.nodeid.startswith(LONG)]
    size = -(-len(short) // workers)
    return [
        item
        for part in range(workers)
        for item in (*long[part::workers], *short[part * size : (part + 1) * size])
    ]


def _descriptors() -> set[str]:
    open_files: set[str] = set()
    for name in os.listdir("/proc/self/fd"):  # noqa: PTH208 - a Path of each costs more than all the rest
        try:
            target = os.readlink(f"/proc/self/fd/{name}")  # noqa: PTH115
        except OSError:
            continue
        if target.startswith(("socket:", "/dev/pt", "/dev/ttyS", "/dev/ttyUSB")):
            open_files.add(f"{name} → {target}")
    return open_files


def _children() -> list[psutil.Process]:
    """Theirs too. That there are none, as mostly, is known without reading every process of the computer."""
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return []
    return psutil.Process().children(recursive=True)


@pytest.fixture(autouse=True)
def records_of_its_own(request: pytest.FixtureRequest) -> Iterator[None]:
    """No test sees what another one's gateway or server has kept, nor that of this computer's user.

    They are in its `tmp_path`, if it has one; to make one for each would take longer than most tests do.
    """
    if "tmp_path" in request.fixturenames:
        own: Path = request.getfixturevalue("tmp_path")
    else:
        factory: pytest.TempPathFactory = request.getfixturevalue("tmp_path_factory")
        own = factory.getbasetemp() / f"own-{next(_tests)}"
    with pytest.MonkeyPatch.context() as patch:
        for name in ("state", "data", "config"):
            patch.setenv(f"XDG_{name.upper()}_HOME", str(own / name))
        for name in ("STATE_DIRECTORY", "XDG_RUNTIME_DIR"):
            patch.delenv(name, raising=False)
        patch.setattr("gateway.own_folders.SYSTEM", own / "run" / "gwrms")
        yield


@pytest.fixture(autouse=True)
def nothing_leaks() -> Iterator[None]:
    """Fail a test that leaves a thread, a child process, a socket or a terminal behind."""
    threads = set(threading.enumerate())
    children = {child.pid for child in _children()}
    descriptors = _descriptors()
    yield
    deadline = time.monotonic() + ENDS_S
    while True:
        leaked = [
            *(thread.name for thread in threading.enumerate() if thread not in threads),
            *(str(child) for child in _children() if child.pid not in children),
            *sorted(_descriptors() - descriptors),
        ]
        if not leaked:
            return
        if time.monotonic() > deadline:
            pytest.fail(f"leaked by {os.environ.get('PYTEST_CURRENT_TEST', 'this test')}: {leaked}")
        time.sleep(0.02)
