"""Handlers of the wire's methods: one function each, with the method's own types."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, cast

from msgspec import Raw, Struct

from gateway.wire.method import AnyMethod, Method, P, R

if TYPE_CHECKING:
    from gateway.connections.session import Answer, Session


class Answering(Struct, frozen=True):
    """One method and its function."""

    method: AnyMethod
    handler: "Callable[[Session, Struct], Answer]"


def on(method: Method[P, R], handler: "Callable[[Session, P], R | Future[R] | Future[Raw]]") -> Answering:
    """Let `handler` answer `method`, at once or later; `Raw` is a result that is encoded already."""
    # What it is called with was decoded as this method's parameters.
    return Answering(method, cast("Callable[[Session, Struct], Answer]", handler))


class Handlers:
    """Those of one module, or of the gateway itself.

    `require` raises `RpcError` where a connection holds no lease.

    Raises:
        ValueError: a method stands there twice, or needs the lease and nobody would look.

    """

    def __init__(self, *answering: Answering, require: "Callable[[Session], None] | None" = None) -> None:
        self._by_name = {one.method.name: one.handler for one in answering}
        self._require = require
        if len(self._by_name) < len(answering):
            raise ValueError("one of these methods has two handlers")
        if require is None and any(one.method.needs_lease for one in answering):
            raise ValueError("one of these methods needs the lease, which nobody would look for")

    @property
    def names(self) -> frozenset[str]:
        """The methods that they answer."""
        return frozenset(self._by_name)

    def answer(self, method: AnyMethod, session: "Session", params: Struct) -> "Answer":
        """Return the answer to one request, now or later.

        Raises:
            RpcError: it is refused; no_lease, where the method needs the lease and the connection has none.

        """
        if method.needs_lease and self._require is not None:
            self._require(session)
        return self._by_name[method.name](session, params)
