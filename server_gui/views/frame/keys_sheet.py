"""Every key of the window, on a sheet over the tabs: alarms and every STOP stay in sight."""

from typing import Final

from PySide6.QtWidgets import QGridLayout, QWidget

from server_gui.views.theme import Theme
from server_gui.views.widgets.overlay import Overlay
from server_gui.views.widgets.plain import PlainLabel

WIDEST: Final = 560  # at text of 100 %

# What a key is pressed for, by where it holds. A test compares the first three groups with the window's own.
KEYS: Final[dict[str, dict[str, str]]] = {
    "Everywhere": {
        "F12": "STOP the selected robot, and the one that is being commissioned",
        "Ctrl+Space": "STOP the selected robot, and the one that is being commissioned",
        "Shift+F12": "STOP ALL: every robot of the list, and the one that is being commissioned",
        "Ctrl+1": "Select the first robot; up to Ctrl+9",
        "Alt+O": "Overview; Alt with the underlined letter opens each tab",
        "Ctrl+F": "Filter the parameters",
        "Ctrl+R": "Stop recording, or start it",
        "F9": "Hide the panels, or show them again",
        "F1": "The manual on this page",
        "?": "Show or close this sheet",
    },
    "Parameters": {
        "Ctrl+P": "Pin or unpin the selected parameter",
        "F2": "Type a new value for the selected parameter",
        "Ctrl+Return": "Review what is staged",
        "Ctrl+Z": "Stage the inverse of the latest write",
        "Ctrl+K": "Keep the trial",
        "Ctrl+T": "Take back the trial",
        "Esc": "Back from the review",
    },
    "Signals": {
        "Ctrl+Shift+P": "Pause or resume the view",
        "Ctrl++": "Shorten the visible time",
        "Ctrl+-": "Extend the visible time",
        "Ctrl+0": "Fit: the range follows the data again",
        "Ctrl+Left": "Earlier",
        "Ctrl+Right": "Later",
        "Ctrl+D": "Two cursors; A or B chooses one, the arrows move it",
        "Ctrl+Up": "To the event before",
        "Ctrl+Down": "To the next event",
        "Ctrl+E": "Save as CSV",
        "Ctrl+Shift+E": "Write an expression",
        "Ctrl+Shift+T": "Switch the trigger on or off",
        "Ctrl+Shift+N": "A note on the time axis",
    },
    "A recording": {
        "Space": "Play or pause",
        "← →": "1 s back or forward; Page: 10 s; Home, End",
        "N": "To the next event; with Shift to the one before",
        "I, O": "The span begins, ends here",
        "Del": "Take back the chosen label",
    },
    "Tables and lists": {
        "Tab": "From one control to the next; with Shift back",
        "Arrows": "From row to row; in a tree → opens and ← closes",
        "Return": "On a table's titles, which Tab leads to: ← → chooses one, Return sorts by it",
        "Space": "Tick a channel; press a button",
        "Menu": "A channel's menu: choose its plot",
    },
}


class KeysSheet(Overlay):
    """Over `below`; `turn` shows it or puts it away."""

    def __init__(self, theme: Theme, below: QWidget) -> None:
        words = QWidget()
        grid = QGridLayout(words)
        grid.setColumnStretch(1, 1)
        row = 0
        for group, keys in KEYS.items():
            row = _fill(grid, row, group, keys)
        grid.setRowStretch(row, 1)
        super().__init__("Keys", words, theme, below, WIDEST)


def _fill(grid: QGridLayout, row: int, group: str, keys: dict[str, str]) -> int:
    title = PlainLabel(group)
    title.setObjectName("title")
    grid.addWidget(title, row, 0, 1, 2)
    for place, (key, what) in enumerate(keys.items(), row + 1):
        words = PlainLabel(what)
        words.setWordWrap(True)
        grid.addWidget(PlainLabel(key), place, 0)
        grid.addWidget(words, place, 1)
    return row + 1 + len(keys)
