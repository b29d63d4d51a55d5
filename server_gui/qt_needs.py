"""Requirements of the window on this computer, checked before Qt is loaded, which would only crash."""

import ctypes
import importlib.metadata
import os
import sys
from collections.abc import Callable, Mapping, MutableMapping
from typing import Final

# library → Debian's and Ubuntu's package
ALWAYS: Final = {
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libglib-2.0.so.0": "libglib2.0-0",
    "libfontconfig.so.1": "libfontconfig1",
    "libdbus-1.so.3": "libdbus-1-3",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libgssapi_krb5.so.2": "libgssapi-krb5-2",
}
WINDOW: Final = {
    "libxcb-cursor.so.0": "libxcb-cursor0",
    "libxcb-icccm.so.4": "libxcb-icccm4",
    "libxcb-keysyms.so.1": "libxcb-keysyms1",
    "libxcb-shape.so.0": "libxcb-shape0",
    "libxcb-xkb.so.1": "libxcb-xkb1",
    "libxkbcommon-x11.so.0": "libxkbcommon-x11-0",
}
BROKEN: Final = ("6.12.0", (3, 11))  # this Qt on this Python


class NoWindow(Exception):
    """The window cannot be opened here; the text says what to do."""


def check(environment: Mapping[str, str] = os.environ) -> None:
    """Look whether Qt can run.

    Raises:
        NoWindow: it cannot, and why.

    """
    check_version(importlib.metadata.version("PySide6-Essentials"), sys.version_info[:2])
    platform = environment.get("QT_QPA_PLATFORM", "")
    check_display(environment, platform)
    wanted = ALWAYS if platform == "offscreen" else ALWAYS | WINDOW
    check_libraries(wanted, _is_there)


def can_open(environment: MutableMapping[str, str] = os.environ) -> bool:
    """Return whether the window can be opened here; else the terminal is as good a place."""
    prefer_x(environment)
    try:
        check(environment)
    except (NoWindow, importlib.metadata.PackageNotFoundError):
        return False
    return True


def prefer_x(environment: MutableMapping[str, str] = os.environ) -> None:
    """On Wayland, open the window by its X server where it has one.

    STOP keys are then taken in a thread of their own also while the window is busy. Wayland itself tells
    keys to nobody but the window.
    """
    if environment.get("WAYLAND_DISPLAY") and environment.get("DISPLAY"):
        environment.setdefault("QT_QPA_PLATFORM", "xcb;wayland")


def check_version(qt: str, python: tuple[int, int]) -> None:
    """Refuse the one pair of versions that aborts in the middle of work; raises `NoWindow`."""
    if (qt, python) == BROKEN:
        raise NoWindow(
            f"PySide6 {qt} on Python {python[0]}.{python[1]} loses a reference with every call and aborts "
            "after a while. Install another: pip install 'PySide6-Essentials==6.11.3'"
        )


def check_display(environment: Mapping[str, str], platform: str) -> None:
    """Check that there is a display; raises `NoWindow`."""
    if not platform and not (environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")):
        raise NoWindow(
            "there is no display here. On a desk: log in graphically, or ssh -X. Without one: gwrms watch, "
            "gwrms collect, or gwrms demo in a terminal"
        )


def check_libraries(wanted: Mapping[str, str], is_there: Callable[[str], bool]) -> None:
    """Check the system libraries; raises `NoWindow` with the line that installs missing ones."""
    missing = [package for library, package in wanted.items() if not is_there(library)]
    if missing:
        raise NoWindow(
            "system libraries that Qt needs are missing. Run this, then try again:\n"
            f"    sudo apt-get install --yes --no-install-recommends {' '.join(missing)}"
        )


def _is_there(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True
