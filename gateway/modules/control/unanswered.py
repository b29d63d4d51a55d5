"""Devices that did not answer a read: not asked again at once, unless they have answered anybody since."""

import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from gateway.modules.control.objects import Node

AGAIN_S: Final = 1.0  # after so long they are asked again all the same


@dataclass(frozen=True, slots=True)
class _Missed:
    node: Node
    at_ns: int
    problem: str


class Unanswered:
    """One robot's, by component. It belongs to the loop's thread."""

    def __init__(self) -> None:
        self._missed: dict[str, _Missed] = {}

    def note(self, components: Iterable[str], node: Node, problem: str) -> None:
        """Note that these, of this node, were not answered just now."""
        missed = _Missed(node, time.monotonic_ns(), problem)
        self._missed.update(dict.fromkeys(components, missed))

    def why(self, component: str) -> str | None:
        """Return why it is not asked just now; `None` where it may be."""
        missed = self._missed.get(component)
        if missed is None:
            return None
        past_s = (time.monotonic_ns() - missed.at_ns) / 1e9
        if past_s >= AGAIN_S or missed.node.answered_ns > missed.at_ns:
            del self._missed[component]
            return None
        return (
            f"{component} did not answer {1e3 * past_s:.0f} ms ago, and is asked again "
            f"in {1e3 * (AGAIN_S - past_s):.0f} ms: {missed.problem}"
        )
