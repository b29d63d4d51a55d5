"""What both explorers are asked on the command line, and how they are run."""

import argparse
import os
import sys
from collections.abc import Callable, Mapping
from typing import Protocol

from tests.explore.mutating import Part, put_back

DEFAULT_S = 60.0


class Mistake(Protocol):
    """A defect, which `parts` put back."""

    @property
    def parts(self) -> tuple[Part, ...]: ...


def parser(name: str, what: str | None, replay: str = "store") -> argparse.ArgumentParser:
    """With the options that both have; several can be played again where `replay` appends."""
    made = argparse.ArgumentParser(prog=name, description=what)
    add = made.add_argument
    add("--saying", default="", metavar="PATTERN", help="only violations that say this count")
    add("--replay", metavar="STEPS", action=replay, help="play these again, as a violation printed them")
    add("--with-defect", metavar="DEFECT", help="put this defect back before")
    add("--defects", nargs="*", metavar="DEFECT", help="look for each of these, or of all, put back")
    return made


def put_back_if(wanted: str | None, defects: Callable[[], Mapping[str, Mistake]]) -> None:
    """With the first import of anything of the path it is too late for a defect."""
    if wanted is not None:
        put_back(defects()[wanted].parts)


def run(module: str, main: Callable[[], int]) -> None:
    """What a set is iterated in belongs to what is played."""
    if os.environ.get("PYTHONHASHSEED") != "0":
        os.environ["PYTHONHASHSEED"] = "0"
        os.execv(sys.executable, [sys.executable, "-m", module, *sys.argv[1:]])
    sys.exit(main())
