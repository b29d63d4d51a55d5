"""Storing to flash: the devices, the values they would keep, obstacles, and the storing itself."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from gateway.client import NotConnected, RemoteError
from gateway.several_joints import StoreOutcome, refused_or_unknown, storing
from gateway.wire.parameter import Stored
from gateway.wire.robot import Description
from server_gui.core.follow.news import NewsKind
from server_gui.core.follow.robot import Robot
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.tuning.commands import Commands
from server_gui.core.tuning.lease import LeaseState
from server_gui.core.tuning.link import LEASE_S
from server_gui.core.tuning.writing import Trial, WriteProgress, WriteState

# States in which a drive's motor is under power (CiA 402-2).
ENERGISED: Final = ("operation enabled", "quick stop active", "fault reaction active")


@dataclass(frozen=True, slots=True)
class Storable:
    """One device that says it can store; the axes of one device store together."""

    components: tuple[str, ...]
    parameters: tuple[str, ...]  # that can be changed here; the device keeps all that it has

    @property
    def title(self) -> str:
        return " + ".join(self.components).replace("_", " ")


def storable(description: Description) -> list[Storable]:
    """Return the devices whose EDS has the command, in the robot's order."""
    return [
        Storable(
            components,
            tuple(
                info.name
                for info in description.parameters
                if info.component in components and info.read_only is None
            ),
        )
        for components in storing(description)
    ]


def objection(device: Storable, robot: Robot, trial: Trial | None) -> str | None:
    """Return why the robot would refuse to store it now, as far as that is known here."""
    if trial is not None:
        return f"{', '.join(trial.values)} is on trial: keep it or take it back first"
    joints = robot.names("joint")
    moved = [name for name in device.components if name in joints] or joints
    powered = [name for name in moved if robot.word(f"{name}.state") in ENERGISED]
    if powered:
        return f"{', '.join(powered)} under power: a device may not answer while it stores, so stop it first"
    return None


class Storing:
    """Asks devices to store, one after another, and says what came of each; `tell` notes it.

    Nothing is asked over a link that was lost: the devices that are left then are named.
    """

    def __init__(
        self,
        commands: Commands,
        deliver: Deliver,
        writing: WriteProgress,
        control: LeaseState,
        tell: Callable[[NewsKind, str], None],
    ) -> None:
        self._commands = commands
        self._deliver = deliver
        self._writing = writing
        self._control = control
        self._tell = tell
        self._left: list[str] = []
        self._done: list[tuple[str, StoreOutcome, str]] = []

    def begin(self, components: Sequence[str]) -> None:
        """Store these; each names a device."""
        if not self._left and components:
            self._left, self._done = list(components), []
            self._next()

    def _next(self) -> None:
        component = self._left[0]
        self._writing.storing(component)
        when_done(
            self._commands.store(component),
            self._deliver,
            lambda stored: self._stored(component, stored),
            lambda error: self._failed(component, error),
        )

    def _stored(self, component: str, stored: Stored) -> None:
        self._control.renewed(LEASE_S)
        self._note(component, StoreOutcome.STORED, f"{stored.component}: {stored.result}")

    def _failed(self, component: str, error: Exception) -> None:
        if isinstance(error, RemoteError):
            self._note(component, refused_or_unknown(error.kind), str(error))
            return
        self._done += [(name, StoreOutcome.UNASKED, "the link was lost") for name in self._left[1:]]
        self._left = [component]
        self._note(
            component,
            StoreOutcome.UNASKED if isinstance(error, NotConnected) else StoreOutcome.UNKNOWN,
            str(error),
        )

    def _note(self, component: str, outcome: StoreOutcome, said: str) -> None:
        self._done.append((component, outcome, said))
        self._left.remove(component)
        if self._left:
            self._next()
            return
        state, text = _summed(self._done)
        self._writing.say(state, text)
        self._tell(NewsKind.PARAMETER, text if state is WriteState.DONE else f"{state.value}: {text}")


def _summed(done: Sequence[tuple[str, StoreOutcome, str]]) -> tuple[WriteState, str]:
    """Return the worst of it, and what came of each; of one device its own words."""
    outcomes = {outcome for _, outcome, _ in done}
    state = WriteState.DONE if outcomes == {StoreOutcome.STORED} else WriteState.NOT_STORED
    if StoreOutcome.UNKNOWN in outcomes:
        state = WriteState.UNKNOWN
    if len(done) == 1:
        return state, done[0][2]
    lines = (
        f"{name}: {outcome}" + ("" if outcome is StoreOutcome.STORED else f", {said}")
        for name, outcome, said in done
    )
    return state, "\n".join(lines)
