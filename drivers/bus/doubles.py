"""Whether a node answers each request twice, as two devices with one node id do."""

from collections import deque
from dataclasses import dataclass

from drivers.bus import sdo

RECENT = 8  # requests whose second answer is still recognised
CLEAN = 20  # requests answered once, after which all is well again


@dataclass(slots=True)
class _Answered:
    key: bytes  # specifier and object
    twice: bool = False


class Doubles:
    """Fed with the answers of one node. A frame that comes twice says nothing: two in a row do."""

    def __init__(self) -> None:
        self.found = False
        self._recent: deque[_Answered] = deque()
        self._clean = 0

    def answered(self, answer: bytes) -> None:
        """A request was answered by this."""
        if not sdo.names_object(answer):
            return
        self._recent.append(_Answered(_key(answer)))
        if len(self._recent) > RECENT:
            self._judge(self._recent.popleft())

    def again(self, answer: bytes) -> bool:
        """Take one that answers no request; whether it is the second to one of the last."""
        key = _key(answer)
        for at in reversed(range(len(self._recent))):
            if self._recent[at].key == key and not self._recent[at].twice:
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


def _key(answer: bytes) -> bytes:
    return bytes([answer[0] & sdo.SPECIFIER]) + answer[1:4]
