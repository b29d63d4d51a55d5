"""All PDOs of a device, made from its dictionary and made anew when that changes (CiA 301 §7.5.2.35)."""

from collections.abc import Callable

from hil_sim.clock import MILLISECOND_NS, Clock, Repeating
from hil_sim.node import pdo
from hil_sim.node.dictionary import Dictionary, Key
from hil_sim.node.pdo import Rpdo, Tpdo
from hil_sim.node.pdo_guard import PdoGuard

_COUNT = 0x200  # PDOs of each direction that a device can have
_CHECK_NS = 5 * MILLISECOND_NS  # how often event-driven PDOs look whether something has changed

Report = Callable[[int, int, bool], None]


class Pdos:
    """The PDOs of a device.

    `send` sends one; `report` is told an RPDO's number, an error code and whether that error is there;
    `moved` is told when other identifiers count.
    """

    def __init__(
        self,
        clock: Clock,
        dictionary: Dictionary,
        send: Callable[[int, bytes], None],
        report: Report,
        moved: Callable[[], None],
    ) -> None:
        self._clock = clock
        self._dictionary = dictionary
        self._send = send
        self._report = report
        self._moved = moved
        self._running = False
        self._checking: Repeating | None = None
        self._tpdos: dict[int, Tpdo] = {}
        self._rpdos: dict[int, Rpdo] = {}
        self.watched: frozenset[Key] = frozenset()  # the objects of which a change is an event now
        self.sent: list[Tpdo] = []  # those that are active
        self.received: list[Rpdo] = []
        for number in self._numbers(pdo.TPDO_COMMUNICATION):
            self._guard(pdo.TPDO_COMMUNICATION, pdo.TPDO_MAPPING, number, self._load_tpdo)
        for number in self._numbers(pdo.RPDO_COMMUNICATION):
            self._guard(pdo.RPDO_COMMUNICATION, pdo.RPDO_MAPPING, number, self._load_rpdo)

    def load(self) -> None:
        """Make all PDOs as the dictionary says."""
        self.stop()
        for number in self._numbers(pdo.TPDO_COMMUNICATION):
            self._load_tpdo(number)
        for number in self._numbers(pdo.RPDO_COMMUNICATION):
            self._load_rpdo(number)

    def start(self) -> None:
        """Begin in operational."""
        self._running = True
        for tpdo in self._tpdos.values():
            tpdo.start()
        self._check_changes()

    def stop(self) -> None:
        self._running = False
        self._check_changes()
        for tpdo in self._tpdos.values():
            tpdo.stop()
        for rpdo in self._rpdos.values():
            rpdo.stop()

    def take(self) -> None:
        """Take a SYNC: received PDOs take effect."""
        for rpdo in self.received:
            rpdo.synchronise()

    def synchronise(self, counter: int | None) -> None:
        """Take a SYNC: sample the PDOs to send."""
        for tpdo in self.sent:
            tpdo.synchronise(counter)

    def changed(self, key: Key) -> None:
        """Take a change reported by the application."""
        if self._running:
            for tpdo in self.sent:
                tpdo.changed(key)

    # -- made from the dictionary ------------------------------------------------------------------------

    def _numbers(self, first: int) -> list[int]:
        return [index - first for index in self._dictionary.indices(first, first + _COUNT - 1)]

    def _guard(self, communication: int, mapping: int, number: int, load: Callable[[int], None]) -> None:
        def changed() -> None:
            load(number)
            self._moved()

        received = communication == pdo.RPDO_COMMUNICATION
        PdoGuard(self._dictionary, communication + number, mapping + number, received).install(changed)

    def _load_tpdo(self, number: int) -> None:
        before = self._tpdos.get(number)
        tpdo = self._tpdos[number] = Tpdo(self._clock, self._dictionary, number, self._send)
        self.sent = [one for one in self._tpdos.values() if one.active]
        if before is not None:
            before.stop()
        if self._running and before is not None and before.active:
            tpdo.resume()
        elif self._running:
            tpdo.start()
        self._check_changes()

    def _load_rpdo(self, number: int) -> None:
        before = self._rpdos.get(number)
        rpdo = self._rpdos[number] = Rpdo(
            self._clock,
            self._dictionary,
            number,
            lambda code, present: self._report(number, code, present),
        )
        if before is not None:
            before.stop()
            rpdo.wrong = before.wrong
        self.received = [one for one in self._rpdos.values() if one.active]

    def _check_changes(self) -> None:
        on_change = [tpdo for tpdo in self.sent if tpdo.on_change and self._running]
        self.watched = frozenset(key for tpdo in on_change for key in tpdo.keys)
        wanted = bool(on_change)
        if wanted and self._checking is None:
            self._checking = self._clock.every(_CHECK_NS, self._check)
        elif not wanted and self._checking is not None:
            self._checking.cancel()
            self._checking = None

    def _check(self) -> None:
        for tpdo in self.sent:
            tpdo.check()
