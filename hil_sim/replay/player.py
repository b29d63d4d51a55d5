"""Plays what was recorded on a clock: each action as long after the first as it was recorded."""

from collections.abc import Callable, Iterator

from hil_sim.clock import MILLISECOND_NS, Action, Clock

_BETWEEN_NS = 10 * MILLISECOND_NS  # from the last action to the first of the next round

Timed = tuple[int, Action]  # when it was recorded (ns), and what to do


class Player:
    """Does what `recording` gives, from `play` on; then `ended` is called, or with `loop` it begins again.

    `recording` gives the actions in the order of their stamps, the first at `first_ns`.
    """

    def __init__(
        self,
        clock: Clock,
        recording: Callable[[], Iterator[Timed]],
        first_ns: int,
        loop: bool,
        ended: Callable[[], None],
    ) -> None:
        self._clock = clock
        self._recording = recording
        self._first_ns = first_ns
        self._loop = loop
        self._ended = ended
        self._offset_ns = 0
        self._left: Iterator[Timed] = iter(())

    def play(self) -> None:
        """Begin now."""
        self._offset_ns = self._clock.now_ns - self._first_ns
        self._left = self._recording()
        self._next()

    def _next(self) -> None:
        following = next(self._left, None)
        if following is not None:
            stamp_ns, action = following
            self._clock.at(stamp_ns + self._offset_ns, lambda: self._do(action))
        elif self._loop:
            self._clock.after(_BETWEEN_NS, self.play)
        else:
            self._ended()

    def _do(self, action: Action) -> None:
        action()
        self._next()
