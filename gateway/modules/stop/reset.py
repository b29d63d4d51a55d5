"""Reset: leads every drive to SWITCH ON DISABLED, never further, and ends the hold where none can move."""

from collections.abc import Mapping
from concurrent.futures import Future

import msgspec

from drivers.joint.cia402 import DriveState
from drivers.joint.leading import Led
from gateway.futures import back, done, failed, gather, then
from gateway.loop import Loop
from gateway.messages import Reset
from gateway.modules.stop.drive import Drive
from gateway.modules.stop.hold import GATEWAY, Hold
from gateway.modules.stop.target import Target, stop_all
from gateway.records.journal import Journal
from gateway.wire import Kind, refuse

# States in which a drive has no current; only what is known to be in one of them lets a hold end.
AT_REST = frozenset({DriveState.SWITCH_ON_DISABLED, DriveState.FAULT})

Found = Mapping[str, Led | Exception]


class Resetter:
    """One robot's resets, one at a time. It belongs to the loop's thread."""

    def __init__(
        self,
        loop: Loop,
        drives: Mapping[str, Drive],
        absent: Mapping[str, str],
        controllers: Mapping[str, Target],
        hold: Hold,
        journal: Journal,
    ) -> None:
        self._loop = loop
        self._drives = drives
        self._absent = absent  # joints that could not be built, and why
        self._controllers = controllers
        self._hold = hold
        self._journal = journal

    def reset(self, who: str) -> "Future[Reset]":
        """Lead all drives down at once; the hold stays unless each is known to have no current.

        Raises:
            RpcError: as the future's error (unavailable): the drives are down, the hold cannot be removed.

        """
        begun = self._hold.begun
        self._hold.asks_unseen = False  # or it would overtake the reset of a drive that only SDO shows
        quiet = back(self._loop, gather(stop_all(self._controllers)))  # nobody shall command against it
        descents = then(quiet, lambda _reports: back(self._loop, gather(self._descents())))
        return then(descents, lambda found: self._end(who, begun, found))

    def _descents(self) -> "dict[str, Future[Led]]":
        return {name: _begin(drive) for name, drive in self._drives.items()}

    def _end(self, who: str, begun: int, found: Found) -> "Future[Reset]":
        self._hold.asks_unseen = True
        led = {name: as_led(one) for name, one in found.items()}
        led |= {name: Led(None, why) for name, why in self._absent.items()}
        drives = {name: state_words(one.state) for name, one in led.items()}
        problems = {name: one.problem for name, one in led.items() if one.problem is not None}
        at_rest = all(one.state in AT_REST for one in led.values())
        held = self._hold.held is not None
        reset = Reset(drives, problems, held=held)
        if not (held and at_rest and begun == self._hold.begun):
            return done(self._told(who, reset))
        # Off the disk first: a hold that would come back with the next gateway has not ended.
        removed = gather({"hold": back(self._loop, self._hold.end())})
        return then(removed, lambda got: self._told(who, self._end_hold(reset, begun, got["hold"])))

    def _end_hold(self, reset: Reset, begun: int, failure: Exception | None) -> Reset:
        if failure is not None:
            text = (
                f"every drive is disabled, but the stop stays held: its record cannot be removed: {failure}"
            )
            self._journal.append(GATEWAY, "hold not ended", reason=text)
            raise refuse(Kind.UNAVAILABLE, text)
        if begun != self._hold.begun:
            return reset  # a stop came in between
        self._hold.forget()
        return msgspec.structs.replace(reset, held=False)

    def _told(self, who: str, reset: Reset) -> Reset:
        problems = {"problems": reset.problems} if reset.problems else {}
        self._journal.append(who, "reset", result=reset.drives, held=reset.held, **problems)
        return reset


def _begin(drive: Drive) -> "Future[Led]":
    try:
        return drive.reset()
    except Exception as error:  # noqa: BLE001 - it is this drive's alone
        return failed(error)


def as_led(found: Led | Exception) -> Led:
    return found if isinstance(found, Led) else Led(None, str(found))


def state_words(state: DriveState | None) -> str:
    return "unknown" if state is None else state.words
