"""One writer at a time: a lease belongs to a connection, ends by itself, and is lost with the connection."""

import secrets
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gateway.messages import Lease
from gateway.wire import Kind, refuse

if TYPE_CHECKING:
    from gateway.session import Session


@dataclass(frozen=True, slots=True)
class _Held:
    session: "Session"
    token: str
    expires_ns: int


class Leases:
    """Who may write now. It belongs to the loop's thread."""

    def __init__(self) -> None:
        self._lease: _Held | None = None

    def acquire(self, session: "Session", ttl_s: float) -> Lease:
        """Take or renew the lease; raises `RpcError` (lease_held) where another connection has it."""
        held, now_ns = self._current(), time.monotonic_ns()
        if held is None:
            session.on_close(lambda: self._drop(session))
        elif held.session is not session:
            left_s = (held.expires_ns - now_ns) / 1e9
            raise refuse(
                Kind.LEASE_HELD,
                f"{held.session.peer} has the lease for up to {left_s:.1f} s more; ask again then",
            )
        token = secrets.token_hex(8) if held is None else held.token
        self._lease = _Held(session, token, now_ns + round(ttl_s * 1e9))
        return Lease(token, ttl_s)

    def release(self, session: "Session", token: str | None) -> None:
        """Give it back; raises `RpcError` (no_lease) where there is nothing to give."""
        self.require(session)
        if token is not None and self._lease is not None and token != self._lease.token:
            raise refuse(Kind.NO_LEASE, f"the lease of this connection is not {token!r}")
        self._lease = None

    def require(self, session: "Session") -> None:
        """Raise `RpcError` (no_lease) where the connection may not write."""
        held = self._current()
        if held is None or held.session is not session:
            raise refuse(Kind.NO_LEASE, "this connection holds no lease; call control.acquire first")

    def _current(self) -> _Held | None:
        held = self._lease
        return held if held is not None and time.monotonic_ns() < held.expires_ns else None

    def _drop(self, session: "Session") -> None:
        if self._lease is not None and self._lease.session is session:
            self._lease = None
