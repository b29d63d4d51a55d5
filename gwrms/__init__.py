"""The public API for scripts: `from gwrms import Robot`; `python -m gwrms` is the command.

The parts of GWRMS have plain names, and Python looks beside a script first: a `gateway.py` there would be
imported in the place of ours. So ours is imported from beside this package, whatever lies beside the script.
Two modules of one name there cannot be: where another `gateway` was imported before, importing this is
refused, and a script that imports one after this gets ours.
"""

import sys
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from gateway import __version__ as __version__
    from gateway.client import *  # noqa: F403

_HOME: Final = Path(__file__).resolve().parents[1]  # of all that was installed with this
_PART: Final = "gateway"  # all that the client needs of the rest


def _import_ours() -> None:
    before = sys.modules.get(_PART)
    if before is not None:
        _refuse_another(before)
        return
    spec = PathFinder.find_spec(_PART, [str(_HOME)])
    if spec is None or spec.loader is None:
        raise ImportError(f"{_HOME / _PART}, a part of GWRMS, is missing: install GWRMS again")
    sys.modules[_PART] = module = module_from_spec(spec)
    spec.loader.exec_module(module)


def _refuse_another(module: ModuleType) -> None:
    if Path(module.__file__ or "").resolve().parent != _HOME / _PART:
        raise ImportError(
            f"{module!r} was imported before, and has the name of a part of GWRMS, {_HOME / _PART}: rename it"
        )


_import_ours()


def __getattr__(name: str) -> Any:
    client = import_module("gateway.client")
    names = [*client.__all__, "__version__"]
    if name == "__all__":
        return names
    if name not in names:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("gateway") if name == "__version__" else client, name)
