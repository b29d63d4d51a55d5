"""A Dockerfile as its steps."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Step:
    """One instruction, and the stage that it belongs to."""

    stage: str
    kind: str
    text: str

    @property
    def words(self) -> list[str]:
        return self.text.split()

    def pairs(self) -> Iterator[tuple[str, str]]:
        """NAME=VALUE of an ENV."""
        for word in self.words:
            name, _, value = word.partition("=")
            yield name, value


def read(file: Path) -> list[Step]:
    """Every instruction in order."""
    text = re.sub(r"\\\n", " ", file.read_text(encoding="utf-8"))
    steps: list[Step] = []
    stage = ""
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        if kind.isupper():
            stage = rest.split()[-1] if kind == "FROM" else stage
            steps.append(Step(stage, kind, rest))
    return steps
