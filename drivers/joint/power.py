"""Commands to one axis's power drive system: stop, disable voltage, reset, and one step up.

Whatever is on its way here ends when a stop is asked for: a way up is neither finished nor begun again.
"""

from collections.abc import Callable, Collection
from concurrent.futures import Future
from dataclasses import replace
from typing import TypeVar

from drivers.bus.node import Node
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.sdo.protocol import expedited
from drivers.bus.sender import always
from drivers.joint.axis import Axis
from drivers.joint.cia402 import DriveState
from drivers.joint.commands import CONTROLWORD, STOPPED_STATES, Controlword
from drivers.joint.homing import begin
from drivers.joint.quantities import AXIS_OFFSET
from drivers.joint.quick_stop import StopOutcome, Stopping
from drivers.joint.settings import JointSettings
from drivers.joint.stop_rpdo import StopRpdo
from drivers.joint.transitions import Errand, Led, lead_down, look, step_up

T = TypeVar("T")

TRANSITION_S = 3.0  # how long one step up may take: brakes open in it
RESET_S = 3.0  # how long the whole way down may take

# What says that an axis whose voltage was disabled has none.
LIMP_STATES = frozenset({DriveState.SWITCH_ON_DISABLED, DriveState.FAULT})
_STOPS = (Controlword.QUICK_STOP, Controlword.DISABLE_VOLTAGE)


class PowerDrive:
    """One axis of a node. Every future fails with `Unavailable` where the joint was not started."""

    def __init__(self, node: Node, settings: JointSettings) -> None:
        self.node = node
        self.settings = settings
        self.confirmed_ns = 0  # when the reads were begun that the newest confirmed stop rests on
        self._offset = settings.axis * AXIS_OFFSET
        self._last_stop = object()  # another one for each; what began before the last one is over
        self._stop_rpdo: StopRpdo | None = None  # which way a stop takes, as long as that is known
        self._requests = {
            controlword: expedited(CONTROLWORD + self._offset, 0, controlword.data) for controlword in _STOPS
        }

    def quick_stop(self, *, wake: bool = True) -> Future[StopOutcome]:
        """Ask the drive for a quick stop, ahead of everything else that is asked of its node.

        The controlword is on the bus when this returns, unless another stop has the node's SDO channel; then
        it is the next to have it. The future's result says what the statusword confirmed within
        `stop_timeout_s`, by reads that were begun after that. Who stops several drives wakes those who wait
        for their answers when all have been asked: `wake=False`, then `wake`.
        """
        self._last_stop = object()
        rpdo = self._stop_rpdo
        sent = rpdo is not None and rpdo.send()
        return self._stop(Controlword.QUICK_STOP, STOPPED_STATES, asked=sent, wake=wake)

    def wake(self) -> None:
        """Follow what was asked for with `wake=False`."""
        self.node.wake()

    def disable_voltage(self) -> Future[StopOutcome]:
        """Take the motor's current away: an axis that a quick stop does not stop goes limp."""
        self._last_stop = object()
        return self._stop(Controlword.DISABLE_VOLTAGE, LIMP_STATES)

    def nmt_stop(self) -> None:
        """Stop the whole node (NMT).

        It answers no SDO then: nothing confirms what its 6007h makes of that.
        """
        self.node.bus.stop_node(self.node.node_id)

    def look(self) -> Future[Led]:
        """Read its statusword once, behind all that is more urgent; no command is sent."""
        return self.node.run(lambda sdo: look(self._axis(sdo)))

    def reset(self, wanted: Callable[[], bool] = always) -> Future[Led]:
        """Lead it to SWITCH ON DISABLED, and never further, as long as that is `wanted`."""
        errand = self._errand(RESET_S, wanted)
        return self.node.run(lambda sdo: lead_down(self._axis(sdo), errand))

    def step_up(
        self, origin: DriveState, wanted: Callable[[], bool] = always, still_in: Collection[int] = ()
    ) -> Future[Led]:
        """Make the one transition up from `origin`, if that is `wanted`; see `Errand.still_in`."""
        errand = replace(self._errand(TRANSITION_S, wanted), still_in=still_in)
        return self.node.run(lambda sdo: step_up(self._axis(sdo), errand, origin))

    def home(self, wanted: Callable[[], bool]) -> Future[Led]:
        """Begin the homing that was set up, where it is enabled in that mode and this is `wanted`."""
        errand = self._errand(TRANSITION_S, wanted)
        return self.node.run(lambda sdo: begin(self._axis(sdo), errand))

    def ask(self, question: Callable[[Axis], T]) -> Future[T]:
        """Read from the axis, or set up what moves nothing, in a row."""
        return self.node.run(lambda sdo: question(self._axis(sdo)))

    def _stop(
        self,
        controlword: Controlword,
        confirmed_by: Collection[DriveState],
        *,
        asked: bool = False,
        wake: bool = True,
    ) -> Future[StopOutcome]:
        """Turn after turn, each behind those of the node's other axes; see `Stopping`."""
        stopping = Stopping(controlword, confirmed_by, self.settings.stop_timeout_s, asked=asked)
        outcome: Future[StopOutcome] = Future()

        def take_turn(ahead: bytes | None = None, *, wake: bool = False) -> None:
            turn = self.node.run(
                lambda sdo: stopping.turn(self._axis(sdo)), urgent=True, ahead=ahead, wake=wake
            )
            turn.add_done_callback(after_turn)

        def after_turn(turn: Future[StopOutcome | None]) -> None:
            error = turn.exception()
            if error is not None:
                outcome.set_exception(error)
            elif (found := turn.result()) is None:
                take_turn()
            else:
                if found is StopOutcome.CONFIRMED:
                    self.confirmed_ns = max(self.confirmed_ns, stopping.read_ns)
                outcome.set_result(found)

        take_turn(None if asked else self._requests[controlword], wake=wake)
        return outcome

    def _axis(self, sdo: SdoChannel) -> Axis:
        return Axis(sdo, self._offset)

    def _errand(self, timeout_s: float, wanted: Callable[[], bool]) -> Errand:
        """Return an errand that ends with the next stop. Earlier stops are the caller's responsibility."""
        last_stop = self._last_stop
        counts_per_turn = self.settings.counts_per_revolution * self.settings.gear_ratio
        return Errand(lambda: self._last_stop is last_stop and wanted(), timeout_s, counts_per_turn)
