"""What stands beside the joint table: errors whose words have no room in it; else what its bars mean."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QSizePolicy

from server_gui.views.overview.joint_cells import ANGLE, TORQUE
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text, set_tone
from server_gui.views.widgets.elided import whole_words
from server_gui.views.widgets.plain import PlainLabel, set_tip

WRAPPED: Final = Qt.TextFlag.TextWordWrap.value
# By the columns with bars that are shown; the fullest wording first.
BARS: Final = {
    frozenset({ANGLE, TORQUE}): (
        "Bars: error to target (full: 10°); torque as share of its limit",
        "Bars: error to target; torque as share of its limit",
        "Bars: error to target; share of limit",
    ),
    frozenset({ANGLE}): ("Bars: error to target (full: 10°)", "Bars: error to target"),
    frozenset({TORQUE}): ("Bars: torque as share of its limit", "Bars: share of limit"),
    frozenset(): ("",),
}


class JointWords(PlainLabel):
    """As high as its `lines`: what is wrong moves nothing around."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._errors: Sequence[tuple[str, str]] = ()
        self._tone = "bad"
        self._bars: frozenset[int] = frozenset()
        self._lines = 1
        self.setAccessibleName("Problems of joints")
        self.setWordWrap(True)
        self.setObjectName("dim")
        self.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self._fit)
        self._fit()

    def say(self, errors: Sequence[tuple[str, str]], bars: frozenset[int], tone: str = "bad") -> None:
        """Say what is wrong, by joints, in the order of the table; else what the bars of columns mean.

        `tone` is how bad the worst is.
        """
        if (list(errors), bars, tone) != (list(self._errors), self._bars, self._tone):
            self._errors, self._bars, self._tone = errors, bars, tone
            self._fit()

    def be_high(self, lines: int) -> None:
        """Have room for so many lines; never told while it is laid out, which would be too late."""
        self._lines = lines
        self._fit()

    def sizeHint(self) -> QSize:
        return QSize(1, self._high)

    def minimumSizeHint(self) -> QSize:
        return QSize(1, self._high)

    def hasHeightForWidth(self) -> bool:
        return False

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    @property
    def _high(self) -> int:
        return self._lines * self.fontMetrics().lineSpacing()

    def _fit(self) -> None:
        """Say as much as has room: the first whole, and how many more there are."""
        said = wordings(self._errors)
        texts = said or BARS[self._bars]
        fits = (text for text in texts if self._has_room(text))
        last = whole_words(texts[-1], self.fontMetrics(), self.width())
        set_text(self, next(fits, last))
        set_tone(self, self._tone if said else "")
        set_tip(self, texts[0])
        if self.height() != self._high:
            self.setFixedHeight(self._high)

    def _has_room(self, text: str) -> bool:
        box = QRect(0, 0, max(self.width(), 1), 100_000)
        found = self.fontMetrics().boundingRect(box, WRAPPED, text)
        return found.height() <= self._high and found.width() <= self.width()


def wordings(errors: Sequence[tuple[str, str]]) -> tuple[str, ...]:
    """Return what is wrong with which joints in words, the fullest first: alike errors are said once."""
    alike: dict[str, list[str]] = {}
    for joint, error in errors:
        alike.setdefault(error, []).append(joint)
    said = [f"{', '.join(joints)}: {error}" for error, joints in alike.items()]
    joints = [len(one) for one in alike.values()]
    more = [f" · {sum(joints[count:])} more" if count < len(said) else "" for count in range(len(said) + 1)]
    fuller = [f"{' · '.join(said[:count])}{more[count]}" for count in range(len(said), 0, -1)]
    brief = [f"{error}{more[1]}" for error in list(alike)[:1]]  # whose it is stands in the table
    return (*fuller, *brief)
