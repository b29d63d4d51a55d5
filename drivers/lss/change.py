"""Giving a device a node id or a bit rate, and finding out whether it has it; put back if it cannot store."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from drivers.bus.master import NMT_COMMAND
from drivers.bus.nmt import HEARTBEAT, NmtState, parse_heartbeat
from drivers.errors import DeviceTimeout, DriverError, LssRefusal, Mismatch
from drivers.lss.master import BITRATES, UNCONFIGURED, Bus, Identity, LssMaster

NMT_RESET_COMMUNICATION = 0x82
BOOT_S = 10.0


@dataclass(frozen=True, slots=True)
class Device:
    """A device's own identity."""

    identity: Identity
    node_id: int  # now; 255: none

    @property
    def configured(self) -> bool:
        return self.node_id != UNCONFIGURED


def inquire(master: LssMaster, identity: Identity | None) -> Device:
    """Ask a device who it is; `None`: the only one on the bus. Raises `DriverError`."""
    with _selected(master, identity):
        return Device(master.identity(), master.node_id())


def give_node_id(bus: Bus, master: LssMaster, device: Device, node_id: int, *, store: bool) -> Device:
    """Let the device have `node_id` from now on: configured, stored, booted with, and asked for again.

    Raises:
        LssRefusal: it cannot have that id, or cannot store; it has what it had before.
        DeviceTimeout: it has fallen silent on the way: what was sent so far is told.
        Mismatch: it says that it has another one.

    """
    booted = threading.Event()
    handler = _noting(booted)
    bus.subscribe(HEARTBEAT + node_id, handler)
    try:
        with _selected(master, device.identity):
            master.set_node_id(node_id)
            if store:
                _store(master, lambda: master.set_node_id(device.node_id))
        if node_id != device.node_id:
            if device.configured:
                bus.send(NMT_COMMAND, bytes([NMT_RESET_COMMUNICATION, device.node_id]))
            if not booted.wait(BOOT_S):
                raise DeviceTimeout(
                    f"{bus.name}: the device took node id {node_id}{', stored it' if store else ''} and did "
                    f"not boot with it within {BOOT_S:g} s: switch it off and on, then `gwrms scan`"
                )
    finally:
        bus.unsubscribe(HEARTBEAT + node_id, handler)
    found = inquire(master, device.identity)
    if found.node_id != node_id:
        raise Mismatch(f"{bus.name}: the device was given node id {node_id} and says {found.node_id}")
    return found


def give_bitrate(
    master: LssMaster, device: Device, bitrate: int, before: int | None, delay_ms: int | None = None
) -> None:
    """Let the device have `bitrate` (bit/s) when it is switched on the next time; raises `DriverError`.

    Until then it is needed at the one it has, which is `before` where that is known. With a delay it is also
    activated: after that time it listens at the new rate alone, and after another one it may answer.
    """

    def put_back() -> None:
        if before not in BITRATES:
            raise DriverError("the rate of this bus is not known here, --bitrate of the interface tells it")
        master.set_bitrate(before)

    with _selected(master, device.identity):
        master.set_bitrate(bitrate)
        _store(master, put_back)
    if delay_ms is not None:
        master.select(device.identity)
        master.activate(delay_ms)  # and nothing more at this rate: nobody would acknowledge it


def _store(master: LssMaster, put_back: Callable[[], object]) -> None:
    try:
        master.store()
    except LssRefusal as error:
        try:
            put_back()
        except DriverError as second:
            raise LssRefusal(
                f"{error}. Putting back what it had failed too ({second}): switch it off and on",
                error.error_code,
                error.specific,
            ) from error
        raise LssRefusal(
            f"{error}; it was put back to what it had. --no-store changes it until it is switched off",
            error.error_code,
            error.specific,
        ) from error


@contextmanager
def _selected(master: LssMaster, identity: Identity | None) -> Iterator[None]:
    """Configure the device within the block; nobody is left in configuration, whatever happens."""
    master.release()  # whoever somebody else has left so
    try:
        if identity is None:
            master.select_all()
        else:
            master.select(identity)
        yield
    except BaseException:
        with suppress(DriverError):  # what comes first is told
            master.release()
        raise
    master.release()


def _noting(booted: threading.Event) -> Callable[[int, bytes], None]:
    def note(_stamp_ns: int, data: bytes) -> None:
        if parse_heartbeat(data) is NmtState.BOOT_UP:
            booted.set()

    return note
