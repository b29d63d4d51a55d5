"""Duplicate answers to SDO requests, as from two devices with one node id."""

from collections import deque
from dataclasses import dataclass

from drivers.bus.sdo import protocol

RECENT = 8  # requests whose second answer is still recognised
CLEAN = 20  # requests answered once, after which all is well again


@dataclass(slots=True)
class _Answered:
    answer: bytes
    twice: bool = False


class DuplicateAnswers:
    """Fed with the answers of one node. A frame that comes twice says nothing: two in a row do."""

    def __init__(self) -> None:
        self.found = False
        self._recent: deque[_Answered] = deque()
        self._clean = 0

    @property
    def suspected(self) -> bool:
        """The last answer came twice; the next ones will tell."""
        return not self.found and bool(self._recent) and self._recent[-1].twice

    def answered(self, answer: bytes) -> None:
        """Take the answer to a request."""
        if not protocol.names_object(answer):
            return
        self._recent.append(_Answered(answer))
        if len(self._recent) > RECENT:
            self._judge(self._recent.popleft())

    def again(self, answer: bytes) -> bool:
        """Take one that answers no request; whether it is the second to one of the last."""
        key = _key(answer)
        for at in reversed(range(len(self._recent))):
            if _key(self._recent[at].answer) == key and not self._recent[at].twice:
                self._recent[at].twice = True
                if any(
                    self._recent[near].twice for near in (at - 1, at + 1) if 0 <= near < len(self._recent)
                ):
                    self.found, self._clean = True, 0
                return True
        return False

    def _judge(self, one: _Answered) -> None:
        self._clean = 0 if one.twice else self._clean + 1
        if self._clean >= CLEAN:
            self.found = False


def _key(answer: bytes) -> tuple[int, bytes]:
    """Return specifier and object: two devices may hold different values."""
    return answer[0] & protocol.SPECIFIER, answer[1:4]
