"""A homing ends with the drive disabled, as it says itself, however it ends; else that is an error."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import can
import pytest
from msgspec.structs import replace

import eds
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable
from drivers.joint import power as drive_power
from drivers.joint.homing import METHODS, HomingProgress, Setup, offered, progress
from drivers.joint.settings import JointSettings
from gateway.commission import homing_run, power, powered_run
from gateway.commission.bench import CanBench
from gateway.commission.homing_run import HomingLimits, HomingRun
from gateway.commission.powered_run import PoweredRunResult
from tests.support.waiting import WAIT_S, until
from tests.unit.commission.homing_drive import ATTAINED, COMPLETE, FAILED, NOT_STARTED, UNDER_WAY, HomingDrive
from tests.unit.joint.standard import S

NODE = 5
SETTINGS = JointSettings(
    bus="main",
    node_id=NODE,
    eds="joint_drive.eds",
    counts_per_revolution=4096,
    gear_ratio=100,
    stop_timeout_s=3.0,
    sdo_timeout_s=2.0,
)
IMPATIENT = replace(SETTINGS, stop_timeout_s=0.3, sdo_timeout_s=0.5)  # of drives that never do what is asked
WAY = HomingLimits(Setup(17, 5000, 1000, 20_000), -1000, 100_000, fastest=1e9, lag=5000, time_s=20.0)
ENABLING = {0x000F, 0x001F}


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(power, "LISTEN_S", 0.02)
    monkeypatch.setattr(drive_power, "RESET_S", 0.3)
    monkeypatch.setattr(homing_run, "SETTLED_S", 0.02)
    monkeypatch.setattr(homing_run, "BEGIN_S", 0.2)
    monkeypatch.setattr(powered_run, "KEEP_S", WAIT_S)


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.nodeid)


@contextmanager
def begun(channel: str, plan: HomingLimits = WAY, settings: JointSettings = SETTINGS) -> Iterator[HomingRun]:
    """A run under power; whoever is in the block keeps it."""
    bench = CanBench("main", CanSettings(interface="virtual", channel=channel))
    with bench.power(settings, eds.load(eds.locate("joint_drive.eds", None), NODE)) as found:
        run = HomingRun(found, plan)
        run.start()
        try:
            yield run
        finally:
            run.end()


def finished(run: HomingRun) -> PoweredRunResult:
    def over() -> bool:
        run.keep()
        return run.done

    until(over)
    return run.end()


def until_it_homes(run: HomingRun, drive: HomingDrive) -> None:
    def homes() -> bool:
        run.keep()
        assert not run.done, run.end()
        return drive.words[-1:] == [0x1F]

    until(homes)


def test_what_moves_nothing_is_enabled_homed_and_disabled_again(channel: str) -> None:
    with HomingDrive(channel, NODE) as drive:
        with begun(channel, HomingLimits(Setup(37), -100, 100, 1e9, 5000, 20.0)) as run:
            outcome = finished(run)
        assert (outcome.problem, outcome.off, outcome.before, outcome.after) == (None, True, 0, 0)
        assert drive.states[:4] == [
            S.SWITCH_ON_DISABLED,
            S.READY_TO_SWITCH_ON,
            S.SWITCHED_ON,
            S.OPERATION_ENABLED,
        ]
        assert (drive.state, drive.mode) == (S.SWITCH_ON_DISABLED, 8)
        assert drive.words[:5] == [0x06, 0x07, 0x0F, 0x1F, 0x02]
        assert not ENABLING & set(drive.words[4:])
        assert drive.objects[0x1016, 1] == bytes(4), "it watches our heartbeat no more"


def test_a_homing_that_moves_writes_what_was_told_before_it_is_enabled(channel: str) -> None:
    with HomingDrive(channel, NODE, homing=COMPLETE) as drive:  # as after a homing before
        with begun(channel) as run:
            outcome = finished(run)
        assert (outcome.problem, outcome.off, outcome.after) == (None, True, 0)
        written = [index for index, _, _ in drive.writes]
        assert written.index(0x6060) < written.index(0x6040)
        assert drive.objects[0x6099, 1] == (5000).to_bytes(4, "little")


def errs(**changes: object) -> Callable[[HomingDrive], None]:
    """While it homes, something of the drive changes."""

    def look(drive: HomingDrive) -> None:
        if drive.homing == UNDER_WAY and drive.words[-1:] == [0x1F]:
            for name, value in changes.items():
                setattr(drive, name, value)

    return look


def another_master(drive: HomingDrive) -> None:
    if drive.homing == UNDER_WAY and drive.words[-1:] == [0x1F]:
        drive.send(0x080, b"")


def behind(drive: HomingDrive) -> None:
    drive.objects[0x60F4, 0] = (-9000).to_bytes(4, "little", signed=True)


@pytest.mark.parametrize(
    ("look", "more", "words"),
    [
        (errs(homing=FAILED), {}, "bit 13: failed"),
        (errs(homing=FAILED | ATTAINED), {}, "bit 13: reserved"),
        (errs(homing=NOT_STARTED), {}, "interrupted it"),
        (errs(state=S.FAULT), {}, "left operation by itself: fault, error code 0000h"),
        (errs(state=S.SWITCH_ON_DISABLED), {}, "left operation by itself: switch on disabled"),
        (errs(step=1_000_000), {}, "left the way that was told"),
        (behind, {}, "9000 counts behind"),
        (another_master, {}, "somebody else is on the bus, who sends SYNC"),
        (errs(), {"begins": False}, "does not begin"),
    ],
)
def test_whatever_goes_wrong_stops_and_disables_it(
    channel: str, look: Callable[[HomingDrive], None], more: dict[str, bool], words: str
) -> None:
    with HomingDrive(channel, NODE, home=None, on_look=look, **more) as drive:  # type: ignore[arg-type]
        with begun(channel) as run:
            outcome = finished(run)
        assert words in str(outcome.problem)
        assert outcome.off
        assert drive.state in (S.SWITCH_ON_DISABLED, S.FAULT)
        assert drive.words[-1] not in ENABLING
        assert 0x02 in drive.words
        assert not ENABLING & set(drive.words[drive.words.index(0x02) :])


def test_units_that_were_misread_show_in_the_speed(channel: str) -> None:
    plan = HomingLimits(WAY.setup, -1000, 2**30, fastest=10.0, lag=5000, time_s=20.0)
    with HomingDrive(channel, NODE, home=None, step=1000), begun(channel, plan) as run:
        outcome = finished(run)
    assert "counts/s, not 10 at most" in str(outcome.problem)
    assert outcome.off


@pytest.mark.parametrize("says", [ATTAINED, NOT_STARTED])
def test_a_joint_that_goes_on_whatever_the_drive_says_is_stopped(channel: str, says: int) -> None:
    def runs_away(drive: HomingDrive) -> None:
        if drive.words[-1:] == [0x1F]:
            drive.homing = says
            position = int.from_bytes(drive.objects[0x6064, 0], "little", signed=True)
            drive.objects[0x6064, 0] = (position + 9000).to_bytes(4, "little", signed=True)

    plan = HomingLimits(WAY.setup, -1000, 30_000, fastest=1000.0, lag=5000, time_s=20.0)
    with HomingDrive(channel, NODE, home=None, step=0, on_look=runs_away), begun(channel, plan) as run:
        outcome = finished(run)
    assert any(words in str(outcome.problem) for words in ("counts/s, not 1000", "left the way"))
    assert outcome.off


def test_home_is_where_it_is_after_the_drive_has_said_that_it_was_found(channel: str) -> None:
    looks: list[int] = []

    def finds_home(drive: HomingDrive) -> None:
        """Between the answers of its position and of its statusword."""
        looks.append(drive.words[-1:] == [0x1F])
        if sum(looks) == 10:
            drive.homing, drive.objects[0x6064, 0] = COMPLETE, bytes(4)

    objects = {(0x6064, 0): (700).to_bytes(4, "little")}
    with HomingDrive(channel, NODE, home=None, step=0, on_look=finds_home) as drive:
        drive.objects |= objects
        with begun(channel) as run:
            outcome = finished(run)
    assert (outcome.problem, outcome.before, outcome.after) == (None, 700, 0)


def test_the_mode_that_was_asked_for_is_given_back_whatever_6061h_shows_without_power(channel: str) -> None:
    class Shy(HomingDrive):
        def _initiate_upload(self, index: int, subindex: int) -> bytes:
            answer = super()._initiate_upload(index, subindex)
            off = self.state is S.SWITCH_ON_DISABLED and index == 0x6061
            return answer[:4] + bytes(4) if off else answer

    with (
        Shy(channel, NODE) as drive,
        begun(channel, HomingLimits(Setup(37), -100, 100, 1e9, 5000, 20.0)) as run,
    ):
        assert finished(run).problem is None
        assert drive.mode == 8


def test_home_that_is_not_found_in_time_ends_it(channel: str) -> None:
    plan = HomingLimits(WAY.setup, -1000, 2**30, fastest=1e9, lag=5000, time_s=0.1)
    with HomingDrive(channel, NODE, home=None, step=0), begun(channel, plan) as run:
        assert "not found within" in str(finished(run).problem)


def test_stop_is_followed_at_once_and_the_first_reason_is_told(channel: str) -> None:
    with HomingDrive(channel, NODE, home=None, step=0) as drive, begun(channel) as run:
        until_it_homes(run, drive)
        run.stop("STOP was pressed")
        run.stop("later")
        outcome = finished(run)
        assert (outcome.problem, outcome.off) == ("STOP was pressed", True)
        assert drive.state is S.SWITCH_ON_DISABLED


def test_who_does_not_say_that_stop_is_in_reach_any_more_has_let_go(
    channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(powered_run, "KEEP_S", 0.5)
    with HomingDrive(channel, NODE, home=None, step=0) as drive, begun(channel) as run:
        until(lambda: run.done)
        assert run.end().problem == "nobody has STOP in reach any more"
        assert drive.state is S.SWITCH_ON_DISABLED


def test_a_gap_in_which_nobody_had_stop_in_reach_is_not_made_up_for(
    channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with HomingDrive(channel, NODE, home=None, step=0) as drive, begun(channel) as run:
        until_it_homes(run, drive)
        with monkeypatch.context() as context:
            context.setattr(powered_run, "KEEP_S", 0.0)  # as after the whole program was suspended
            run.keep()
        assert finished(run).problem == "nobody has STOP in reach any more"


def test_one_that_was_not_begun_has_nothing_to_confirm(channel: str) -> None:
    bench = CanBench("main", CanSettings(interface="virtual", channel=channel))
    with HomingDrive(channel, NODE) as drive:
        with bench.power(SETTINGS, eds.load(eds.locate("joint_drive.eds", None), NODE)) as found:
            assert HomingRun(found, WAY).end().off
        assert drive.words == []


def test_a_drive_that_answers_no_more_is_not_taken_for_stopped(channel: str) -> None:
    silent = HomingDrive(channel, NODE, home=None, step=0, on_look=errs(silent=True))
    with silent, begun(channel, settings=IMPATIENT) as run:
        outcome = finished(run)
        assert not outcome.off
        assert "NOT confirmed" in outcome.text


def test_a_drive_that_follows_no_stop_is_told_as_not_disabled(channel: str) -> None:
    deaf = {0x0000, 0x0002}
    with (
        HomingDrive(channel, NODE, home=None, step=0, deaf_to_words=deaf) as drive,
        begun(channel, settings=IMPATIENT) as run,
    ):
        until_it_homes(run, drive)
        run.stop("STOP was pressed")
        outcome = finished(run)
        assert not outcome.off
        assert "operation enabled" in outcome.text
        until(lambda: (0x000, b"\x02\x05") in drive.seen)  # NMT stop was tried too


@pytest.mark.parametrize("homing", [UNDER_WAY])
def test_one_that_homes_already_is_not_begun_again(channel: str, homing: int) -> None:
    with HomingDrive(channel, NODE, home=None, step=0, homing=homing) as drive, begun(channel) as run:
        assert "homing already" in str(finished(run).problem)
        assert 0x1F not in drive.words


@pytest.mark.parametrize(("state", "words"), [(S.FAULT, "fault"), (S.OPERATION_ENABLED, "operation enabled")])
def test_only_a_drive_that_is_off_is_led_up(channel: str, state: S, words: str) -> None:
    with HomingDrive(channel, NODE, state=state) as drive, begun(channel) as run:
        assert words in str(finished(run).problem)
        assert not ENABLING & set(drive.words)


@pytest.mark.parametrize(
    ("objects", "words"),
    [
        ({(0x6007, 0): bytes(2)}, "6007h is 0, so it would keep moving"),
        ({(0x1016, 1): b"\xf4\x01\x10\x00"}, "entries of its 1016h are taken"),
    ],
)
def test_a_drive_that_would_go_on_without_us_gets_no_power(
    channel: str, monkeypatch: pytest.MonkeyPatch, objects: dict[tuple[int, int], bytes], words: str
) -> None:
    monkeypatch.setattr(power, "UP_S", 0.5)
    with HomingDrive(channel, NODE, objects=objects) as drive:
        with pytest.raises(Unavailable, match=words), begun(channel):
            pass
        assert drive.words == []


def test_where_somebody_else_speaks_nothing_gets_power(channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(power, "LISTEN_S", 0.3)
    with HomingDrive(channel, NODE) as drive, can.Bus(interface="virtual", channel=channel) as other:
        message = can.Message(arbitration_id=0x000, data=b"\x01\x00", is_extended_id=False)
        task = other.send_periodic(message, 0.02)
        with pytest.raises(Unavailable, match="who sends NMT commands"), begun(channel):
            pass
        task.stop()
        assert drive.requests == []


def test_methods_are_those_of_60e3h_else_those_of_the_files_limits() -> None:
    file = eds.load(eds.locate("joint_drive.eds", None), NODE)
    elmo = eds.load(eds.locate("elmo_gold.dcf", None), NODE)
    table = {(0x60E3, 0): 4, (0x60E3, 1): 17, (0x60E3, 2): 0xFF, (0x60E3, 3): 37, (0x60E3, 4): 35}
    assert offered(lambda *key: table.get(key), file, 0) == (37, 35, 17)
    assert offered(lambda *key: None, elmo, 0) == tuple(one for one in offered_all() if one <= 35)
    assert offered(lambda *key: {(0x6502, 0): 0x81}.get(key), file, 0) == ()


def offered_all() -> list[int]:
    return sorted(METHODS, key=lambda number: METHODS[number].moves)


def test_the_statusword_says_how_far_a_homing_is() -> None:
    said = {bits: progress(0x0227 | bits) for bits in (0, 0x400, 0x1000, 0x1400, 0x2000, 0x2400, 0x3000)}
    assert list(said.values()) == list(HomingProgress)
