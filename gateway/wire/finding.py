"""Messages on findings: since when, and what to check."""

from msgspec import Struct


class FindingInfo(Struct, frozen=True):
    """One finding; `since_ns` is on the robot's clock."""

    since_ns: int
    words: str
    check: str
