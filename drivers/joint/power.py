"""What may be asked of one axis's power drive system: stop, disable voltage, reset, and one step up.

Whatever is on its way here ends when a stop is asked for: a way up is neither finished nor begun again.
"""

import time
from concurrent.futures import Future
from functools import partial

from drivers.bus.node import Node
from drivers.bus.sdo import expedited
from drivers.bus.sdo_channel import SdoChannel
from drivers.joint.axis import Axis
from drivers.joint.cia402 import DriveState
from drivers.joint.commands import CONTROLWORD, STOPPED_STATES, Controlword
from drivers.joint.leading import Errand, Led, lead_down, step_up
from drivers.joint.quantities import AXIS_OFFSET
from drivers.joint.quick_stop import StopOutcome, Stopping
from drivers.joint.settings import JointSettings
from drivers.joint.stop_rpdo import StopRpdo, find_stop_rpdo

TRANSITION_S = 3.0  # how long one step up may take: brakes open in it
RESET_S = 3.0  # how long the whole way down may take

# What says that an axis whose voltage was disabled has none.
_LIMP_STATES = frozenset({DriveState.SWITCH_ON_DISABLED, DriveState.FAULT})


class PowerDrive:
    """One axis of a node. Every future fails with `Unavailable` where the joint was not started."""

    def __init__(self, node: Node, settings: JointSettings) -> None:
        self.node = node
        self.settings = settings
        self._offset = settings.axis * AXIS_OFFSET
        self._stops = 0  # were asked for; what began before the last one is over
        self._stop_rpdo: StopRpdo | None = None
        self._quick_stop_request = self._request(Controlword.QUICK_STOP)

    def quick_stop(self, *, wake: bool = True) -> Future[StopOutcome]:
        """Ask the drive for a quick stop, ahead of everything else that is asked of its node.

        The controlword is on the bus when this returns, unless another stop has the node's SDO channel. The
        future's result says what the statusword confirmed within `stop_timeout_s`. Who stops several drives
        wakes those who wait for their answers when all have been asked: `wake=False`, then `wake`.
        """
        self._stops += 1
        rpdo = self._stop_rpdo
        sent = rpdo is not None and rpdo.send()
        stopping = Stopping(Controlword.QUICK_STOP, STOPPED_STATES, self.settings.stop_timeout_s)
        return self._stop(stopping, None if sent else self._quick_stop_request, wake=wake)

    def wake(self) -> None:
        """Follow what was asked for with `wake=False`."""
        self.node.wake()

    def disable_voltage(self) -> Future[StopOutcome]:
        """Take the motor's current away: an axis that a quick stop does not stop goes limp."""
        self._stops += 1
        stopping = Stopping(Controlword.DISABLE_VOLTAGE, _LIMP_STATES, self.settings.stop_timeout_s)
        return self._stop(stopping, self._request(Controlword.DISABLE_VOLTAGE))

    def nmt_stop(self) -> None:
        """Stop the whole node (NMT). It answers no SDO then: nothing confirms what its 6007h makes of that.

        Raises `Unavailable`.
        """
        self.node.bus.stop_node(self.node.node_id)

    def reset(self) -> Future[Led]:
        """Lead it to SWITCH ON DISABLED, and never further."""
        errand = self._errand(RESET_S)
        return self.node.run(lambda sdo: lead_down(self._axis(sdo), errand))

    def look(self) -> Future[Led]:
        """Read the statusword."""
        return self.node.run(lambda sdo: Led(self._axis(sdo).state(), asked_ns=time.monotonic_ns()))

    def step_up(self, origin: DriveState) -> Future[Led]:
        """Make the one transition up from `origin`."""
        errand = self._errand(TRANSITION_S)
        return self.node.run(lambda sdo: step_up(self._axis(sdo), errand, origin))

    def read_stop_channel(self, sdo: SdoChannel) -> None:
        """Find out which way a stop takes; raises `DriverError`."""
        self._stop_rpdo = find_stop_rpdo(self.node, sdo, self._offset)

    def _stop(self, stopping: Stopping, ahead: bytes | None, *, wake: bool = True) -> Future[StopOutcome]:
        """Ask, where that is not done, and confirm, each in a job of its own; see `Stopping`."""
        if ahead is None:
            return self._confirm(stopping, wake=wake)
        outcome: Future[StopOutcome] = Future()

        def confirm(asked: Future[None]) -> None:
            error = asked.exception()
            if error is not None:
                outcome.set_exception(error)
            else:
                self._confirm(stopping).add_done_callback(partial(_pass_on, outcome))

        asked = self.node.run(lambda sdo: stopping.ask(self._axis(sdo)), urgent=True, ahead=ahead, wake=wake)
        asked.add_done_callback(confirm)
        return outcome

    def _confirm(self, stopping: Stopping, *, wake: bool = True) -> Future[StopOutcome]:
        return self.node.run(lambda sdo: stopping.confirm(self._axis(sdo)), urgent=True, wake=wake)

    def _axis(self, sdo: SdoChannel) -> Axis:
        return Axis(sdo, self._offset)

    def _request(self, controlword: Controlword) -> bytes:
        """What a job that sends this controlword begins with."""
        return expedited(CONTROLWORD + self._offset, 0, controlword.data)

    def _errand(self, timeout_s: float) -> Errand:
        stops = self._stops
        counts_per_turn = self.settings.counts_per_revolution * self.settings.gear_ratio
        return Errand(lambda: self._stops == stops, timeout_s, counts_per_turn)


def _pass_on(outcome: Future[StopOutcome], found: Future[StopOutcome]) -> None:
    error = found.exception()
    if error is not None:
        outcome.set_exception(error)
    else:
        outcome.set_result(found.result())
