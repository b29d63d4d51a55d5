"""Lease and journal: who may change something on the robot, and who did."""

from typing import Annotated, Any

from msgspec import Meta, Struct

from gateway.wire.method import Done, Method, Params, Seconds
from gateway.wire.role import Role


class AcquireParams(Params, frozen=True):
    """`control.acquire`; with `take_over` a maintainer gets it though another client holds it."""

    ttl_s: Seconds
    take_over: bool = False


class ReleaseParams(Params, frozen=True):
    """`control.release`; a lease belongs to its connection, naming it is a check."""

    lease: str | None = None


class Lease(Struct, frozen=True):
    """Result of `control.acquire`."""

    lease: str
    expires_s: float


class TailParams(Params, frozen=True):
    """`journal.tail`."""

    n: Annotated[int, Meta(ge=1, le=1000)] = 20


class JournalEntries(Struct, frozen=True):
    """Result of `journal.tail`: the newest entries, oldest first; `cut` says why there are not more."""

    entries: list[dict[str, Any]]
    cut: str | None = None


class SignedHead(Struct, frozen=True):
    """The journal's newest entry, signed by the robot: who keeps this can tell whether it was rewritten.

    `certificate` is the robot's (PEM), `signature` ECDSA over SHA-256 (DER, base64).
    """

    robot: str
    n: int
    hash: str
    utc_ns: int
    certificate: str
    signature: str


class JournalProof(Struct, frozen=True):
    """Result of `journal.head`; without a `head`, `unsigned` says why."""

    head: SignedHead | None = None
    unsigned: str | None = None


class RecordsInfo(Struct, frozen=True):
    """Folder of the journal, and the reason if it cannot be written."""

    folder: str
    problem: str | None = None


CONTROL_ACQUIRE = Method("control.acquire", AcquireParams, Lease, module="control", role=Role.OPERATOR)
CONTROL_RELEASE = Method(
    "control.release", ReleaseParams, Done, module="control", needs_lease=True, role=Role.OPERATOR
)
JOURNAL_TAIL = Method("journal.tail", TailParams, JournalEntries, module="control", role=Role.VIEWER)
JOURNAL_HEAD = Method("journal.head", Params, JournalProof, module="control", role=Role.VIEWER)
METHODS = (CONTROL_ACQUIRE, CONTROL_RELEASE, JOURNAL_TAIL, JOURNAL_HEAD)
