"""Messages to a service manager (sd_notify(3)): that the gateway serves, and is alive."""

import contextlib
import os
import socket
from collections.abc import Mapping


def tell(state: str, environ: Mapping[str, str] = os.environ) -> None:
    """Send a state such as `READY=1`; nothing where nobody manages us, or does not listen."""
    name = environ.get("NOTIFY_SOCKET", "")
    if name.startswith(("/", "@")):
        address = f"\0{name[1:]}" if name[0] == "@" else name
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager, contextlib.suppress(OSError):
            manager.sendto(state.encode(), address)


def watchdog_s(environ: Mapping[str, str] = os.environ) -> float | None:
    """Return systemd's watchdog period (sd_watchdog_enabled(3)), `None` if there is no watchdog."""
    period_us, process = environ.get("WATCHDOG_USEC", ""), environ.get("WATCHDOG_PID", str(os.getpid()))
    if not period_us.isdecimal() or not int(period_us) or process != str(os.getpid()):
        return None
    return int(period_us) / 1e6
