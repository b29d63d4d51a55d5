"""The saved state of a window, and which of it can be used: files are edited, damaged and old."""

import hashlib
import math
from collections.abc import Mapping
from typing import Final

from PySide6.QtCore import QByteArray, QSettings

from gateway.units import Units
from server_gui.views.theme import Look

PERCENT: Final = 100


def keep_bytes(settings: QSettings, name: str, kept: QByteArray) -> None:
    """Keep what Qt has saved of a window, with its sum: `kept_bytes` gives it back."""
    settings.setValue(name, kept)
    settings.setValue(f"{name}_sha256", sha256(kept))


def kept_bytes(settings: QSettings, name: str) -> QByteArray | None:
    """Return it as it was kept, None where a byte of it is another.

    One bit that has flipped in them is enough for Qt to crash (QMainWindow::restoreState, Qt 6.11).
    """
    kept = settings.value(name)
    if not isinstance(kept, QByteArray) or settings.value(f"{name}_sha256") != sha256(kept):
        return None
    return kept


def sha256(kept: QByteArray) -> str:
    """Return the sum of these bytes."""
    return hashlib.sha256(bytes(kept.data())).hexdigest()


def kept_look(settings: QSettings) -> Look:
    """Return the palette; dark where there is none, or one of another version."""
    known = {look.value: look for look in Look}
    return known.get(str(settings.value("look")), Look.DARK)


def kept_scale(settings: QSettings) -> float:
    """Return the size of all text; the usual where it is no number."""
    try:
        scale = float(str(settings.value("scale", PERCENT))) / PERCENT
    except ValueError:
        return 1.0
    return scale if math.isfinite(scale) else 1.0


def kept_units(settings: QSettings) -> Units:
    """Return the units that were chosen, without those that this version does not know."""
    by_si = settings.value("units")
    wanted = by_si if isinstance(by_si, Mapping) else {}
    known = {
        str(si): str(symbol)
        for si, symbol in wanted.items()
        if str(symbol) in {unit.symbol for unit in Units().choices(str(si))}
    }
    return Units(by_si=known)
