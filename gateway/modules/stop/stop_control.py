"""Stop, hold, reset and enabling of one robot, put together for the control module."""

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import TYPE_CHECKING, TypeVar, cast

from drivers.bus.settings import Role
from drivers.joint.cia402 import ABORT_CONNECTION_OPTIONS, QUICK_STOP_OPTIONS, option_text
from gateway import messages
from gateway.boot import boot_id
from gateway.config import RobotConfig
from gateway.futures import back, gather, then
from gateway.loop import Loop
from gateway.modules.stop.controllers import Controllers
from gateway.modules.stop.drive import Drive
from gateway.modules.stop.enabling import Enabling
from gateway.modules.stop.hold import GATEWAY, Hold
from gateway.modules.stop.hold_file import HeldStop
from gateway.modules.stop.reset import Resetter
from gateway.modules.stop.stop import Stop
from gateway.modules.stop.stopper import Stopper
from gateway.records.records import Records
from gateway.sources import check_globs, matches
from gateway.wire import Kind, refuse

if TYPE_CHECKING:
    from gateway.modules.component import ComponentModule

T = TypeVar("T")


class StopControl:
    """It belongs to the loop's thread, but for `load`. `changed` is called when `held` has become another."""

    def __init__(
        self,
        config: RobotConfig,
        component: "ComponentModule",
        loop: Loop,
        records: Records,
        changed: Callable[[], None],
    ) -> None:
        self._config = config
        self._component = component
        self._loop = loop
        self._journal = records.journal
        self._moving: str | None = None  # what leads the drives somewhere just now
        components = component.robot.components
        self.drives = {name: cast("Drive", components[name]) for name in config.joint if name in components}
        self._absent = {name: why for name, why in component.absent.items() if name in config.joint}
        self._controllers = Controllers(config.stop.controller, components, component.robot.descriptions)
        stoppers = {
            name: Stopper(drive, config.stop.fallback, self._tell_fallback)
            for name, drive in self.drives.items()
        }
        self._hold = Hold(loop, stoppers, self._controllers.targets, records, changed)
        self._stop = Stop(
            loop, config.stop, stoppers, self._absent, self._controllers, self._hold, self._tell_fallback
        )
        self._resetter = Resetter(
            loop, self.drives, self._absent, self._controllers.targets, self._hold, self._journal
        )

    @property
    def held(self) -> bool:
        return self._hold.held is not None

    def load(self) -> HeldStop | None:
        """What the last gateway held. In the thread that starts the module."""
        return self._hold.load()

    def resume(self, left: HeldStop | None) -> None:
        """Hold what the last gateway held."""
        self._hold.resume(left)

    def close(self) -> None:
        """End with the process; a held stop stays on disk."""
        self._hold.close()

    def stop(self, who: str, reason: str) -> "Future[messages.Stopped]":
        """Quick stop on every drive, controllers too, held until it is reset."""
        stopped = self._stop.stop(who, reason, lambda name: self._component.when_ready([name]))
        return then(stopped, lambda answer: self._answered(who, answer))

    def reset(self, who: str) -> "Future[messages.Reset]":
        """Lead every drive to SWITCH ON DISABLED, and end the hold; see `Resetter`."""
        return self._one_at_a_time("a reset", lambda: self._resetter.reset(who))

    def enable(
        self, who: str, globs: list[str] | None, objection: Callable[[], str | None]
    ) -> "Future[messages.Enabled]":
        """Enable the joints that the globs mean, as long as there is no `objection`.

        Raises:
            RpcError: not_allowed to an observer; stopped while a stop is held; unavailable where it cannot
                be journaled, as the future's error.

        """
        if self._config.gateway.role is not Role.MASTER:
            raise refuse(
                Kind.NOT_ALLOWED,
                'enabling is the part of the controller that owns the bus; [gateway] role is "observer"',
            )
        check_globs("joint", self.drives, globs, self._absent)
        chosen = {name: drive for name, drive in self.drives.items() if matches(name, globs)}
        objects = self._objection(objection)
        if self.held:
            raise refuse(Kind.STOPPED, str(objects()))
        enabling = Enabling(self._loop, chosen, who, objects, self._journal)
        return self._one_at_a_time("an enabling", lambda: self._explained(who, list(chosen), enabling))

    def info(self, armed: Callable[[str], bool]) -> messages.StopInfo:
        """As `robot.describe` shows it."""
        held = self._hold.held
        return messages.StopInfo(
            held=held is not None,
            reason=None if held is None else held.reason,
            since_ns=None if held is None or held.boot_id != boot_id() else held.monotonic_ns,
            stopped_again=self._hold.again,
            drives={name: _reaction(drive, armed(name)) for name, drive in self.drives.items()},
            fallbacks=[fallback.words for fallback in self._config.stop.fallback],
            controllers={
                name: self._controllers.absent.get(name) for name in sorted(self._controllers.names)
            },
            problem=self._hold.problem,
        )

    def _objection(self, more: Callable[[], str | None]) -> Callable[[], str | None]:
        def objection() -> str | None:
            held = self._hold.held
            if held is None:
                return more()
            return f"the stop of {held.who} is held ({held.reason or 'no reason given'}); reset it first"

        return objection

    def _explained(self, who: str, joints: list[str], enabling: Enabling) -> "Future[messages.Enabled]":
        """What cannot be journaled is not begun."""
        entry = gather({"journal": back(self._loop, self._journal.append(who, "enabling", joints=joints))})

        def begin(written: Mapping[str, Exception | None]) -> "Future[messages.Enabled]":
            error = written["journal"]
            if error is not None:
                raise refuse(Kind.UNAVAILABLE, f"it cannot be journaled, so nothing was enabled: {error}")
            return enabling.run()

        return then(entry, begin)

    def _one_at_a_time(self, what: str, begin: "Callable[[], Future[T]]") -> "Future[T]":
        if self._moving is not None:
            raise refuse(Kind.WRONG_STATE, f"{self._moving} is under way; wait for its answer")
        answer = begin()
        self._moving = what
        answer.add_done_callback(lambda _answer: self._loop.call(self._moved))
        return answer

    def _moved(self) -> None:
        self._moving = None

    def _answered(self, who: str, stopped: messages.Stopped) -> messages.Stopped:
        more = {
            key: value for key in ("controllers", "fallbacks", "problem") if (value := getattr(stopped, key))
        }
        self._journal.append(who, "stop answered", result=stopped.drives, **more)
        return stopped

    def _tell_fallback(self, drive: str, text: str) -> None:
        self._journal.append(GATEWAY, "stop fallback", drive=drive, result=text)


def _reaction(drive: Drive, armed: bool) -> messages.DriveReaction:
    """What a drive does by itself, as it said when it came up."""
    options = {} if drive.reading is None else drive.reading.options
    quick_stop, abort_connection = options.get("quick_stop"), options.get("abort_connection")
    return messages.DriveReaction(
        quick_stop_option=quick_stop,
        abort_connection_option=abort_connection,
        armed=armed,
        quick_stop=option_text(QUICK_STOP_OPTIONS, quick_stop),
        abort_connection=option_text(ABORT_CONNECTION_OPTIONS, abort_connection),
    )
