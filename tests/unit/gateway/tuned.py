"""Parameters of a robot of fakes without a daemon: the authority, the loop and the records are the test's."""

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from drivers.errors import DeviceTimeout
from gateway.config import RobotConfig
from gateway.modules.component.module import ComponentModule
from gateway.modules.control.tuning import Tuning
from gateway.modules.stop.authority import Address, Authority
from gateway.modules.stop.machine import Input, ResetFinding
from gateway.process.futures import outcome
from gateway.process.loop import Loop
from gateway.records.journal import read_verified
from gateway.records.records import Records
from gateway.records.undo import Undo, UndoFile
from gateway.registry import Context
from gateway.wire.framing import RpcError
from gateway.wire.parameter import TrialInfo
from tests.support.waiting import WAIT_S
from tests.unit.gateway.harness import ROBOT, Bench, FakeNode, config

LONG_S = 100.0  # a trial that does not end by itself in a test
STEP_LENGTH, CYCLE_TIME, TOE_HEIGHT = "gait.step_length", "gait.cycle_time", "gait.toe_height"
MAX_TORQUE = "left_knee.max_torque"
STEP: Address = ("main", 16, 0x2001, 0)
CYCLE: Address = ("main", 16, 0x2002, 0)
TOE: Address = ("main", 16, 0x2003, 0)
TORQUE: Address = ("main", 2, 0x6072, 0)


class _Asking:
    """A session whose requests come in at the moment in which they are handled."""

    who = "tester"
    address, closed = "here", False

    def on_close(self, farewell: Callable[[], None], whose: object = None) -> None:
        """It never ends."""

    @property
    def asked_ns(self) -> int:
        return time.monotonic_ns()


class Tuned:
    """Between `start` and `close`; methods are called in the loop, and wait for what comes of them."""

    def __init__(self, settings: RobotConfig, locked: tuple[Address, ...]) -> None:
        self.authority = Authority(targets=(), locked=locked)
        self.records = Records(settings.records)
        self.loop = Loop()
        self.session: Any = _Asking()
        self._thread = threading.Thread(target=self.loop.run, name="loop")
        self.component = ComponentModule(Context(settings, self.loop, {}, lambda _on: None))
        self.component.start()
        self.tuning = Tuning(settings, self.component, self.loop, self.records, self.authority, lambda: None)
        self._settings = settings

    def start(self, before: "Callable[[Tuned], object]") -> None:
        left = self.tuning.load()
        before(self)
        self._thread.start()
        self.do(lambda: self.tuning.resume(left))

    def close(self) -> None:
        self.tuning.close()
        self.records.close()
        self.loop.stop()
        self._thread.join(WAIT_S)
        self.loop.close()

    def ask(self, work: Callable[[], Any]) -> "Future[Any]":
        """Do it in the loop; the future has what comes of it in the end."""
        found: Future[Any] = Future()

        def settle(ended: "Future[Any]") -> None:
            result = outcome(ended)
            (found.set_exception if isinstance(result, Exception) else found.set_result)(result)

        def call() -> None:
            try:
                result = work()
            except Exception as error:  # noqa: BLE001 - it belongs to the test
                found.set_exception(error)
            else:
                result.add_done_callback(settle) if isinstance(result, Future) else found.set_result(result)

        self.loop.post(call)
        return found

    def do(self, work: Callable[[], Any]) -> Any:
        return self.ask(work).result(WAIT_S)

    def refused(self, work: Callable[[], Any]) -> RpcError:
        with pytest.raises(RpcError) as caught:
            self.do(work)
        return caught.value

    def writing(self, changes: dict[str, float], trial_s: float | None = None) -> Callable[[], Any]:
        return lambda: self.tuning.write(changes, self.session, trial_s)

    def write(self, changes: dict[str, float], trial_s: float | None = None) -> int:
        """Write, on trial where a time is given; returns the write's number."""
        number: int = self.do(self.writing(changes, trial_s)).write
        return number

    def revert(self, write: int) -> dict[str, str]:
        outcome_: dict[str, str] = self.do(lambda: self.tuning.trials.revert(write)).outcome
        return outcome_

    def trials(self) -> list[TrialInfo]:
        found: list[TrialInfo] = self.do(self.tuning.trials.infos)
        return found

    def undos(self) -> list[Undo]:
        """As the next gateway would find them."""
        return UndoFile(self.records.folder.undo).load()[0]

    def told(self, *what: str) -> list[dict[str, Any]]:
        """The journal's entries of these kinds."""
        self.records.journal.tail(1).result(WAIT_S)
        return [one for one in read_verified(self.records.folder.journal) if one["what"] in what]

    # The stop

    def stop(self) -> None:
        """As it is told first of all, before anything is asked to stop."""
        self.authority.feed(Input.STOP, lambda _step: None)

    def claim(self) -> None:
        self.tuning.claim().result(WAIT_S)
        self.do(lambda: None)

    def reset(self) -> None:
        """There is nothing that would have to rest."""
        for what in (Input.RESET, Input.PROVED, Input.REMOVED):
            findings: dict[str, ResetFinding] = {}
            number = self.authority.state.number
            self.authority.feed(what, lambda _step: None, number=number, findings=findings)
        assert not self.authority.held


@contextlib.contextmanager
def tuned(
    folder: Path,
    *locked: Address,
    text: str = ROBOT,
    before: Callable[[Tuned], object] = lambda _tuned: None,
) -> Iterator[Tuned]:
    """Running, and ended as a gateway ends; `before` is done when it has found what the last one left."""
    running = Tuned(config(folder, text), locked)
    running.start(before)
    try:
        yield running
    finally:
        running.close()


def held(bench: Bench, address: Address) -> int:
    """What a device holds, as a number."""
    node = {16: bench.gait, 2: bench.left, 5: bench.right}[address[1]].node
    return int.from_bytes(node.objects[address[2:]], "little")


def drives(bench: Bench, statusword: int) -> None:
    for drive in (bench.left, bench.right):
        drive.set_state(statusword)


def u16(value: int) -> bytes:
    return value.to_bytes(2, "little")


def somebody_writes(bench: Bench, address: Address, value: int) -> None:
    bench.gait.node.objects[address[2:]] = u16(value)


class Gate:
    """Holds up the first download of an object in the writer's thread."""

    def __init__(self, node: FakeNode, index: int) -> None:
        self.reached, self._open = threading.Event(), threading.Event()
        self._index = index
        node.before_download = self._wait

    def _wait(self, index: int, _data: bytes) -> None:
        if index == self._index and not self.reached.is_set():
            self.reached.set()
            assert self._open.wait(WAIT_S)

    def wait(self) -> None:
        assert self.reached.wait(WAIT_S)

    def open(self) -> None:
        self._open.set()


def silent_but_for(reads: int) -> Callable[[int], None]:
    """A device that answers so many reads more."""
    left = [None] * reads

    def before_upload(_index: int) -> None:
        if not left:
            raise DeviceTimeout("no answer")
        left.pop()

    return before_upload
