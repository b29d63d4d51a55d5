"""A trial kept or taken back, as somebody decides; where that fails, it is said where its countdown is."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Final

from server_gui.core.follow.news import NewsKind
from server_gui.core.threads.answers import Deliver, Result, when_done
from server_gui.core.tuning.commands import Commands
from server_gui.core.tuning.reverted_trials import RevertedTrials
from server_gui.core.tuning.writing import WriteProgress

NOT_DONE: Final = {"keep": "NOT kept", "revert": "NOT taken back"}


class TrialEnds:
    """Those of one robot; `tell` reports what came of them."""

    def __init__(
        self,
        commands: Commands,
        deliver: Deliver,
        writing: WriteProgress,
        reverted: RevertedTrials,
        tell: Callable[[NewsKind, str], None],
    ) -> None:
        self._commands, self._deliver = commands, deliver
        self._writing, self._reverted, self._tell = writing, reverted, tell

    def keep(self) -> None:
        """Make what is on trial stay."""
        if self._writing.trial is not None:
            self._ask("keep", self._commands.confirm(self._writing.trial.write), lambda _: self._kept())

    def take_back(self) -> None:
        """Take back what is on trial, now."""
        if self._writing.trial is not None:
            before = self._writing.trial.before
            future = self._commands.revert(self._writing.trial.write)
            self._ask("revert", future, lambda _: self._reverted.began(before))

    def _kept(self) -> None:
        self._writing.kept()
        self._tell(NewsKind.PARAMETER, self._writing.text)

    def _ask(self, what: str, future: "Future[Result]", done: Callable[[Result], None]) -> None:
        """Ask; an answer that comes late, with another one on trial or after another wish, is only told."""
        trial, number = self._writing.trial, self._writing.asked()

        def answered(result: Result) -> None:
            if self._writing.trial is trial:
                done(result)
            else:
                self._tell(NewsKind.PARAMETER, f"{what}: answered late, of a trial before")

        def failed(error: Exception) -> None:
            self._tell(NewsKind.WARNING, f"{what}: {error}")
            if self._writing.trial is trial and number == self._writing.asks:
                self._writing.not_done(NOT_DONE[what], str(error))

        when_done(future, self._deliver, answered, failed)
