"""The whole machine without its doors: clock, bus, drives, gait controller, insoles, IMU and the wearer."""

from enum import StrEnum

import eds
from hil_sim import controller
from hil_sim.bus.can_bus import CanBus
from hil_sim.clock import MILLISECOND_NS, Clock
from hil_sim.controller import GaitController
from hil_sim.drive.drive import JointDrive
from hil_sim.drive.mechanics import Joint, JointConstants
from hil_sim.gait.activity import Activity
from hil_sim.gait.posture import STANDING
from hil_sim.gait.wearer import Wearer
from hil_sim.sensors.suite import FEET, PERIOD_NS, TRUNK, SensorChoice, SensorSuite

JOINTS = {"left_hip": 1, "left_knee": 2, "left_ankle": 3, "right_hip": 4, "right_knee": 5, "right_ankle": 6}
CONTROLLER, CONTROLLER_NODE = "gait", 16
SENSORS = (*FEET, TRUNK)

DRIVE_EDS = "joint_drive.eds"
CONTROLLER_EDS = "gait_controller.eds"


class Scenario(StrEnum):
    """What the robot does once it is up."""

    WALK = "walk"
    STAND = "stand"
    SIT = "sit"


_ACTIVITIES = {Scenario.WALK: Activity.WALK, Scenario.STAND: Activity.STAND, Scenario.SIT: Activity.SIT}


class Exoskeleton:
    """A robot and its wearer in simulated time; the same scenario and seed give the same frames and bytes."""

    def __init__(
        self, scenario: Scenario = Scenario.WALK, seed: int = 0, sensors: SensorChoice | None = None
    ) -> None:
        self.clock = Clock()
        self.bus = CanBus(self.clock)
        self.drives = {name: self._drive(name, node_id) for name, node_id in JOINTS.items()}
        self.controller = self._controller(scenario)
        self.wearer = Wearer(self.controller.generator)
        self.sensors = SensorSuite(sensors or SensorChoice(), self.clock, self.bus, seed)

    def power_on(self) -> None:
        """Switch everything on: the nodes boot, the sensors send."""
        for drive in self.drives.values():
            drive.power_on()
        self.controller.power_on(100 * MILLISECOND_NS)
        self.clock.every(PERIOD_NS, self._measure)

    def _drive(self, name: str, node_id: int) -> JointDrive:
        description = eds.load(eds.locate(DRIVE_EDS, None), node_id)
        start = getattr(STANDING, name.partition("_")[2])
        return JointDrive(self.clock, self.bus, name, node_id, description, Joint(JointConstants(), start))

    def _controller(self, scenario: Scenario) -> GaitController:
        description = eds.load(eds.locate(CONTROLLER_EDS, None), CONTROLLER_NODE)
        node = GaitController(
            self.clock,
            self.bus,
            CONTROLLER,
            CONTROLLER_NODE,
            description,
            tuple(JOINTS.values()),
            next(iter(self.drives.values())).counts_per_radian,
        )
        activity = node.dictionary[controller.ACTIVITY]
        activity.value = activity.default = int(_ACTIVITIES[scenario])
        return node

    def _measure(self) -> None:
        """One cycle of the sensors, and of what the wearer does to the joints."""
        now_s = self.clock.now_s
        for drive, load in zip(self.drives.values(), self.wearer.joint_loads(now_s), strict=True):
            drive.joint.load = load
        self.sensors.measure(*self.wearer.feet(now_s), self.wearer.trunk())
