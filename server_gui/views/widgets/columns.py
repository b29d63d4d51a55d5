"""Columns that share what room there is: numbers whole, names elided in their middle, the spare left out."""

from collections.abc import Mapping, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHeaderView, QTableView, QTreeView


def header_of(view: QTableView | QTreeView) -> QHeaderView:
    """Return the titles of a table's or a tree's columns."""
    return view.horizontalHeader() if isinstance(view, QTableView) else view.header()


def prepare(view: QTableView | QTreeView) -> None:
    """Let `fit` say how wide columns are."""
    view.setTextElideMode(Qt.TextElideMode.ElideMiddle)
    header = header_of(view)
    header.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
    header.setStretchLastSection(False)


def title_widths(view: QTableView | QTreeView) -> list[int]:
    """Return how wide the title of each column is; Qt says 0 of one that is left out."""
    header = header_of(view)
    hidden = [column for column in range(header.count()) if header.isSectionHidden(column)]
    for column in hidden:
        header.setSectionHidden(column, False)
    widths = [header.sectionSizeHint(column) for column in range(header.count())]
    for column in hidden:
        header.setSectionHidden(column, True)
    return widths


def fit(
    view: QTableView | QTreeView,
    names: Mapping[int, int],
    spare: Sequence[int] = (),
    unwanted: Sequence[int] = (),
) -> None:
    """Make columns as wide as what is in them.

    Where that has no room, those of `names` are narrowed to the width given (pixels) or their title, those of
    `spare` are left out, the first ones first. What room is left the first of `names` gets.
    """
    header = header_of(view)
    shown = {column for column in range(header.count()) if column not in unwanted}
    titles = title_widths(view)
    wanted = {one: max(view.sizeHintForColumn(one), titles[one]) for one in shown}
    least = {one: min(width, max(names.get(one, width), titles[one])) for one, width in wanted.items()}
    room = view.viewport().width()
    for column in spare:
        if sum(least[one] for one in shown) > room:
            shown.discard(column)
    narrows = {one: wanted[one] - least[one] for one in shown if wanted[one] > least[one]}
    short = min(max(sum(wanted[one] for one in shown) - room, 0), sum(narrows.values()))
    for one, gives in narrows.items():
        wanted[one] -= -(-gives * short // sum(narrows.values()))
    first = next((one for one in names if one in shown), None)
    if first is not None:
        wanted[first] += max(room - sum(wanted[one] for one in shown), 0)
    for column in range(header.count()):
        view.setColumnHidden(column, column not in shown)
        if column in shown:
            header.resizeSection(column, wanted[column])
