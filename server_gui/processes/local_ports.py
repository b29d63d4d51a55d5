"""The names of this computer's CAN interfaces and serial ports."""

from pathlib import Path
from typing import Final

NETWORK: Final = Path("/sys/class/net")
SERIAL: Final = Path("/dev/serial/by-id")
CAN: Final = "280"  # ARPHRD_CAN of linux/if_arp.h


def can_interfaces(network: Path = NETWORK) -> list[str]:
    """SocketCAN's, in their order; none where this system has none."""
    return sorted(one.parent.name for one in network.glob("*/type") if _content(one) == CAN)


def serial_ports(folder: Path = SERIAL) -> list[str]:
    """Return those that keep their name wherever they are plugged in."""
    return sorted(map(str, folder.glob("*")))


def _content(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:  # it was just unplugged
        return ""
