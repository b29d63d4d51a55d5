"""Puts defects back, one at a time into a copy of the code, and sees how soon their targets find them."""

import shutil
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.explore.mutating import Part
from tests.fuzz.catalogue import HERE
from tests.fuzz.running import ROOT, Outcome, run

PACKAGES = ("drivers", "eds", "gateway", "ml", "server_gui", "tests/fuzz", "tests/explore")


@dataclass(frozen=True, slots=True)
class Defect:
    """What is put back, and who should find it."""

    name: str
    target: str
    about: str
    part: Part


def _read() -> dict[str, Defect]:
    table = tomllib.loads((HERE / "seeded.toml").read_text(encoding="utf-8"))
    return {
        name: Defect(name, one["target"], one["about"], Part(one["module"], one["old"], one["new"]))
        for name, one in table.items()
    }


DEFECTS = _read()


def judge(names: Sequence[str], seconds: float) -> int:
    """Look for these, or all, each for at most so long; how many were not found."""
    missed = 0
    for name in names or DEFECTS:
        defect = DEFECTS.get(name)
        if defect is None:
            raise SystemExit(f"there is no defect {name!r}; known are {', '.join(DEFECTS)}")
        outcome = look_for(defect, seconds)
        missed += outcome.said is None
        _tell(defect, outcome)
    return missed


def look_for(defect: Defect, seconds: float) -> Outcome:
    """With it in the code, and nothing else."""
    with tempfile.TemporaryDirectory(prefix="gwrms-seeded-") as folder:
        tree = Path(folder)
        for package in PACKAGES:
            ignored = shutil.ignore_patterns("__pycache__", "shipped", "found")
            shutil.copytree(ROOT / package, tree / package, ignore=ignored)
        (tree / "tests" / "__init__.py").touch()
        put_into(tree, defect.part)
        return run(defect.target, seconds, tree=tree)


def put_into(tree: Path, part: Part) -> None:
    """Raises `ValueError` where the text is not there exactly once."""
    file = tree / Path(*part.module.split(".")).with_suffix(".py")
    text = file.read_text(encoding="utf-8")
    if text.count(part.old) != 1:
        raise ValueError(f"{part.module} has {text.count(part.old)} times and not once: {part.old!r}")
    file.write_text(text.replace(part.old, part.new), encoding="utf-8")


def _tell(defect: Defect, outcome: Outcome) -> None:
    said = (outcome.said or "NOT FOUND").splitlines()[0][:80]
    how = f"{outcome.executions:8} executions {outcome.seconds:6.1f} s"
    sys.stdout.write(f"{defect.name:32} {defect.target:13} {how}  {said}\n")
    sys.stdout.flush()
