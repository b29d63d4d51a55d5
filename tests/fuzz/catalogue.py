"""The targets: every file of tests/fuzz/targets, and its corpus."""

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
NAMES = tuple(sorted(file.stem for file in (HERE / "targets").glob("*.py") if not file.stem.startswith("_")))


@dataclass(frozen=True, slots=True)
class Target:
    """One target, imported."""

    name: str
    about: str
    fuzz: Callable[[bytes], None]
    tokens: tuple[bytes, ...]
    modules: tuple[str, ...]


def target(name: str) -> Target:
    """Import it, and with it the code under test."""
    module = importlib.import_module(f"tests.fuzz.targets.{name}")
    about = (module.__doc__ or "").partition("\n")[0]
    return Target(name, about, module.fuzz, module.TOKENS, module.MODULES)


def about(name: str) -> str:
    """Its first line, without importing what it tests."""
    text = (HERE / "targets" / f"{name}.py").read_text(encoding="utf-8")
    return text.partition("\n")[0].strip('"')


def corpus(name: str) -> Iterator[bytes]:
    """Its inputs, always in the same order."""
    for file in sorted((HERE / "corpus" / name).iterdir()):
        yield file.read_bytes()
