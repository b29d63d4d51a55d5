"""Where a run begins: a robot that was brought into a situation, each by the events that lead there."""

from dataclasses import dataclass

from tests.explore.events import EVENTS
from tests.explore.invariants import EVERYTHING, Judged
from tests.explore.stage import Stage
from tests.explore.world import BLIND, GUARD, World

BOOTS_S = 2.5


@dataclass(frozen=True, slots=True)
class Scene:
    """How the robot is made, what happens to it before, and whether it comes to rest then."""

    name: str
    before: tuple[str, ...] = ()
    role: str = "observer"
    guard: str = GUARD
    settles: bool = True
    dark: bool = False  # the robot is switched off while the gateway starts

    def build(self, judged: Judged = EVERYTHING) -> Stage:
        """The robot in this situation, one process builds one."""
        stage = Stage(World(role=self.role, guard=self.guard), judged)
        if self.dark:
            for device in stage.world.devices.values():
                device.faults.dead = True
        stage.run_for(BOOTS_S)
        for name in self.before:
            EVENTS[name].act(stage)
            stage.happened()
            if self.settles or name != self.before[-1]:
                stage.settle(3.0)
        return stage


_WALKS = ("gait is started", "ada leads")
_SCENES = (
    Scene("walking", _WALKS),
    Scene("held", (*_WALKS, "ben stops")),
    Scene("trial", (*_WALKS, "try both"), settles=False),
    Scene("tripped", (*_WALKS, "knee is pushed")),
    Scene("restarted", (*_WALKS, "ben stops", "gateway is killed"), settles=False),
    Scene("resting", ("ada leads",)),
    Scene("bench", ("ada leads",), role="master"),
    Scene("lasting", ("gait is started", "ada leads for long", "ada streams", "try for long")),
    Scene("cold", ("gait is started",), guard=""),
    Scene("dark", ("ada leads",), guard=GUARD + BLIND, dark=True),
)
SCENES = {scene.name: scene for scene in _SCENES}
