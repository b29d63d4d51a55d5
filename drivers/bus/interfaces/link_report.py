"""Problems of a SocketCAN link, in words and with the exact line that repairs it."""

import socket

from drivers.bus.interfaces.netlink import NetworkInterface

RESTART_MS = 100  # suggested: how long after bus off the controller tries again
USUAL_BITRATE = 1_000_000


def missing_link(name: str) -> str:
    """Return the words for an interface that is not there."""
    here = [known for _, known in socket.if_nameindex() if "can" in known]
    present = f"CAN interfaces here: {', '.join(here)}" if here else "there is no CAN interface here"
    return f"there is no interface {name}; {present}: plug the adapter in, or load its driver"


def blocking_problem(name: str, link: NetworkInterface, bitrate: int | None) -> str | None:
    """Return why no frame can pass at all; `None` when frames can."""
    if not link.up:
        return f"{name} is down; run: {_up_line(name, link, bitrate)}"
    return None


def warning(name: str, link: NetworkInterface, bitrate: int | None) -> str | None:
    """Return deviations from the robot's file, and likely trouble; `None` if all is well."""
    if link.bitrate is not None and bitrate is not None and link.bitrate != bitrate:
        return (
            f"{name} runs at {link.bitrate} bit/s, the robot's file says {bitrate}; "
            f"run: sudo ip link set {name} down && {_up_line(name, link, bitrate)}"
        )
    if link.kind == "can" and link.restart_ms == 0:
        return (
            f"{name} stays off after bus off (restart-ms 0); "
            f"run: sudo ip link set {name} down && {_up_line(name, link, bitrate)}"
        )
    return None


def _up_line(name: str, link: NetworkInterface, bitrate: int | None) -> str:
    if link.kind != "can":
        return f"sudo ip link set {name} up"
    rate = bitrate or link.bitrate or USUAL_BITRATE
    return f"sudo ip link set {name} up type can bitrate {rate} restart-ms {RESTART_MS}"
