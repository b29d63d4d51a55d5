"""The gait controller: brings the robot up, and stops it when somebody else does."""

import struct
from collections.abc import Callable
from itertools import pairwise

import pytest

from hil_sim.bus.can_bus import Frame
from hil_sim.controller import ControllerState
from hil_sim.drive.power_state import PowerState
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.gait.activity import Activity, Label
from hil_sim.without_bus import BareExoskeleton
from tests.unit.hil_sim.bench import Heard

USUAL = ((0x2001, 400, 2), (0x2002, 1600, 2), (0x2003, 60, 2), (0x2004, 0, 2), (0x2005, 1, 1))


class Robot:
    """A whole robot in simulated time with a listener on its bus."""

    def __init__(self, scenario: Scenario = Scenario.WALK) -> None:
        self.exo = Exoskeleton(scenario)
        self.heard: list[Heard] = []
        self.exo.bus.attach(self, self._hear)
        self.exo.power_on()

    def _hear(self, frame: Frame, _sender: object) -> None:
        self.heard.append(Heard(self.exo.clock.now_ns / 1e6, frame))

    def run(self, seconds: float) -> None:
        self.exo.clock.run_until(self.exo.clock.now_ns + round(seconds * 1e9))

    def until(self, condition: Callable[[], bool], seconds: float = 10.0) -> None:
        for _ in range(round(seconds * 100)):
            if condition():
                return
            self.run(0.01)
        raise AssertionError("did not happen")

    def download(self, node: int, index: int, value: int, size: int, subindex: int = 0) -> str:
        """`ok` or the abort code; the caller is one more participant of the bus."""
        before = len(self.heard)
        data = (value & (1 << 8 * size) - 1).to_bytes(4, "little")
        head = bytes([0x23 | (4 - size) << 2, index & 0xFF, index >> 8, subindex])
        self.exo.bus.send(Frame(0x600 + node, head + data), "client")
        self.run(0.005)
        answer = next(heard.data for heard in self.heard[before:] if heard.cob_id == 0x580 + node)
        return "ok" if answer[0] == 0x60 else f"{int.from_bytes(answer[4:], 'little'):08X}"

    def heard_last(self, cob_id: int) -> bytes:
        return next(heard.data for heard in reversed(self.heard) if heard.cob_id == cob_id)

    def states(self) -> set[PowerState]:
        return {drive.power_state for drive in self.exo.drives.values()}


@pytest.fixture(scope="module")
def shared() -> Robot:
    """For what changes nothing that another test looks at."""
    return running()


@pytest.fixture
def robot(shared: Robot) -> Robot:
    """The same one, brought up again where a test has stopped it, with the gait that it has at first."""
    if shared.exo.controller.controller_state is not ControllerState.RUNNING:
        assert shared.download(16, 0x2000, 1, 1) == "ok"
        shared.until(lambda: shared.exo.controller.controller_state is ControllerState.RUNNING)
    for index, value, size in USUAL:
        assert shared.download(16, index, value, size) == "ok"
    shared.heard.clear()
    return shared


@pytest.fixture
def alone() -> Robot:
    """One of a test's own, which leaves it otherwise."""
    return running()


def running() -> Robot:
    robot = Robot()
    robot.until(lambda: robot.exo.controller.controller_state is ControllerState.RUNNING)
    return robot


def test_controlwords_go_up_only_after_the_statusword_has_shown_the_state() -> None:
    robot = Robot()
    robot.run(1.0)
    way: list[tuple[str, int]] = []
    for heard in robot.heard:
        if heard.cob_id == 0x201:
            way.append(("command", heard.data[0]))
        elif heard.cob_id == 0x181:
            way.append(("state", heard.data[0] & 0x6F))
    changes = [step for index, step in enumerate(way) if step not in way[:index]]
    ups = [step for step in changes if step[1] not in (0x02,)]
    assert ups == [
        ("state", 0x40),
        ("command", 0x06),
        ("state", 0x21),
        ("command", 0x07),
        ("state", 0x23),
        ("command", 0x0F),
        ("state", 0x27),
    ]


def test_it_sends_sync_at_100_hz_and_setpoints_each_cycle(robot: Robot) -> None:
    robot.heard.clear()
    robot.run(1.0)
    syncs = [heard.at_ms for heard in robot.heard if heard.cob_id == 0x80]
    assert len(syncs) == 100
    assert all(9.5 < b - a < 10.5 for a, b in pairwise(syncs))
    for node in range(1, 7):
        commands = [heard.data for heard in robot.heard if heard.cob_id == 0x200 + node]
        assert len(commands) == pytest.approx(100, abs=1)
        assert {data[0] for data in commands} == {0x0F}


def test_it_walks_within_three_seconds() -> None:
    robot = Robot()
    robot.run(3.0)
    assert robot.exo.controller.controller_state is ControllerState.RUNNING
    assert robot.exo.controller.generator.walking == 1.0


def test_a_drive_stopped_by_another_hand_stops_them_all_until_start_is_written(robot: Robot) -> None:
    robot.run(0.5)
    assert robot.download(2, 0x6040, 0x02, 2) == "ok"
    robot.run(0.5)
    assert robot.exo.controller.controller_state is ControllerState.HELD
    assert robot.states() == {PowerState.SWITCH_ON_DISABLED}
    assert struct.unpack("<BHB", robot.heard_last(0x190))[0::2] == (4, 2)
    robot.run(1.0)
    assert robot.states() == {PowerState.SWITCH_ON_DISABLED}
    assert robot.download(16, 0x2000, 1, 1) == "ok"
    robot.run(1.0)
    assert robot.states() == {PowerState.OPERATION_ENABLED}


def test_its_stop_object_stops_all_and_reads_back(robot: Robot) -> None:
    assert robot.exo.controller.dictionary.read(0x2000, 0) == b"\x01"
    assert robot.download(16, 0x2000, 0, 1) == "ok"
    robot.run(0.5)
    assert robot.states() == {PowerState.SWITCH_ON_DISABLED}
    assert robot.exo.controller.dictionary.read(0x2000, 0) == b"\x00"
    assert robot.exo.controller.dictionary.read(0x2012, 0) == b"\xff"


def test_a_drive_that_vanishes_stops_the_others(robot: Robot) -> None:
    robot.exo.drives["right_knee"].power_off()
    robot.run(0.5)
    others = {drive.power_state for name, drive in robot.exo.drives.items() if name != "right_knee"}
    assert others == {PowerState.SWITCH_ON_DISABLED}
    robot.exo.drives["right_knee"].power_on()
    robot.run(1.0)
    assert robot.states() == {PowerState.SWITCH_ON_DISABLED}
    robot.download(16, 0x2000, 1, 1)
    robot.run(1.0)
    assert robot.states() == {PowerState.OPERATION_ENABLED}


def test_a_missing_heartbeat_stops_all_and_is_told(robot: Robot) -> None:
    """The drive still sends its PDOs; only its heartbeat is gone."""
    assert robot.download(5, 0x1017, 0, 2) == "ok"
    robot.run(0.7)
    assert robot.exo.controller.controller_state is ControllerState.HELD
    assert robot.exo.controller.dictionary.read(0x2012, 0) == bytes([5])
    assert robot.states() == {PowerState.SWITCH_ON_DISABLED}
    assert struct.unpack_from("<H", robot.heard_last(0x90))[0] == 0x8130
    robot.run(1.0)
    assert robot.states() == {PowerState.SWITCH_ON_DISABLED}
    assert robot.download(5, 0x1017, 100, 2) == "ok"
    assert robot.download(16, 0x2000, 1, 1) == "ok"
    robot.run(1.0)
    assert robot.states() == {PowerState.OPERATION_ENABLED}
    assert struct.unpack_from("<H", robot.heard_last(0x90))[0] == 0x0000


def test_a_drive_that_somebody_takes_out_of_operational_stops_the_others(robot: Robot) -> None:
    robot.exo.bus.send(Frame(0x000, bytes([128, 3])), "client")
    robot.run(0.5)
    assert robot.exo.controller.controller_state is ControllerState.HELD
    assert robot.exo.controller.dictionary.read(0x2012, 0) == bytes([3])
    assert robot.exo.drives["left_hip"].power_state is PowerState.SWITCH_ON_DISABLED
    assert robot.download(16, 0x2000, 1, 1) == "ok"
    robot.run(1.0)
    assert robot.states() == {PowerState.OPERATION_ENABLED}


def test_it_shows_its_own_heartbeat(robot: Robot) -> None:
    robot.heard.clear()
    robot.run(1.0)
    beats = [heard.data for heard in robot.heard if heard.cob_id == 0x710]
    assert len(beats) == pytest.approx(10, abs=1)
    assert set(beats) == {b"\x05"}


def test_every_activity_is_one_that_the_drives_can_follow(alone: Robot) -> None:
    robot = alone
    controller = robot.exo.controller
    for activity in (*Activity, Activity.WALK):
        controller.go(activity, pace=(0.45, 1.4))
        robot.run(3.5 if activity is Activity.STUMBLE else 1.4)
        assert controller.controller_state is ControllerState.RUNNING
        wanted = [angle for leg in controller.generator.legs() for angle in leg]
        actual = [drive.joint.position for drive in robot.exo.drives.values()]
        assert max(abs(a - b) for a, b in zip(wanted, actual, strict=True)) < 0.25


def test_who_is_stopped_on_the_ground_stays_there(alone: Robot) -> None:
    robot = alone
    robot.exo.controller.go(Activity.FALL)
    robot.run(3.0)
    assert robot.download(16, 0x2000, 0, 1) == "ok"
    robot.run(2.0)
    assert robot.exo.controller.generator.label is Label.LYING


def test_where_the_drive_stays_in_quick_stop_the_controllers_next_command_wins(alone: Robot) -> None:
    """605Ah = 6: transition 16 lets 0Fh enable the drive again before a TPDO has shown that it stopped."""
    robot = alone
    robot.download(2, 0x605A, 6, 2)
    robot.download(2, 0x6040, 0x02, 2)
    robot.run(0.1)
    assert robot.exo.drives["left_knee"].power_state is PowerState.OPERATION_ENABLED
    assert robot.exo.controller.controller_state is ControllerState.RUNNING


@pytest.mark.parametrize(
    ("index", "size", "value", "answer"),
    [
        (0x2001, 2, 199, "06090032"),
        (0x2001, 2, 601, "06090031"),
        (0x2001, 2, 600, "ok"),
        (0x2002, 2, 999, "06090032"),
        (0x2002, 2, 4001, "06090031"),
        (0x2003, 2, 19, "06090032"),
        (0x2003, 2, 121, "06090031"),
        (0x2004, 2, -101, "06090032"),
        (0x2004, 2, 301, "06090031"),
        (0x2004, 2, -100, "ok"),
        (0x2005, 1, 10, "ok"),
        (0x2005, 1, 11, "06090031"),
    ],
)
def test_gait_parameters_have_limits(robot: Robot, index: int, size: int, value: int, answer: str) -> None:
    assert robot.download(16, index, value, size) == answer


def test_the_hip_swings_further_with_longer_steps() -> None:
    robot = BareExoskeleton(Scenario.WALK)
    robot.power_on()
    run(robot, 1.5)
    ranges = []
    for step_length in (200, 600):
        robot.controller.dictionary.write(0x2001, 0, step_length.to_bytes(2, "little"))
        run(robot, 2.0)
        ranges.append(hip_range(robot, 1.6))
    assert ranges[1] - ranges[0] > 0.3


def run(robot: Exoskeleton, seconds: float) -> None:
    robot.clock.run_until(robot.clock.now_ns + round(seconds * 1e9))


def hip_range(robot: Exoskeleton, seconds: float) -> float:
    angles = []
    for _ in range(round(seconds * 50)):
        run(robot, 0.02)
        angles.append(robot.drives["left_hip"].joint.position)
    return max(angles) - min(angles)


def test_setpoints_never_jump_when_parameters_do(robot: Robot) -> None:
    robot.run(1.0)
    robot.heard.clear()
    for index, value in ((0x2001, 600), (0x2002, 1000), (0x2003, 120), (0x2004, 300), (0x2001, 200)):
        robot.download(16, index, value, 2)
        robot.run(0.4)
    targets = [
        int.from_bytes(heard.data[3:], "little", signed=True)
        for heard in robot.heard
        if heard.cob_id == 0x202
    ]
    steps = [abs(b - a) for a, b in pairwise(targets)]
    assert max(steps) < 10.0 * 0.01 * 65_190  # 10 rad/s


def test_the_scenarios_end_in_their_postures() -> None:
    for scenario, hip, knee in ((Scenario.STAND, 0.12, 0.14), (Scenario.SIT, 1.53, 1.57)):
        robot = BareExoskeleton(scenario)
        robot.power_on()
        run(robot, 4.0)
        assert robot.drives["left_hip"].joint.position == pytest.approx(hip, abs=0.05)
        assert robot.drives["right_knee"].joint.position == pytest.approx(knee, abs=0.05)
