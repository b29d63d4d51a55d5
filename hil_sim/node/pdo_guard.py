"""Rules for changes of a PDO by an SDO client (CiA 301 §7.5.2.35 to §7.5.2.38).

COB-ID, inhibit time and mapping change while the PDO is not valid, mapped objects while their number is 0.
"""

from collections.abc import Callable
from dataclasses import dataclass

from hil_sim.node import cob_id, pdo
from hil_sim.node.abort import AbortCode, SdoAbort
from hil_sim.node.dictionary import Dictionary, Value
from hil_sim.node.pdo_mapping import Field, Mapping

_SENT_TYPES = (*pdo.SYNCHRONOUS, pdo.SYNCHRONOUS_REMOTE, pdo.REMOTE, *pdo.EVENT_DRIVEN)
_RECEIVED_TYPES = (*pdo.SYNCHRONOUS, *pdo.EVENT_DRIVEN)

Check = Callable[[Value], None]


@dataclass(frozen=True, slots=True)
class PdoGuard:
    """Stands before the communication and the mapping object of one PDO; `received` for an RPDO."""

    dictionary: Dictionary
    communication: int
    mapping: int
    received: bool

    def install(self, changed: Callable[[], None]) -> None:
        """Refuse what may not be, and call `changed` after the rest."""
        by_subindex: dict[int, Check] = {
            pdo.TRANSMISSION_TYPE: self._check_type,
            pdo.INHIBIT_TIME: self._check_invalid,
            pdo.SYNC_START: self._check_invalid,
        }
        for entry in self.dictionary.members(self.communication)[1:]:
            is_cob_id = entry.key[1] == pdo.COB_ID
            entry.on_write = cob_id.guard(entry) if is_cob_id else by_subindex.get(entry.key[1])
            entry.on_written = changed
        for entry in self.dictionary.members(self.mapping):
            entry.on_write = self._check_object if entry.key[1] else self._check_count
            entry.on_written = changed

    def _check_type(self, value: Value) -> None:
        if value not in (_RECEIVED_TYPES if self.received else _SENT_TYPES):
            raise SdoAbort(AbortCode.INVALID_VALUE)

    def _check_invalid(self, _value: Value) -> None:
        if cob_id.is_valid(self.dictionary.number((self.communication, pdo.COB_ID), cob_id.INVALID)):
            raise SdoAbort(AbortCode.WRONG_STATE)

    def _check_object(self, value: Value) -> None:
        self._check_invalid(value)
        if self.dictionary.number((self.mapping, 0)):
            raise SdoAbort(AbortCode.UNSUPPORTED_ACCESS)
        if value:
            Field.of(self.dictionary, int(value)).check(self.dictionary, self.received)

    def _check_count(self, value: Value) -> None:
        self._check_invalid(value)
        for field in Mapping.read(self.dictionary, self.mapping, int(value)).fields:
            field.check(self.dictionary, self.received)
