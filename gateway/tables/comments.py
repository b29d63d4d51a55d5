"""The comments behind a struct's fields: the meaning of each key, for people who write it."""

import ast
import inspect
import textwrap
import tokenize
from io import StringIO

from msgspec import Struct


def comments(struct: type[Struct]) -> dict[str, str]:
    """Return the comment behind each field, also if a base class declares it."""
    found: dict[str, str] = {}
    for base in reversed(struct.__mro__):
        if issubclass(base, Struct) and base is not Struct:
            found |= _own_comments(textwrap.dedent(inspect.getsource(base)))
    return found


def _own_comments(source: str) -> dict[str, str]:
    tokens = tokenize.generate_tokens(StringIO(source).readline)
    by_line = {one.start[0]: one.string.lstrip("# ") for one in tokens if one.type == tokenize.COMMENT}
    [declared] = ast.parse(source).body
    return {
        node.target.id: " ".join(
            by_line[line] for line in range(node.lineno, (node.end_lineno or 0) + 1) if line in by_line
        )
        for node in getattr(declared, "body", ())
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
    }
