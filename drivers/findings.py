"""Findings that come and go, each with the time that it began."""

from collections.abc import Iterable

from drivers.samples import Finding


class FindingState:
    """One thing that can be wrong; `finding` is `None` while it is not. One thread writes, any reads."""

    def __init__(self) -> None:
        self.finding: Finding | None = None

    def note(self, now_ns: int, words: str, check: str) -> None:
        """Report the problem, new or persisting; the words may change. Another check is another finding."""
        before = self.finding
        since_ns = before.since_ns if before is not None and before.check == check else now_ns
        self.finding = Finding(since_ns, words, check)

    def clear(self) -> None:
        """Note that the problem is over."""
        self.finding = None


def active_findings(noted: Iterable[FindingState]) -> tuple[Finding, ...]:
    """Return the present findings."""
    return tuple(finding for one in noted if (finding := one.finding) is not None)
