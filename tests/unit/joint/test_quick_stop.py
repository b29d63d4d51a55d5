"""Quick stop: one controlword, confirmed by what the drive itself says, in every state of CiA 402."""

import itertools
import time
from types import SimpleNamespace

import pytest

from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.sender import BusFull, StillLeaving
from drivers.errors import Unavailable
from drivers.joint.axis import Axis
from drivers.joint.commands import CONTROLWORD, STATUSWORD, STOPPED_STATES, Controlword
from drivers.joint.power import LIMP_STATES
from drivers.joint.quick_stop import StopOutcome, Stopping
from tests.unit.bus.direct import Direct

TIMEOUT_S = 0.3


def quick_stop(channel: SdoChannel, axis_offset: int, timeout_s: float) -> StopOutcome:
    stopping = Stopping(Controlword.QUICK_STOP, STOPPED_STATES, timeout_s, asked=False)
    axis = Axis(channel, axis_offset)
    channel.resume(urgent=True)
    while (outcome := stopping.turn(axis)) is None:
        pass
    return outcome


# State machine of a drive (CiA 402-2): what controlword 0002h makes of each state, by statusword.
AFTER_QUICK_STOP = {
    0x0000: 0x0000,  # not ready to switch on
    0x0040: 0x0040,  # switch on disabled
    0x0021: 0x0040,  # ready to switch on → switch on disabled (7)
    0x0023: 0x0040,  # switched on → switch on disabled (10)
    0x0027: 0x0007,  # operation enabled → quick stop active (11)
    0x0007: 0x0007,
    0x000F: 0x000F,  # fault reaction active
    0x0008: 0x0008,
}


class Drive:
    """Answers 6040h and 6041h of one axis, as its state machine does; it has no other object."""

    def __init__(self, statusword: int, axis_offset: int = 0) -> None:
        self.statusword = statusword
        self.axis_offset = axis_offset
        self.controlwords: list[int] = []
        self.refuses = self.mute = self.gone = False
        self.full: list[BusFull] = []  # as long as it is, the bus takes no request
        self.deaf_requests = 0
        self.master_enables = False  # another master sends 000Fh between any two of our requests
        self.channel = SdoChannel("left_knee", Direct(self.hear), timeout_s=0.02)

    def hear(self, request: bytes) -> None:
        if self.full and request[0] != 0x80:
            raise self.full.pop()
        if self.gone:
            raise Unavailable("bus main is not open")
        index = int.from_bytes(request[1:3], "little") - self.axis_offset
        if self.mute or request[0] == 0x80:
            return
        if self.deaf_requests:
            self.deaf_requests -= 1
            return
        if index == CONTROLWORD and not self.refuses:
            self.controlwords.append(int.from_bytes(request[4:6], "little"))
            self.statusword = AFTER_QUICK_STOP[self.statusword]
        self.channel.on_response(0, self.reply(index, request))
        if self.master_enables:
            self.statusword = 0x0027

    def reply(self, index: int, request: bytes) -> bytes:
        if index == CONTROLWORD and self.refuses:
            return b"\x80" + request[1:4] + (0x08000022).to_bytes(4, "little")
        if index == CONTROLWORD:
            return b"\x60" + request[1:4] + bytes(4)
        if index != STATUSWORD:
            return b"\x80" + request[1:4] + (0x06020000).to_bytes(4, "little")
        return b"\x4b" + request[1:4] + self.statusword.to_bytes(2, "little") + bytes(2)


@pytest.mark.parametrize(
    ("statusword", "outcome"),
    [
        (0x0027, StopOutcome.CONFIRMED),
        (0x0023, StopOutcome.CONFIRMED),
        (0x0021, StopOutcome.CONFIRMED),
        (0x0040, StopOutcome.CONFIRMED),
        (0x0007, StopOutcome.CONFIRMED),
        (0x0008, StopOutcome.CONFIRMED),
        (0x000F, StopOutcome.UNCONFIRMED),  # still braking by its own fault reaction
        (0x0000, StopOutcome.UNCONFIRMED),
    ],
)
def test_a_stop_is_confirmed_by_the_statusword_alone(statusword: int, outcome: StopOutcome) -> None:
    drive = Drive(statusword)
    assert quick_stop(drive.channel, 0, TIMEOUT_S) is outcome


@pytest.mark.parametrize("statusword", AFTER_QUICK_STOP)
def test_nothing_that_is_sent_can_enable_a_drive_or_reset_a_fault(statusword: int) -> None:
    drive = Drive(statusword)
    quick_stop(drive.channel, 0, TIMEOUT_S)
    assert set(drive.controlwords) == {0x0002}


def test_a_drive_that_does_not_answer_is_unreachable() -> None:
    drive = Drive(0x0027)
    drive.mute = True
    assert quick_stop(drive.channel, 0, TIMEOUT_S) is StopOutcome.UNREACHABLE


def test_a_bus_that_is_gone_makes_it_unreachable_at_once() -> None:
    drive = Drive(0x0027)
    drive.gone = True
    assert quick_stop(drive.channel, 0, 1000.0) is StopOutcome.UNREACHABLE


@pytest.mark.parametrize("full", [BusFull, StillLeaving])
def test_a_bus_that_takes_nothing_for_a_while_ends_no_stop(full: type[BusFull]) -> None:
    drive = Drive(0x0027)
    drive.full = [full("interface can9 does not send")] * 6
    assert quick_stop(drive.channel, 0, 5.0) is StopOutcome.CONFIRMED
    assert not drive.full


def test_a_drive_that_refuses_is_unconfirmed() -> None:
    drive = Drive(0x0027)
    drive.refuses = True
    assert quick_stop(drive.channel, 0, TIMEOUT_S) is StopOutcome.UNCONFIRMED


def test_a_drive_that_refuses_and_stands_anyway_is_confirmed() -> None:
    drive = Drive(0x0040)
    drive.refuses = True
    assert quick_stop(drive.channel, 0, TIMEOUT_S) is StopOutcome.CONFIRMED


def test_a_lost_request_is_asked_again() -> None:
    drive = Drive(0x0027)
    drive.deaf_requests = 2
    assert quick_stop(drive.channel, 0, 5.0) is StopOutcome.CONFIRMED
    assert drive.controlwords == [0x0002]


def test_a_drive_that_another_master_enables_again_is_not_confirmed() -> None:
    drive = Drive(0x0027)
    drive.master_enables = True
    assert quick_stop(drive.channel, 0, TIMEOUT_S) is StopOutcome.UNCONFIRMED
    assert len(drive.controlwords) > 1


def test_the_second_axis_of_a_drive_is_stopped_by_its_own_objects() -> None:
    drive = Drive(0x0027, axis_offset=0x800)
    assert quick_stop(drive.channel, 0x800, TIMEOUT_S) is StopOutcome.CONFIRMED


def test_its_time_begins_when_the_worker_first_turns_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not before: another axis of the drive may have the channel."""
    now = 0.0

    def sleep(seconds: float) -> None:
        nonlocal now
        now += seconds

    clock = SimpleNamespace(monotonic=lambda: now, monotonic_ns=lambda: round(now * 1e9), sleep=sleep)
    monkeypatch.setattr("drivers.joint.quick_stop.time", clock)
    drive = Drive(0x0027)
    stopping = Stopping(Controlword.QUICK_STOP, STOPPED_STATES, TIMEOUT_S, asked=False)
    sleep(2 * TIMEOUT_S)
    while (outcome := stopping.turn(Axis(drive.channel, 0))) is None:
        pass
    assert outcome is StopOutcome.CONFIRMED


def test_a_turn_is_one_request_or_a_moments_pause() -> None:
    drive = Drive(0x0000)  # never says that it stops
    stopping = Stopping(Controlword.QUICK_STOP, STOPPED_STATES, TIMEOUT_S, asked=False)
    transfers = []
    while stopping.turn(Axis(drive.channel, 0)) is None:
        transfers.append(drive.channel.counters.transfers)
    assert {after - before for before, after in itertools.pairwise(transfers)} == {0, 1}


def test_a_confirmed_stop_knows_when_the_reads_were_begun_that_it_rests_on() -> None:
    drive = Drive(0x0027)
    stopping = Stopping(Controlword.QUICK_STOP, STOPPED_STATES, TIMEOUT_S, asked=False)
    asked_ns = 0
    while stopping.turn(Axis(drive.channel, 0)) is None:
        asked_ns = asked_ns or time.monotonic_ns()  # behind the controlword, before the first read
    assert asked_ns <= stopping.read_ns <= time.monotonic_ns()


@pytest.mark.parametrize("statusword", AFTER_QUICK_STOP)
def test_only_an_axis_without_current_is_limp(statusword: int) -> None:
    """One that still brakes after a fault has current."""
    drive = Drive(statusword)
    drive.refuses = True  # it stays where it is
    stopping = Stopping(Controlword.DISABLE_VOLTAGE, LIMP_STATES, TIMEOUT_S, asked=False)
    drive.channel.resume(urgent=True)
    while (outcome := stopping.turn(Axis(drive.channel, 0))) is None:
        pass
    limp = statusword in (0x0040, 0x0008)
    assert outcome is (StopOutcome.CONFIRMED if limp else StopOutcome.UNCONFIRMED)
