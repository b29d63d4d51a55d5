"""The grammar of expressions: text to a tree, with the place of everything; no text of any kind is executed.

    curve    = [name "="] sum                     apart = left_knee.position - right_knee.position
    sum      = product {("+" | "-") product}
    product  = factor {("*" | "/") factor}
    factor   = "-" factor | number ["[" unit "]"] | channel | function "(" sum {"," sum} ")" | "(" sum ")"

Why so: `docs/adr/0020-expressions-have-a-grammar-of-their-own.md`.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

LONGEST: Final = 400  # letters
DEEPEST: Final = 24  # brackets, functions and signs within each other
MOST_NODES: Final = 100

_TOKEN: Final = re.compile(
    r"(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_][\w-]*(?:\.[A-Za-z_]\w*)+|[A-Za-z_]\w*)"
    r"|(?P<unit>\[[^\[\]]*\])"
    r"|(?P<sign>[-+*/(),])"
    r"|(?P<space>[ \t]+)",
    re.ASCII,
)


class ExpressionError(ValueError):
    """Error in an expression; `place` and `length` mark it in the text."""

    def __init__(self, problem: str, text: str, place: int, length: int = 1) -> None:
        super().__init__(problem)
        self.problem, self.text, self.place, self.length = problem, text, place, max(length, 1)

    def __str__(self) -> str:
        """Return the text, and below it the place that is meant with what is wrong there."""
        return f"{self.text}\n{' ' * self.place}{'^' * self.length} {self.problem}"

    @property
    def line(self) -> str:
        """All of it in one line."""
        there = self.text[self.place : self.place + self.length]
        return (
            f"{self.problem} (at {there!r}, letter {self.place + 1})"
            if there
            else f"{self.problem} (at the end)"
        )


@dataclass(frozen=True, slots=True)
class ExpressionNode:
    """One part of an expression, from `place` for `length` letters.

    `kind` is `number` (its unit in `unit`), `channel`, `call` (of the function `text`), `negative` or a sign.
    """

    kind: str
    text: str
    place: int
    length: int
    parts: tuple["ExpressionNode", ...] = ()
    unit: str | None = None


@dataclass(frozen=True, slots=True)
class Written:
    """A written curve: its name, and its expression tree."""

    name: str
    tree: ExpressionNode

    @property
    def channels(self) -> frozenset[str]:
        """Every channel that it needs."""
        return frozenset(node.text for node in walk(self.tree) if node.kind == "channel")


@dataclass(frozen=True, slots=True)
class _Token:
    kind: str
    text: str
    place: int


def parse(text: str) -> Written:
    """Parse a curve's text.

    Raises:
        ExpressionError: it says nothing that can be computed; marks where.

    """
    if len(text) > LONGEST:
        raise ExpressionError(f"longer than {LONGEST} letters", text[:LONGEST], LONGEST - 1)
    name, equals, rest = text.partition("=")
    begin = len(name) + 1 if equals else 0
    if equals and not name.strip():
        raise ExpressionError("a name is missing before =", text, 0)
    if equals and not name.strip().isprintable():
        raise ExpressionError("the name has signs that cannot be shown", text, 0, len(name))
    tree = _Parser(text, begin).whole()
    return Written(" ".join(name.split()) if equals else " ".join(rest.split() or text.split()), tree)


def walk(tree: ExpressionNode) -> Iterator[ExpressionNode]:
    """Yield every node."""
    yield tree
    for part in tree.parts:
        yield from walk(part)


class _Parser:
    """Precedence climbing over the tokens; every level counts, so that no text makes it deep or slow."""

    def __init__(self, text: str, begin: int) -> None:
        self._text = text
        self._tokens = list(_tokens(text, begin))
        self._at = 0
        self._depth = 0
        self._nodes = 0

    def whole(self) -> ExpressionNode:
        tree = self._sum()
        if self._here.kind != "end":
            raise self._error(f"{self._here.text!r} is not expected here")
        return tree

    @property
    def _here(self) -> _Token:
        return self._tokens[self._at]

    def _sum(self) -> ExpressionNode:
        return self._chain("+-", lambda: self._chain("*/", self._factor))

    def _chain(self, signs: str, part: Callable[[], ExpressionNode]) -> ExpressionNode:
        left = part()
        while self._here.kind == "sign" and self._here.text in signs:
            sign = self._take()
            left = self._node(sign.text, sign.text, sign.place, 1, (left, part()))
        return left

    def _factor(self) -> ExpressionNode:
        self._depth += 1
        if self._depth > DEEPEST:
            raise self._error(f"more than {DEEPEST} brackets and signs within each other")
        found = self._factor_here()
        self._depth -= 1
        return found

    def _factor_here(self) -> ExpressionNode:
        token = self._take()
        match token.kind, token.text:
            case "number", text:
                return self._number(token, text)
            case "name", text if self._here.text == "(":
                return self._call(token)
            case "name", text:
                if "." not in text:
                    self._at -= 1
                    raise self._error(f"{text} is no channel: they are written as left_knee.position")
                return self._node("channel", text, token.place, len(text))
            case "sign", "-":
                return self._node("negative", "-", token.place, 1, (self._factor(),))
            case "sign", "(":
                inner = self._sum()
                self._expect(")", f"the bracket of letter {token.place + 1} is not closed")
                return inner
        self._at -= 1
        raise self._error("a channel, a number or a function is missing here")

    def _number(self, token: _Token, text: str) -> ExpressionNode:
        unit = None
        if self._here.kind == "unit":
            unit = self._take().text[1:-1].strip()
        if float(text) == float("inf"):
            raise ExpressionError("the number is too large", self._text, token.place, len(text))
        return self._node("number", text, token.place, len(text), unit=unit)

    def _call(self, name: _Token) -> ExpressionNode:
        self._take()
        parts = [self._sum()]
        while self._here.text == ",":
            self._take()
            parts.append(self._sum())
        self._expect(")", f"the bracket of {name.text} is not closed")
        return self._node("call", name.text, name.place, len(name.text), tuple(parts))

    def _expect(self, sign: str, problem: str) -> None:
        if self._here.text != sign:
            raise self._error(problem)
        self._take()

    def _take(self) -> _Token:
        token = self._here
        if token.kind == "end":
            raise self._error("a channel, a number or a function is missing here")
        self._at += 1
        return token

    def _node(
        self,
        kind: str,
        text: str,
        place: int,
        length: int,
        parts: tuple[ExpressionNode, ...] = (),
        unit: str | None = None,
    ) -> ExpressionNode:
        self._nodes += 1
        if self._nodes > MOST_NODES:
            raise self._error(f"more than {MOST_NODES} parts")
        return ExpressionNode(kind, text, place, length, parts, unit)

    def _error(self, problem: str) -> ExpressionError:
        return ExpressionError(problem, self._text, self._here.place, len(self._here.text))


def _tokens(text: str, begin: int) -> Iterator[_Token]:
    place = begin
    while place < len(text):
        found = _TOKEN.match(text, place)
        if found is None:
            raise ExpressionError(f"{text[place]!r} means nothing here", text, place)
        if found.lastgroup != "space":
            yield _Token(str(found.lastgroup), found.group(), place)
        place = found.end()
    yield _Token("end", "", len(text))
