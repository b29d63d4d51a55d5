"""The whole machine without its doors: clock, bus, drives, gait controller, insoles, IMU and the wearer."""

import math
import random
from collections.abc import Callable, Collection, Iterable, Mapping
from enum import StrEnum
from pathlib import Path

import eds
from hil_sim import controller, personality
from hil_sim.bench_user import BenchUser
from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock, Event
from hil_sim.controller import GaitController
from hil_sim.drive import objects
from hil_sim.drive.drive import JointDrive
from hil_sim.drive.mechanics import Joint, JointConstants
from hil_sim.errors import SimulatorError
from hil_sim.gait.posture import STANDING
from hil_sim.gait.subject import subject
from hil_sim.gait.timetable import Entry, Pace, timetable
from hil_sim.gait.walks import NAMES, ORDINARY, WALKS
from hil_sim.gait.wearer import Wearer
from hil_sim.mounting import Mounting
from hil_sim.node.lss import UNCONFIGURED
from hil_sim.node.node import Node
from hil_sim.sensors.suite import FEET, PERIOD_NS, TRUNK, SensorChoice, SensorSuite

JOINTS = {"left_hip": 1, "left_knee": 2, "left_ankle": 3, "right_hip": 4, "right_knee": 5, "right_ankle": 6}
SIDES = ("left", "right")
CONTROLLER, CONTROLLER_NODE = "gait", 16
SENSORS = (*FEET, TRUNK)

SERIAL_NUMBERS = 20_260_000  # of the drives: this and the usual node id
DRIVE_EDS = "joint_drive.eds"
CONTROLLER_EDS = "gait_controller.eds"


class Scenario(StrEnum):
    """Activity of the robot once it is up."""

    WALK = "walk"
    STAND = "stand"
    SIT = "sit"
    SIT_TO_STAND = "sit_to_stand"
    STAIRS_UP = "stairs_up"
    STAIRS_DOWN = "stairs_down"
    RAMP_UP = "ramp_up"
    RAMP_DOWN = "ramp_down"
    TURN_LEFT = "turn_left"
    TURN_RIGHT = "turn_right"
    STUMBLE = "stumble"
    FALL = "fall"
    DAY = "day"


class Exoskeleton:
    """A robot and its wearer in simulated time; the same arguments give the same frames and bytes.

    The wearer is the subject of number `person`. `drives` gives joints another EDS or DCF than our own
    drive's; `mountings` says how joints are built in otherwise than ours. The nodes named in `without` are
    somebody else's and never switched on; the drives of the joints in `unconfigured` have no node id yet, and
    wait for LSS. The wearer walks as `walk` says, one of `hil_sim.gait.walks.NAMES`, at a pace of that walk.
    A robot that `assists` one side alone has that leg's drives, and both insoles: no PDO or SDO of the
    controller ever goes to the other leg's node ids. What is in `measured` is called after each cycle of the
    sensors.

    Raises `hil_sim.errors.SimulatorError` for a file that cannot be used, and where the controller would lead
    a drive that is not simulated.
    """

    def __init__(
        self,
        scenario: Scenario = Scenario.WALK,
        seed: int = 0,
        sensors: SensorChoice | None = None,
        person: int = 0,
        drives: Mapping[str, Path] | None = None,
        without: Collection[str] = (),
        unconfigured: Collection[str] = (),
        mountings: Mapping[str, Mounting] | None = None,
        walk: str = ORDINARY,
        assists: str | None = None,
    ) -> None:
        _refuse_to_lead_others(without)
        self.walk = _known("walk", walk, NAMES)
        self.assists = None if assists is None else _known("side", assists, SIDES)
        self.absent = frozenset(joint for joint in JOINTS if not joint.startswith(assists or ""))
        self.without = frozenset(without) | self.absent
        self.seed = seed
        self.measured: list[Callable[[], None]] = []
        self.clock = Clock()
        self.bus = CanBus(self.clock)
        files = dict.fromkeys(JOINTS, eds.locate(DRIVE_EDS, None)) | dict(drives or {})
        usual = {name: Mounting(node_id) for name, node_id in JOINTS.items()}
        self.mountings = usual | dict(mountings or {})
        self.drives = {name: self._drive(name, one, files[name]) for name, one in self.mountings.items()}
        for name in unconfigured:
            self.drives[name].factory_node_id = UNCONFIGURED
        self.controller = self._controller(person)
        self.wearer = Wearer(self.controller.generator)
        self.sensors = SensorSuite(sensors or SensorChoice(), self.clock, self.bus, seed)
        self.hands = BenchUser()
        self._entries = timetable(scenario, seed)
        self._next_entry: Event | None = None
        self._take_own_pace()

    def power_on(self) -> None:
        """Switch everything on: the nodes boot, the sensors send."""
        for drive in self.simulated_drives:
            drive.power_on()
        if CONTROLLER not in self.without:
            self.controller.power_on(100 * MILLISECOND_NS)
        self.clock.every(PERIOD_NS, self._measure)
        if self._next_entry is None:  # nobody has said otherwise before
            self._go_on()

    @property
    def simulated_drives(self) -> list[JointDrive]:
        """Those that are not left out."""
        return [drive for name, drive in self.drives.items() if name not in self.without]

    @property
    def nodes(self) -> list[Node]:
        """Every CANopen device that is simulated."""
        controller = [] if CONTROLLER in self.without else [self.controller]
        return [*self.simulated_drives, *controller, *self.sensors.nodes]

    def follow(self, entries: Iterable[Entry]) -> None:
        """Do from now on what this timetable says, instead of the scenario."""
        if self._next_entry is not None:
            self._next_entry.cancel()
        self._entries = iter(entries)
        self._go_on()

    def _go_on(self) -> None:
        """Want what the timetable says next; the controller comes back to it after a reset."""
        entry = next(self._entries, None)
        if entry is None:
            return
        self.controller.go(entry.activity, self.own_pace(entry.pace))
        self.controller.dictionary[controller.ACTIVITY].default = int(entry.activity)
        if math.isfinite(entry.seconds):
            self._next_entry = self.clock.after(round(entry.seconds * SECOND_NS), self._go_on)

    def own_pace(self, pace: Pace | None) -> Pace | None:
        """Return this wearer's own pace, where an ordinary one is told to walk at `pace`."""
        return pace if pace is None or self.walk == ORDINARY else WALKS[self.walk].pace(*pace)

    def _take_own_pace(self) -> None:
        """Walk as fast as this walk usually is, until an operator or the timetable says otherwise."""
        keys = (controller.STEP_LENGTH, controller.CYCLE_TIME)
        entries = [self.controller.dictionary[key] for key in keys]
        pace = self.own_pace((entries[0].number() / 1e3, entries[1].number() / 1e3))
        for entry, value in zip(entries, pace or (), strict=True):
            entry.take(round(value * 1e3))
            entry.default = entry.value

    def _drive(self, name: str, mounting: Mounting, file: Path) -> JointDrive:
        description = personality.describe(file, mounting.node_id)
        start = mounting.seen(getattr(STANDING, name.partition("_")[2]))
        joint = Joint(mounting.constants(JointConstants()), start)
        drive = JointDrive(self.clock, self.bus, name, mounting.node_id, description, joint)
        drive.encoder.offset_counts = mounting.zero
        drive.number_serially(SERIAL_NUMBERS + JOINTS[name])
        limits = [drive.dictionary[key] for key in objects.POSITION_LIMITS if drive.objects.has(key)]
        built_in = sorted(mounting.direction * entry.number() + mounting.zero for entry in limits)
        for entry, counts in zip(limits, built_in, strict=True):
            if mounting != Mounting(mounting.node_id) and built_in[0] < built_in[-1]:
                entry.commissioned = entry.value = round(counts)
        return drive

    def _controller(self, person: int) -> GaitController:
        description = eds.load(eds.locate(CONTROLLER_EDS, None), CONTROLLER_NODE)
        return GaitController(
            self.clock,
            self.bus,
            CONTROLLER,
            CONTROLLER_NODE,
            description,
            tuple(self.mountings.values()),
            next(iter(self.drives.values())).counts_per_radian,
            subject(person, self.walk),
            random.Random(f"{self.seed} gait"),
            [
                drive.node_id
                for name, drive in self.drives.items()
                if name not in self.absent and drive.description.path.name != DRIVE_EDS
            ],
            [place for place, joint in enumerate(JOINTS) if joint in self.absent],
        )

    def _measure(self) -> None:
        """One cycle of the sensors, and of what the wearer does to the joints."""
        now_s = self.clock.now_s
        drives = zip(
            self.drives.values(), self.mountings.values(), self.wearer.joint_loads(now_s), strict=True
        )
        for drive, mounting, load in drives:
            drive.advance()
            drive.joint.load = mounting.seen(load)
        feet, trunk = self.hands.upon(self.wearer.feet(now_s), self.wearer.trunk(now_s), now_s)
        self.sensors.measure(*feet, trunk)
        for watch in self.measured:
            watch()


def _known(what: str, name: str, names: Collection[str]) -> str:
    if name not in names:
        raise SimulatorError(f"there is no {what} {name!r}: {', '.join(names)}")
    return name


def _refuse_to_lead_others(without: Collection[str]) -> None:
    """Refuse a controller that would enable real drives."""
    joints = [name for name in JOINTS if name in without]
    if joints and CONTROLLER not in without:
        raise SimulatorError(
            f"the simulated gait controller would enable and move a {joints[0]} that is not simulated: "
            f"leave {CONTROLLER} out too"
        )
