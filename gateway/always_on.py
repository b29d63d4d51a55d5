"""A module that must run though nobody asks for it: where it cannot begin it is tried again, ever later."""

from collections.abc import Callable, Hashable
from concurrent.futures import Future

from gateway.process.loop import Loop
from gateway.registry import Module, Registry

AGAIN_S = 5.0  # how soon it is tried again first …
LATEST_S = 60.0  # … and how late at last, each time twice as late


class Standing:
    """One such module. It belongs to the loop's thread; `failed` is told each time, in words."""

    def __init__(
        self,
        registry: Registry,
        loop: Loop,
        name: str,
        user: Hashable | None,
        failed: Callable[[str], object],
    ) -> None:
        self._registry = registry
        self._loop = loop
        self._name = name
        self._user = user
        self._failed = failed
        self._delay_s = AGAIN_S

    def begin(self) -> None:
        """Start it; to be called once."""
        self._registry.use(self._name, self._user).add_done_callback(self._began)

    def _began(self, module: "Future[Module]") -> None:
        error = module.exception()
        if error is not None and not self._registry.ending:
            self._failed(str(error))
            self._loop.call_later(self._delay_s, self.begin)
            self._delay_s = min(2 * self._delay_s, LATEST_S)
