"""What was learned from the wearer: offered with what it is worth, and taken back with one click."""

from typing import Final

from PySide6.QtWidgets import QHBoxLayout, QPushButton, QSizePolicy, QVBoxLayout, QWidget

from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.prediction.adaptation import AdaptationState, Adapting, Happening
from server_gui.views.marks import Mark
from server_gui.views.predictions import LEARNED
from server_gui.views.theme import Theme
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.shrinking_label import ShrinkingLabel

WORDS: Final = {
    Happening.ACCEPT: ("Use it", "Use it on this robot, for this wearer and recording only"),
    Happening.DECLINE: ("No", "Keep the general model; the adapted one is deleted"),
    Happening.TAKE_BACK: ("Take back", "Return to the general model; the adapted one is deleted"),
    Happening.AGAIN: ("Learn again", "Learn again from a minute of steps"),
}


class LearnedOffer(QWidget):
    """Shown while there is something to decide; what is clicked is about what is shown, and nothing later."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        super().__init__()
        self._desk = desk
        self._shown: tuple[Station, Adapting] | None = None
        self.setAccessibleName("What was learned from the wearer")
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        self._icon, self.words = MarkIcon(theme, 10), ShrinkingLabel()
        self.buttons = {what: QPushButton(text) for what, (text, _) in WORDS.items()}
        self.buttons[Happening.ACCEPT].setObjectName("primary")
        line, row = QHBoxLayout(), QHBoxLayout()
        line.setSpacing(6)
        line.addWidget(self._icon)
        line.addWidget(self.words, 1)
        row.addStretch(1)
        for what in (Happening.DECLINE, Happening.TAKE_BACK, Happening.AGAIN, Happening.ACCEPT):
            self.buttons[what].clicked.connect(lambda _=False, what=what: self._say(what))
            set_tip(self.buttons[what], WORDS[what][1])
            row.addWidget(self.buttons[what])
        both = QVBoxLayout(self)
        both.setContentsMargins(0, 2, 0, 0)
        both.setSpacing(2)
        both.addLayout(line)
        both.addLayout(row)
        self.hide()

    def refresh(self, station: Station) -> None:
        """Show how it is now."""
        adapting = station.predictions.adapting
        if adapting is None or not adapting.choices:
            self._shown = None
            self.hide()
            return
        if self._shown == (station, adapting):
            return
        self._shown = station, adapting
        self._icon.show_mark(Mark(*LEARNED[adapting.state]))
        self.words.say(*wordings(adapting))
        self.setAccessibleDescription(adapting.text)
        set_tip(self, adapting.tip)
        for what, button in self.buttons.items():
            button.setVisible(what in adapting.choices)
        self.show()

    def _say(self, what: Happening) -> None:
        if self._shown is not None:
            station, adapting = self._shown
            self._desk.adapt(station.name, adapting.number, what)


def wordings(adapting: Adapting) -> tuple[str, ...]:
    """Return what there is to say, the fullest first. Each says how it stands: figures alone look better."""
    tried = "" if adapting.tried is None else adapting.tried.text
    of = {
        AdaptationState.OFFERED: (f"Learned from {adapting.wearer}", "Learned", ""),
        AdaptationState.SERVING: (
            f"Served by what was learned from {adapting.wearer}",
            "Learned, serves",
            "Serves",
        ),
        AdaptationState.NO_BETTER: ("No better than the general model", "No better"),
        AdaptationState.DECLINED: ("Declined: the general model serves", "Declined"),
        AdaptationState.TAKEN_BACK: ("Taken back: the general model serves", "Taken back"),
        AdaptationState.FAILED: (f"Not learned from {adapting.wearer}", "Not learned"),
    }.get(adapting.state, ())
    told = (
        tried
        if adapting.state in (AdaptationState.OFFERED, AdaptationState.SERVING, AdaptationState.NO_BETTER)
        else ""
    )
    short = [": ".join(filter(None, (words, told))) for words in of]
    text = adapting.text[:1].upper() + adapting.text[1:]
    return tuple(dict.fromkeys(filter(None, (text, *short, of[-1] if of else ""))))
