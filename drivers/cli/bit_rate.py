"""A device's other bit rate: where it can be activated at once, how it is followed, else what to run."""

import threading
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager

from msgspec.structs import replace

from drivers.bus.bus import CanBus
from drivers.bus.settings import CanSettings
from drivers.errors import DeviceTimeout, NotPermitted
from drivers.lss.change import Device, inquire
from drivers.lss.master import LssMaster
from drivers.scan.scan import await_open

SWITCH_MS = 500  # CiA 305's switch delay: until the rate changes, and again until anybody may send
# Interfaces whose bit rate is the kernel's, a server's, or none at all.
RATELESS = ("socketcan", "socketcand", "virtual", "udp_multicast")


@contextmanager
def opened(name: str, settings: CanSettings) -> Iterator[CanBus]:
    """Return the bus, open; raises `Unavailable`."""
    bus = CanBus(name, settings)
    bus.start()
    try:
        await_open(bus, threading.Event().wait)
        yield bus
    finally:
        bus.stop()


def check(name: str, settings: CanSettings, bitrate: int, others: Collection[int]) -> None:
    """Raise `NotPermitted` where the bus could not follow, or `others` on it would be left behind."""
    after = next_steps(settings, bitrate)
    if settings.interface in RATELESS or settings.bitrate is None:
        raise NotPermitted(
            f"{name}: the bit rate of this interface is not set from here; without --activate it is stored. "
            f"{after}"
        )
    if others:
        nodes = ", ".join(map(str, sorted(others)))
        raise NotPermitted(
            f"{name}: node {nodes} would stay at the other rate, and no frame would be whole: store it in "
            f"each, without --activate. {after}"
        )


def next_steps(settings: CanSettings, bitrate: int) -> str:
    """Return the steps after a stored bit rate, in words."""
    line = f"sudo ip link set {settings.channel} down, then up type can bitrate {bitrate} restart-ms 100"
    how = f" ({line})" if settings.interface == "socketcan" else ""
    return f"Switch it off, set the bus and all who are on it to that rate{how}, and switch it on"


def look_again(
    name: str, settings: CanSettings, bitrate: int, device: Device, wait: Callable[[float], object]
) -> Device:
    """Follow a device to its new bit rate; raises `DeviceTimeout` where it is not there."""
    wait(2 * SWITCH_MS / 1000)
    with opened(name, replace(settings, bitrate=bitrate)) as bus, LssMaster(bus) as master:
        try:
            return inquire(master, device.identity)
        except DeviceTimeout as error:
            raise DeviceTimeout(
                f"{name}: it was told to change to {bitrate} bit/s, and does not answer there: switch it off "
                f"and on, and look for it by --bitrate {bitrate}"
            ) from error
