"""A method of the wire, declared once: whoever serves it, asks for it or describes it takes it from there.

Parameters forbid unknown fields. Results may grow: a reader ignores fields it does not know.
"""

from typing import Annotated, Any, Generic, TypeVar

from msgspec import Meta, Struct

from gateway.wire.role import Role

P = TypeVar("P", bound=Struct)
R = TypeVar("R", bound=Struct)

Globs = list[str]
Number = int | float
Seconds = Annotated[float, Meta(gt=0, le=300)]


class Params(Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of a method; as it stands, of one that takes none."""


class Done(Struct, frozen=True):
    """The result of a method that has nothing to tell."""


class Method(Struct, Generic[P, R], frozen=True):
    """One method: `params` in, `result` out.

    Of who may ask, the gateway enforces `role`, the least that may, and `needs_lease`. An urgent method acts
    in the thread that reads the clients, past all that waits. In turn means: devices or the kernel are asked,
    for one client after the other.
    """

    name: str
    params: type[P]
    result: type[R]
    module: str | None = None  # that answers it; None: the gateway itself, with none running
    needs_lease: bool = False
    urgent: bool = False
    in_turn: bool = False
    role: Role = Role.MAINTAINER  # what does not say it is for few


AnyMethod = Method[Any, Any]  # of a table
