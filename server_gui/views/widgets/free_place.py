"""The place for something that lies over a window: beside what must stay in sight."""

from collections.abc import Iterable, Sequence
from typing import Final

from PySide6.QtCore import QPoint, QRect, QSize

Rects = Sequence[QRect]
KEPT: Final = "kept in sight"  # a property of what no question lies over where there is room elsewhere


def free_place(sizes: Sequence[QSize], room: QRect, kept: Sequence[Rects]) -> QRect:
    """Return where in the room, all in pixels, something of one of these sizes covers the least.

    Whatever it costs those after it, the first of `kept` are covered least; where several places cover as
    little, it has the first of the sizes, is as low as it can be, and near to the middle.
    """

    def cost(place: QRect) -> tuple[int, ...]:
        covered = (sum(_area(place & one) for one in rects) for rects in kept)
        aside = abs(place.center().x() - room.center().x())
        return *covered, sizes.index(place.size()), -place.y(), aside

    rects = [one for rects in kept for one in rects]
    return min((place for size in sizes for place in _places(size, room, rects)), key=cost)


def _places(size: QSize, room: QRect, rects: Rects) -> Iterable[QRect]:
    """Yield each place beside any of these, and the middle of the lower edge."""
    last = QPoint(room.right() + 1 - size.width(), room.bottom() + 1 - size.height())
    across = [room.center().x() - size.width() // 2, room.left(), last.x()]
    across += [x for one in rects for x in (one.left() - size.width(), one.right() + 1)]
    down = [last.y(), *(y for one in rects for y in (one.top() - size.height(), one.bottom() + 1))]
    for x in _within(across, room.left(), last.x()):
        for y in _within(down, room.top(), last.y()):
            yield QRect(QPoint(x, y), size)


def _area(rect: QRect) -> int:
    return rect.width() * rect.height() if rect.isValid() else 0


def _within(found: Iterable[int], first: int, last: int) -> list[int]:
    """Return each once, the nearest place within where it is out of the room."""
    return sorted({max(min(one, last), first) for one in found})
