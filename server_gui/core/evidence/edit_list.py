"""The list of one robot's edits that the desk shows, with the newest evidence of each."""

from collections.abc import Iterator
from typing import Final

from server_gui.core.evidence.file import EditEvidence

SHOWN: Final = 500  # edits; the oldest go


class EditList:
    """Edits and what they did, in the order in which they were last told of."""

    def __init__(self) -> None:
        self._by_id: dict[str, EditEvidence] = {}

    def __iter__(self) -> Iterator[EditEvidence]:
        return iter(self._by_id.values())

    def take(self, told: EditEvidence) -> None:
        """Apply what is known now of an edit."""
        self._by_id.pop(told.edit.id, None)
        self._by_id[told.edit.id] = told
        while len(self._by_id) > SHOWN:
            del self._by_id[next(iter(self._by_id))]

    def on_trial(self, write: int) -> EditEvidence | None:
        """Return what is known of the trial of this write, while it goes on."""
        mine = (told for told in reversed(self._by_id.values()) if told.edit.write == write)
        return next((told for told in mine if not told.is_final), None)
