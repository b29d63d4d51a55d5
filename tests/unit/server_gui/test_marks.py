"""How many drives are enabled, as far as that is known."""

import pytest

from server_gui.core.alarms.marks import ENABLED, enabled_text
from server_gui.core.follow.robot import Robot


class OfWords(Robot):
    """A robot whose joints tell these states."""

    def __init__(self, words: list[str | None]) -> None:
        super().__init__()
        self._told = {f"joint{number}": word for number, word in enumerate(words)}

    def names(self, kind: str) -> list[str]:
        return list(self._told) if kind == "joint" else []

    def word(self, channel: str) -> str | None:
        return self._told[channel.removesuffix(".state")]


OFF = "switch on disabled"


@pytest.mark.parametrize(
    ("words", "live", "said"),
    [
        ([ENABLED, ENABLED], True, "2 of 2 enabled"),
        ([OFF, OFF], True, "0 of 2 enabled"),
        ([OFF, None], True, "0 of 2 enabled, 1 not known"),
        ([None, None], True, "– of 2 enabled"),
        ([ENABLED, ENABLED], False, "– of 2 enabled"),
        ([], True, "0 of 0 enabled"),
        ([], False, "– of – enabled"),
    ],
)
def test_a_drive_whose_state_is_not_known_is_not_counted_as_off(
    words: list[str | None], live: bool, said: str
) -> None:
    assert enabled_text(OfWords(words), live=live) == said
