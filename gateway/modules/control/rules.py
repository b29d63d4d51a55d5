"""Permission to write to a robot's devices: one rule for writing and for reverting.

Only parameters that the robot's file names, at the address that it names, within limits and largest step, in
the allowed states of the drives that they may move.
"""

import time
from collections.abc import Collection, Iterable, Mapping
from concurrent.futures import Future
from typing import Any, Protocol

from drivers.bus.settings import DeviceSettings
from drivers.bus.values import unsigned
from drivers.joint.cia402 import ENERGISED, STATE_WORDS, DriveState, drive_state
from drivers.joint.commands import STATUSWORD
from drivers.joint.quantities import AXIS_OFFSET
from drivers.joint.settings import JointSettings
from drivers.samples import ComponentState
from gateway.coding import Limit, broken_limit
from gateway.config.robot import RobotConfig
from gateway.modules.component.module import ComponentModule
from gateway.modules.control.objects import Node, results
from gateway.modules.control.parameters import Parameter
from gateway.modules.stop.authority import Address
from gateway.records.undo import UndoChange
from gateway.wire.framing import ErrorKind

HEARD_S = 2.0  # a node that has said something within it is there
Known = tuple[DriveState | None, str]  # a drive's state; in words where that is from, or why it is not known


class OfComponent(Protocol):
    """A parameter, or an object."""

    @property
    def component(self) -> str: ...


class OutOfReach(Exception):
    """The device cannot be asked; `final` where it never will be."""

    def __init__(self, why: str, *, final: bool) -> None:
        super().__init__(why)
        self.final = final


class Rules:
    """One robot's. What reads from drives waits for them, and is for the writer's thread."""

    def __init__(
        self, config: RobotConfig, component: ComponentModule, parameters: Mapping[str, Parameter]
    ) -> None:
        self._config = config
        self._component = component
        self._parameters = parameters
        self._devices: dict[str, JointSettings | DeviceSettings] = {**config.joint, **config.device}

    def address(self, parameter: Parameter) -> Address:
        device = self._devices[parameter.component]
        return device.bus, device.node_id, parameter.index, parameter.subindex

    def device(self, of: OfComponent) -> str:
        """Return a name for the device, the same whichever tables of the robot's file describe it."""
        device = self._devices[of.component]
        return f"node {device.node_id} on {device.bus}"

    def node(self, parameter: Parameter) -> Node:
        """Return the node; raises `RpcError` (unavailable) if its device could not be built."""
        component: Any = self._component.robot.components.get(parameter.component)
        if component is None:
            raise parameter.refusal(ErrorKind.UNAVAILABLE, parameter.problem or "its device is not there")
        node: Node = component.node
        return node

    def silence(self, component: str) -> str | None:
        """Return why a device cannot be asked. Whether its samples come is another matter."""
        found: Any = self._component.robot.components.get(component)
        if found is None:
            return self._component.absent.get(component, "it is not there")
        if found.node.ready:
            return None
        return str(self._component.quality(component, time.monotonic_ns())["problem"] or "it is silent")

    def absence(self, component: str) -> str | None:
        """Return why readings of a device may hold no longer: it is lost, and its node is silent, too.

        A joint is lost without its position, though a node that waits for its master answers.
        """
        now_ns = time.monotonic_ns()
        quality = self._component.quality(component, now_ns)
        found: Any = self._component.robot.components.get(component)
        if quality["state"] != ComponentState.LOST:
            return None
        if component in self._config.joint and found is not None and found.node.ready:
            heard_ns = found.node.life.heard_ns
            if heard_ns is not None and now_ns - heard_ns <= HEARD_S * 1e9:
                return None
        return str(quality["problem"] or "it is silent")

    def reach(self, change: UndoChange) -> tuple[Parameter, Node]:
        """Return a written parameter and its node, if its name in the robot's file still means the same.

        Raises:
            OutOfReach: it does not, or the device is not there now.

        """
        where = f"node {change.node_id} on bus {change.bus!r}"
        device = self._devices.get(change.component)
        if device is None or (device.bus, device.node_id) != (change.bus, change.node_id):
            raise OutOfReach(
                f"the robot's file no longer says that {where} is {change.component}", final=True
            )
        if change.component in self._component.absent:
            raise OutOfReach(self._component.absent[change.component], final=False)
        parameter = self._parameters.get(change.parameter)
        if parameter is None or _named(parameter) != (
            change.parameter,
            change.component,
            change.index,
            change.subindex,
        ):
            what = f"0x{change.index:04X}:{change.subindex} of {change.component}"
            raise OutOfReach(f"the robot's file no longer says that {what} is {change.parameter}", final=True)
        silence = self.silence(change.component)
        if silence is not None:
            raise OutOfReach(silence, final=False)
        return parameter, self.node(parameter)

    # What is known without asking

    def check_value(self, parameter: Parameter, held: bytes, new: bytes) -> None:
        """Raise `RpcError` where `new` must not be written over `held`, whatever the drives do."""
        value = parameter.accepts(new)
        most, unit = parameter.max_step, parameter.settings.unit
        if most is None:
            return
        before = parameter.decode(held)
        if broken_limit(parameter, parameter.coding, value, before) is Limit.MAX_STEP:
            step = abs(value - before)
            text = f"from {before:g} {unit} it may change by {most:g} {unit} at once, not by {step:g}"
            raise parameter.refusal(ErrorKind.OUT_OF_LIMIT, text, most)

    def bars(self, parameter: str, joints: Iterable[str]) -> bool:
        """Return whether a parameter cannot be written any more once one of these joints is enabled."""
        found = self._parameters.get(parameter)
        if found is None or _may_be_enabled(found):
            return False
        return not set(joints).isdisjoint(self._config.drives_of(found.component))

    # What the drives must be asked for

    def check_states(self, parameter: Parameter) -> None:
        """Raise `RpcError` unless every drive that it may move is known to be in a state that allows it."""
        allowed = allowed_states(parameter)
        if allowed is None:
            return
        for drive, (state, why) in self.states(self._config.drives_of(parameter.component)).items():
            if state not in allowed:
                said = f"unknown: {why}" if state is None else STATE_WORDS[state]
                wanted = ", ".join(sorted(STATE_WORDS[one] for one in allowed))
                text = f"the state of {drive} is {said}; this parameter may be written in: {wanted}"
                raise parameter.refusal(ErrorKind.WRONG_STATE, text)

    def states(self, drives: Collection[str]) -> dict[str, Known]:
        """Return each drive's state as it says now, all of them asked at once."""
        components = self._component.robot.components
        told = results({drive: self._ask(drive) for drive in drives if drive in components})
        return {drive: self._known(drive, told.get(drive)) for drive in drives}

    def _ask(self, drive: str) -> "Future[bytes]":
        component: Any = self._component.robot.components[drive]
        index = STATUSWORD + AXIS_OFFSET * self._config.joint[drive].axis
        answer: Future[bytes] = component.node.upload(index, 0)
        return answer

    def _known(self, drive: str, told: bytes | Exception | None) -> Known:
        if isinstance(told, bytes):
            statusword = unsigned(told)
            return drive_state(statusword), f"its statusword is 0x{statusword:04X}"
        return None, self._component.absent.get(drive, "it is not there") if told is None else str(told)


def allowed_states(parameter: Parameter) -> frozenset[DriveState] | None:
    """Return the drive states in which a parameter may be written; `None` where the state does not matter."""
    settings = parameter.settings
    if settings.states is None:
        return None if settings.live else frozenset(DriveState) - ENERGISED
    named = frozenset(state for state in DriveState if STATE_WORDS[state] in settings.states)
    return named if settings.live else named - ENERGISED


def _may_be_enabled(parameter: Parameter) -> bool:
    allowed = allowed_states(parameter)
    return allowed is None or DriveState.OPERATION_ENABLED in allowed


def _named(parameter: Parameter) -> tuple[str, str, int, int]:
    return parameter.name, parameter.component, parameter.index, parameter.subindex
