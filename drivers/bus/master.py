"""Periodic messages of a master: SYNC and its own heartbeat, each at its own period (CiA 301 §7.2.5)."""

from collections.abc import Iterator

from drivers.bus.cycles import Cycle, Cycles, Send
from drivers.bus.nmt import HEARTBEAT, NmtState
from drivers.bus.settings import CanSettings

NMT_COMMAND, SYNC = 0x000, 0x080
NMT_START, NMT_STOP = 0x01, 0x02


class MasterCycles(Cycles):
    """The frames that `[can.NAME]` asks for."""

    def __init__(self, name: str, settings: CanSettings, send: Send) -> None:
        super().__init__(f"can {name} master", list(_cycles(settings)), send)


def _cycles(settings: CanSettings) -> Iterator[Cycle]:
    if settings.sync_period_s is not None:
        yield Cycle(SYNC, b"", settings.sync_period_s)
    if settings.heartbeat_s is not None and settings.node_id is not None:
        state = bytes([NmtState.OPERATIONAL])
        yield Cycle(HEARTBEAT + settings.node_id, state, settings.heartbeat_s)
