"""The hold of a stop: kept on disk, and watched over until its reset, whoever comes and goes.

A drive that somebody enables again is stopped again, and it is said.
"""

import logging
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future

import msgspec

from gateway.boot import boot_id
from gateway.futures import outcome
from gateway.loop import Loop, Timer
from gateway.modules.stop.held import Held
from gateway.modules.stop.hold_file import HeldStop, HoldFile
from gateway.modules.stop.stopper import Stopper
from gateway.modules.stop.target import Target
from gateway.records.records import Records

log = logging.getLogger(__name__)

WATCH_S = 0.25  # how often drives that say nothing are looked at
SAY_AGAIN_S = 5.0  # how often one drive that is enabled again and again is logged and journaled
GATEWAY = "gateway"  # who the journal says it was, where nobody asked


class Hold:
    """At most one hold. It belongs to the loop's thread, but for `load`.

    `changed` is called when `held` has become another; `controllers` are stopped again with the drives.
    """

    def __init__(
        self,
        loop: Loop,
        stoppers: Mapping[str, Stopper],
        controllers: Mapping[str, Target],
        records: Records,
        changed: Callable[[], None],
    ) -> None:
        self.held: HeldStop | None = None
        self.begun = 0  # stops so far: a reset that one of them overtook ends nothing
        self.asks_unseen = True  # whether drives are asked that cannot be seen
        self._loop = loop
        self._stoppers = stoppers
        self._controllers = controllers
        self._journal = records.journal
        self._changed = changed
        self._file = HoldFile(records.folder.hold, records.unusable)
        self._kept: Future[str | None] | None = None
        self._watched: dict[str, Held] = {}
        self._timer: Timer | None = None
        self._silent_until: dict[str, float] = {}

    @property
    def again(self) -> dict[str, int]:
        """How often each drive was enabled by somebody else and stopped again."""
        return {name: held.again for name, held in self._watched.items()}

    @property
    def problem(self) -> str | None:
        """Why the hold will not outlive this gateway, as far as that is known."""
        return self._kept.result() if self._kept is not None and self._kept.done() else None

    def load(self) -> HeldStop | None:
        """What the last gateway held. In the thread that starts the module."""
        return self._file.load()

    def resume(self, left: HeldStop | None) -> None:
        """Hold what the last gateway held, and stop whatever is not seen to be stopped."""
        if left is None or self.held is not None:
            return
        log.warning("the stop of %s is still held: %s", left.who, left.reason)
        details = {"by": left.who, "reason": left.reason, "since_utc_ns": left.utc_ns}
        self._journal.append(GATEWAY, "stop still held", **details)
        for controller in self._controllers.values():
            controller.stop()
        self._watch_over(left)
        self._look_at_all()

    def begin(self, who: str, reason: str) -> "Future[str | None]":
        """Hold; the result is why it will not outlive this gateway, `None` when it will."""
        self.begun += 1
        now = HeldStop(who, reason, time.time_ns(), time.monotonic_ns(), boot_id())
        held = now if self.held is None else msgspec.structs.replace(self.held, who=who, reason=reason)
        self._kept = self._keep(held)
        self._watch_over(held)
        return self._kept

    def end(self) -> "Future[None]":
        """Remove it from the disk; then, in the loop, `forget` it. Fails with `OSError`."""
        return self._file.remove()

    def forget(self) -> None:
        """Watch no more."""
        self._end_watch()
        self.held = self._kept = None
        self._changed()

    def close(self) -> None:
        """End the watch with the process; on disk it stays held."""
        self._end_watch()
        self._file.close()

    def _keep(self, held: HeldStop) -> "Future[str | None]":
        kept: Future[str | None] = Future()

        def tell(written: "Future[None]") -> None:
            error = outcome(written)
            why = (getattr(error, "strerror", None) or str(error)) if isinstance(error, Exception) else None
            problem = None if why is None else f"this stop is held, but not beyond this gateway: {why}"
            details = {} if problem is None else {"problem": problem}
            self._journal.append(held.who, "stop", reason=held.reason, **details)
            kept.set_result(problem)

        self._file.write(held).add_done_callback(tell)
        return kept

    def _watch_over(self, held: HeldStop) -> None:
        before, self.held = self.held, held
        if before is None:
            self._watched = {
                name: Held(stopper, self._loop, self._on_again) for name, stopper in self._stoppers.items()
            }
            self._changed()
            self._timer = self._loop.call_later(WATCH_S, self._look)

    def _look(self) -> None:
        self._timer = self._loop.call_later(WATCH_S, self._look)
        self._look_at_all()

    def _look_at_all(self) -> None:
        for held in self._watched.values():
            held.look(ask_unseen=self.asks_unseen)

    def _on_again(self, name: str) -> None:
        for controller in self._controllers.values():
            controller.stop()
        if time.monotonic() >= self._silent_until.get(name, 0.0):
            self._silent_until[name] = time.monotonic() + SAY_AGAIN_S
            log.warning("%s is enabled while the robot is stopped; it is stopped again", name)
            self._journal.append(GATEWAY, "stopped again", drive=name, times=self._watched[name].again)

    def _end_watch(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        for held in self._watched.values():
            held.close()
        self._watched = {}
