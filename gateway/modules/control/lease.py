"""One writer at a time: a lease belongs to a connection, ends by itself, and is lost with the connection."""

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gateway.process.loop import Loop, Timer
from gateway.wire.control import Lease
from gateway.wire.framing import ErrorKind, refuse

if TYPE_CHECKING:
    from gateway.connections.session import Session


@dataclass(slots=True)
class _Held:
    session: "Session"
    token: str
    expires_ns: int
    timer: Timer


class Leases:
    """The right to write. It belongs to the loop's thread.

    `changed(session, what)` is told what has happened to whose lease: taken, renewed, given back, or why it
    ended. After all but the first two nobody may write until somebody takes it anew.
    """

    def __init__(self, loop: Loop, changed: "Callable[[Session, str], None]") -> None:
        self._loop = loop
        self._changed = changed
        self._lease: _Held | None = None

    def acquire(self, session: "Session", ttl_s: float, *, take_over: bool = False) -> Lease:
        """Take or renew the lease; raises `RpcError` (lease_held) where another connection has it.

        With `take_over` that one loses it, and with it what it has on trial.
        """
        held = self._lease
        if take_over and held is not None and held.session is not session and not session.closed:
            self._end(held.session, f"lease taken over by {session.who}")
            held = self._lease
        if held is not None and held.session is not session:
            left_s = (held.expires_ns - time.monotonic_ns()) / 1e9
            raise refuse(
                ErrorKind.LEASE_HELD,
                f"{held.session.who} has the lease for up to {left_s:.1f} s more; ask again then, "
                "or have it released there (in a window: Release, on its page Parameters)",
            )
        if session.closed:
            raise refuse(ErrorKind.NO_LEASE, "the connection has ended")
        expires_ns = time.monotonic_ns() + round(ttl_s * 1e9)
        timer = self._loop.call_later(ttl_s, lambda: self._end(session, "lease ran out"))
        if held is None:
            session.on_close(lambda: self._end(session, "lease lost with the connection"), self)
            held = self._lease = _Held(session, secrets.token_hex(8), expires_ns, timer)
            self._changed(session, TAKEN)
        else:
            held.timer.cancel()
            held.expires_ns, held.timer = expires_ns, timer
            self._changed(session, RENEWED)
        return Lease(held.token, ttl_s)

    def release(self, session: "Session", token: str | None) -> None:
        """Give it back; raises `RpcError` (no_lease) where there is nothing to give."""
        self.require(session)
        if token is not None and self._lease is not None and token != self._lease.token:
            raise refuse(ErrorKind.NO_LEASE, f"the lease of this connection is not {token!r}")
        self._end(session, "lease given back")

    def require(self, session: "Session") -> None:
        """Raise `RpcError` (no_lease) where the connection may not write."""
        if not self.held_by(session):
            raise refuse(ErrorKind.NO_LEASE, "this connection holds no lease; call control.acquire first")

    def held_by(self, session: "Session") -> bool:
        """Return whether the connection may write now."""
        held = self._lease
        return held is not None and held.session is session and time.monotonic_ns() < held.expires_ns

    def _end(self, session: "Session", why: str) -> None:
        held = self._lease
        if held is not None and held.session is session:
            held.timer.cancel()
            self._lease = None
            self._changed(session, why)


TAKEN, RENEWED = "lease taken", "lease renewed"
