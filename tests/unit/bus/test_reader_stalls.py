"""A computer that stood still takes what waited for what it is: no device was silent, no joint has jumped."""

import threading
from collections.abc import Callable

import can
import pytest

import eds
from drivers.bus.bus import CanBus
from drivers.bus.frame_losses import FrameLosses
from drivers.bus.interfaces.socketcand import server_ns, waited_stamps
from drivers.bus.liveness import NodeLife
from drivers.joint.supervision import JointWatch
from drivers.latest import Latest
from drivers.reader_stalls import MANY, SHOWN_S, STOOD_NS, ReaderStalls
from drivers.samples import Channel
from tests.support.waiting import until

MS = 1_000_000
TICK_MS = 50


class Reader:
    """The thread that reads a bus, as a test tells it."""

    def __init__(self) -> None:
        self.standstill = ReaderStalls()
        self.now_ns = 1_000 * MS
        self.standstill.passed(self.now_ns)

    def stands(self, milliseconds: int) -> None:
        self.now_ns += milliseconds * MS

    def runs(self, milliseconds: int = TICK_MS, tick: Callable[[int], None] = lambda _now_ns: None) -> None:
        for _ in range(milliseconds // TICK_MS):
            self.now_ns += TICK_MS * MS
            self.standstill.passed(self.now_ns)
            tick(self.now_ns)

    @property
    def said(self) -> str | None:
        finding = self.standstill.finding
        return None if finding is None else finding.words


def test_what_waited_while_we_stood_still_was_not_missing() -> None:
    reader = Reader()
    life = NodeLife(0.25, reader.standstill)
    life.on_heartbeat(reader.now_ns, b"\x05")
    reader.stands(800)
    assert life.lost(reader.now_ns), "as long as nobody reads, nobody knows that it lives"
    assert (life.problem(reader.now_ns) or "").startswith("this computer has stood still for 0.8 s: see what")
    reader.runs()
    assert not life.lost(reader.now_ns)
    reader.runs(200)
    assert not life.lost(reader.now_ns)
    reader.runs(1200)
    assert life.lost(reader.now_ns), "it has stayed away while we were there"
    assert "its heartbeat has been missing for 2.2 s" in (life.problem(reader.now_ns) or "")


def test_a_standstill_is_not_told_for_ever_where_every_look_is_a_little_late() -> None:
    reader = Reader()
    reader.runs(500)
    reader.stands(700)
    reader.runs()
    for _ in range(round(SHOWN_S * 1000 / 65) + 2):
        reader.stands(65)
        reader.standstill.passed(reader.now_ns)
    assert reader.said is None


def test_who_is_gone_is_missed_though_we_stand_still_again_and_again() -> None:
    reader = Reader()
    life = NodeLife(0.25, reader.standstill)
    life.on_heartbeat(reader.now_ns, b"\x05")
    for _ in range(10):
        reader.stands(110)
        reader.runs()
    assert life.lost(reader.now_ns)


def test_who_was_silent_before_is_not_explained_by_standing_still() -> None:
    reader = Reader()
    life = NodeLife(0.25, reader.standstill)
    life.on_heartbeat(reader.now_ns, b"\x05")
    reader.runs(1000)
    for _ in range(5):
        reader.stands(300)
        assert "its heartbeat has been missing" in (life.problem(reader.now_ns) or "")
        reader.runs()
        assert "its heartbeat has been missing" in (life.problem(reader.now_ns) or "")


def test_a_period_is_not_learned_from_heartbeats_that_waited() -> None:
    reader = Reader()
    life = NodeLife(None, reader.standstill)

    def beat(now_ns: int) -> None:
        life.on_heartbeat(now_ns, b"\x05")

    life.expect_every(0.05)
    reader.runs(500, beat)
    reader.stands(600)
    for _ in range(12):  # all that waited, one after the other
        reader.now_ns += MS
        beat(reader.now_ns)
        reader.standstill.passed(reader.now_ns)
    assert life.timeout_s == pytest.approx(0.125)
    reader.stands(70)
    reader.standstill.passed(reader.now_ns)
    assert not life.lost(reader.now_ns)


def test_between_two_looks_nobody_is_missed() -> None:
    reader = Reader()
    life = NodeLife(0.125, reader.standstill)
    reader.runs()
    life.on_heartbeat(reader.now_ns - 40 * MS, b"\x05")
    reader.stands(99)
    assert not life.lost(reader.now_ns)


def test_a_standstill_is_told_once_with_how_often_and_how_long() -> None:
    reader = Reader()
    reader.runs(500)
    assert reader.said is None
    reader.stands(700)
    reader.runs()
    assert reader.said == "this computer stood still for 0.8 s"
    reader.runs(500)
    reader.stands(300)
    reader.runs()
    assert reader.said == "this computer stood still 2 times, for up to 0.8 s"
    reader.runs(round(SHOWN_S * 1000) + 100)
    assert reader.said is None
    reader.stands(400)
    reader.runs()
    assert reader.said == "this computer stood still for 0.5 s", "what was long ago is over"


def test_short_ones_are_told_where_they_are_many() -> None:
    reader = Reader()
    for _ in range(MANY - 1):
        reader.stands(STOOD_NS // MS)
        reader.runs(1000)
        assert reader.said is None
    reader.stands(STOOD_NS // MS)
    reader.runs()
    assert (reader.said or "").startswith(f"this computer stood still {MANY} times")


class Joint:
    """A joint that turns at a steady speed, watched on a reader's bus."""

    def __init__(self, reader: Reader, speed: float) -> None:
        quantities = ("position", "velocity", "torque", "following_error", "modes_display", "state")
        self.latest = Latest("knee", [Channel(f"knee.{one}", "knee", one, "") for one in quantities], 1.0)
        description = eds.load(eds.locate("joint_drive.eds", None), 2)
        self.watch = JointWatch(self.latest, reader.standstill, description)
        self.offset, self._speed = 0.0, speed

    def late(self, late_ms: int) -> Callable[[int], None]:
        """A tick by which its newest frame has come, that was so long on its way."""

        def tick(now_ns: int) -> None:
            position = self.offset + self._speed * (now_ns - late_ms * MS) / 1e9
            self.latest.update(now_ns, (0, 1), (position, self._speed))
            self.watch.tick(now_ns)

        return tick

    @property
    def said(self) -> str:
        return "; ".join(one.words for one in self.watch.check.findings)


def test_a_joint_whose_frames_have_waited_has_not_jumped() -> None:
    reader = Reader()
    joint = Joint(reader, speed=4.0)
    reader.runs(500, joint.late(0))
    reader.stands(600)
    reader.runs(50, joint.late(500))  # the first part of what waited
    reader.runs(50, joint.late(0))  # the rest
    reader.runs(1000, joint.late(0))
    assert joint.said == ""
    joint.offset = 0.8
    reader.runs(50, joint.late(0))
    assert "its position jumped by" in joint.said, "one that has is found as ever"
    reader.stands(600)
    reader.runs(1000, joint.late(0))
    assert "its position jumped by" in joint.said, "and is not forgotten over a standstill"


SHORT_MS = 20  # beside a tick: 70 ms without a look, which is no standstill yet


@pytest.mark.parametrize(("moved", "said"), [(0.3, False), (0.7, False), (0.8, True), (-0.8, True)])
def test_across_a_short_gap_only_what_no_joint_can_go_is_a_jump(moved: float, said: bool) -> None:
    reader = Reader()
    joint = Joint(reader, speed=0.0)
    reader.runs(500, joint.late(0))
    reader.stands(SHORT_MS)
    joint.offset = moved
    reader.runs(1000, joint.late(0))
    assert reader.standstill.times == 0
    assert ("its position jumped by" in joint.said) is said
    assert reader.said == (None if said else "this computer stood still for 0.07 s")
    reader.runs(round(SHOWN_S * 1000) + 100, joint.late(0))
    assert reader.said is None


def test_a_jump_before_or_after_a_short_gap_is_found_as_ever() -> None:
    reader = Reader()
    joint = Joint(reader, speed=0.0)
    for way in (1, -1):
        reader.stands(SHORT_MS)
        reader.runs(200, joint.late(0))
        joint.offset += 0.3 * way
        reader.runs(50, joint.late(0))
        assert "its position jumped by 17.2°" in joint.said
        assert reader.said is None, "no gap explains it"
        joint.watch.restart()


@pytest.mark.parametrize("silent_ms", [100, 300, 900])
def test_who_comes_back_elsewhere_after_a_silence_of_its_own_has_jumped(silent_ms: int) -> None:
    """PDOs that were missing for a moment hide no encoder that lost its turns."""
    for turns, said in ((3, True), (0.1, False)):
        reader = Reader()
        joint = Joint(reader, speed=0.0)
        reader.runs(500, joint.late(0))
        reader.runs(silent_ms)
        joint.offset = 6.2832 * turns
        reader.runs(1000, joint.late(0))
        assert ("its position jumped by" in joint.said) is said
        assert reader.said is None


def test_a_jump_while_it_stood_still_is_no_secret() -> None:
    reader = Reader()
    joint = Joint(reader, speed=0.0)
    reader.runs(500, joint.late(0))
    reader.stands(100)
    joint.offset = 6.3  # a turn of its encoder
    reader.runs(1000, joint.late(0))
    assert "its position jumped by" in joint.said


@pytest.mark.parametrize(("every", "told"), [(1, False), (8, True)])
def test_pdos_that_did_not_come_while_nobody_read_are_not_missing(every: int, told: bool) -> None:
    """A PDO each 10 ms, none in 70 ms of each half second; `every` so many one is lost besides."""
    reader, arrivals = Reader(), FrameLosses()
    for _ in range(20):
        reader.stands(SHORT_MS)
        reader.now_ns += TICK_MS * MS
        reader.standstill.passed(reader.now_ns)
        for number in range(43):
            if every == 1 or number % every:
                arrivals.stamps.append(reader.now_ns)
            gap = reader.standstill.gap
            if gap is not None and not reader.standstill.is_even(reader.now_ns):
                arrivals.excuse(*gap)
            arrivals.look(reader.now_ns)
            reader.now_ns += 10 * MS
            reader.standstill.passed(reader.now_ns)
    assert (arrivals.finding is not None) is told


@pytest.mark.parametrize(("every", "told"), [(10, True), (1000, False)])
def test_pdos_with_stamps_of_their_own_are_missed_though_every_look_is_late(every: int, told: bool) -> None:
    """Each look takes 65 ms, for good; of PDOs each 10 ms, which the kernel stamps, every tenth is lost."""
    reader, arrivals, sent_ns = Reader(), FrameLosses(), 0
    for _ in range(100):
        reader.stands(65)
        while sent_ns + 1_000 * MS <= reader.now_ns:
            if sent_ns // (10 * MS) % every:
                arrivals.stamps.append(sent_ns + 1_000 * MS)
            sent_ns += 10 * MS
        reader.standstill.passed(reader.now_ns)
        assert reader.standstill.gap is not None
        arrivals.excuse(*reader.standstill.gap)
        arrivals.look(reader.now_ns)
    assert (arrivals.finding is not None) is told


def test_the_thread_of_a_bus_tells_when_it_did_not_run(bus: CanBus, channel: str) -> None:
    def starved(_stamp_ns: int, _data: bytes) -> None:
        threading.Event().wait(1.5 * STOOD_NS / 1e9)

    bus.subscribe(0x123, starved)
    bus.start()
    until(lambda: bus.is_open)
    with can.Bus(channel, "virtual") as other:
        other.send(can.Message(arbitration_id=0x123, is_extended_id=False))
        until(lambda: bus.standstill.times > 0)
    bus.stop()


def frames(*at_s: float) -> list[str]:
    return [f" frame 181 {seconds:.6f} 0102 " for seconds in at_s]


def test_frames_that_waited_are_as_old_as_the_servers_stamps_say() -> None:
    stamps = waited_stamps(frames(5.0, 5.1, 5.299, 5.3), 1_000 * MS, 1_400 * MS)
    assert stamps == [1_100 * MS, 1_200 * MS, 1_399 * MS, 1_400 * MS]


@pytest.mark.parametrize(
    ("at_s", "stamps_ms"),
    [
        (
            (1.0, 5.2, 5.3),
            (1_000, 1_300, 1_400),
        ),  # the server's clock stepped ahead: none came before all was read
        ((9.0, 5.2, 5.3), (1_400, 1_400, 1_400)),  # and back: never later than now, and in order
        ((5.3, 5.2, 5.3), (1_400, 1_400, 1_400)),
        ((0.0, 0.0, 0.0), (1_400, 1_400, 1_400)),  # a server without stamps
    ],
)
def test_a_servers_clock_that_steps_does_no_harm(at_s: tuple[float, ...], stamps_ms: tuple[int, ...]) -> None:
    assert waited_stamps(frames(*at_s), 1_000 * MS, 1_400 * MS) == [one * MS for one in stamps_ms]


@pytest.mark.parametrize("message", ["", " frame 181", " frame 181 x 01 ", " frame 181 inf 01 ", " ok "])
def test_a_message_without_a_stamp_has_none(message: str) -> None:
    assert server_ns(message) is None
    assert waited_stamps([message], 1_000 * MS, 1_400 * MS) == [1_000 * MS]
