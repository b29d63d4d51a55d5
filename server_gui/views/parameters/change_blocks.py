"""Changes below each other, in lines that wrap: where a table of them would have to leave something out."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QScrollArea

from server_gui.core.tuning.edits import ReviewedEdit, spoken
from server_gui.views.parameters.tree import range_text
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.plain import rich
from server_gui.views.widgets.wrapping_label import WrappingHeight

BREAK: Final = "&#8203;"  # where a long name may go on in the next line
REFUSED, ELSEWHERE = "✕ refused", "⚠ changed elsewhere"
LEAST: Final = 66  # high, at text of 100 %


def mark_of(change: ReviewedEdit) -> str:
    """Return what has to be known before it is written."""
    return REFUSED if change.problem else ELSEWHERE if change.elsewhere else ""


def lines_of(change: ReviewedEdit) -> tuple[str, str, str]:
    """Return its name, old and new value, how far that goes within what limits, and its id."""
    old = "–" if change.old is None else change.unit.editable(change.old)
    step = f"change {change.by}" if change.by else ""
    allowed = f"allowed {range_text(*change.allowed, change.unit)} {change.unit.symbol}".strip()
    return (
        spoken(change.name),
        f"{old} → {change.unit.editable(change.new)} {change.unit.symbol}".strip(),
        " · ".join(filter(None, (step, allowed, change.name))),
    )


class ChangeBlocks(QScrollArea):
    """Nothing of a change is left out, however narrow it is; it has the keyboard, which scrolls it."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.label = WrappingHeight()
        self.label.wrap()
        self.label.setTextFormat(Qt.TextFormat.RichText)
        self.label.setAlignment(Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignLeft)
        self.label.setContentsMargins(8, 4, 8, 4)
        self.setWidget(self.label)
        self.setWidgetResizable(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Changes to be written")

    def show_changes(self, changes: Sequence[ReviewedEdit]) -> None:
        """Show these."""
        set_text(self.label, "".join(map(self._block, changes)))
        said = ("; ".join((*lines_of(change), mark_of(change))) for change in changes)
        self.setAccessibleDescription(". ".join(said))

    def sizeHint(self) -> QSize:
        """Return no more than it needs, so that it is scrolled rather than what is around it."""
        return self.minimumSizeHint()

    def minimumSizeHint(self) -> QSize:
        return QSize(self._theme.px(100), self._theme.px(LEAST))

    def _block(self, change: ReviewedEdit) -> str:
        name, values, limits = map(rich, lines_of(change))
        for sign in "._":
            limits = limits.replace(sign, f"{sign}{BREAK}")
        bad, dim = (self._theme.colour(one).name() for one in ("bad", "dim"))
        mark = rich(mark_of(change))
        marked = f' &nbsp;<span style="color:{bad}">{mark}</span>' if mark else ""
        return (
            f"<p style='margin:0 0 7px 0'>{name}{marked}<br><b>{values}</b>"
            f"<br><span style='color:{dim}'>{limits}</span></p>"
        )
