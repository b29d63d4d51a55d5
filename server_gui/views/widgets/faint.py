"""Colours that stand back and are seen all the same, by the contrast of WCAG 2.2."""

import math
from typing import Final

from PySide6.QtGui import QColor

SEEN: Final = 3.2  # contrast of the faintest line: WCAG 2.2 asks of what is not text for 3


def faint(colour: QColor, behind: QColor) -> QColor:
    """Return the faintest mixture of both that has `SEEN` : 1 against what is behind it."""
    shares = (share / 20 for share in range(6, 20))
    mixed = (_mixed(colour, behind, share) for share in shares)
    return next((one for one in mixed if contrast(one, behind) >= SEEN), colour)


def _mixed(colour: QColor, behind: QColor, share: float) -> QColor:
    pairs = zip(_parts(colour), _parts(behind), strict=True)
    return QColor(*(round(share * one + (1 - share) * other) for one, other in pairs))


def contrast(one: QColor, other: QColor) -> float:
    """Return the contrast of two colours, by WCAG 2.2."""
    light, dark = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def _luminance(colour: QColor) -> float:
    parts = (part / 255 for part in _parts(colour))
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else math.pow((part + 0.055) / 1.055, 2.4) for part in parts
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def _parts(colour: QColor) -> tuple[int, int, int]:
    return colour.red(), colour.green(), colour.blue()
