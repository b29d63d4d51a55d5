"""Which model serves, and which did before: numbered objects that are written once and never altered.

So two who promote at once both find their place in the history, and neither undoes the other unseen.
"""

import contextlib
import re
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final, NamedTuple

import msgspec
from msgspec import Struct

from ml.errors import UnusableModel
from ml.registry.card import checked_name
from ml.store.objects import Objects

FOLDER: Final = "models/serving"
EVERY_ROBOT: Final = "_all"  # no robot's name begins with _
ATTEMPTS: Final = 100
_NUMBER: Final = re.compile(r"/(\d{6})\.json$")


class Pointer(Struct, frozen=True):
    """From `utc` on this model serves, or none where `model` is empty; a rollback goes to number `before`."""

    model: str
    utc: datetime
    who: str
    why: str
    before: int  # 0: nothing


class Target(NamedTuple):
    """Where a rollback goes: the number that it writes, a model or "", and what is before that."""

    number: int
    model: str
    before: int


class Pointers:
    """The history of one task for one robot, or for all (`robot` is empty), oldest first."""

    def __init__(self, objects: Objects, task: str, robot: str = "") -> None:
        name = checked_name(robot, "robot") if robot else EVERY_ROBOT
        self._objects = objects
        self._whose = f"{robot or 'every robot'}: {task}"
        self._folder = f"{FOLDER}/{checked_name(task, 'task')}/{name}"

    def history(self) -> list[Pointer]:
        """All of it.

        Raises:
            UnusableModel: a pointer is damaged or gone.

        """
        return [self._read(number) for number in range(1, self._last() + 1)]

    def newest(self) -> Pointer | None:
        """What holds now; None where nobody has said anything yet."""
        last = self._last()
        return self._read(last) if last else None

    def promote(self, model: str, who: str, why: str, check: Callable[[], None] = lambda: None) -> Pointer:
        """Let this model serve, after whatever is promoted at the same time; nothing new where it does.

        What `check` has found to be so when it raised nothing, of what is kept here, is so until then.

        Raises:
            UnusableModel: others promote without end.

        """
        for _ in range(ATTEMPTS):
            last = self._last()
            with contextlib.suppress(UnusableModel):  # a damaged one is what this remedies
                if last and (now := self._read(last)).model == model:
                    return now
            check()  # who changes something after that takes our number
            pointer = Pointer(model, datetime.now(UTC), who, why, before=last)
            if self._create(last + 1, pointer):
                return pointer
        raise UnusableModel(f"{self._whose}: {ATTEMPTS} times somebody else was faster")

    def target(self) -> Target:
        """What a rollback would go back to now.

        Raises:
            UnusableModel: nothing was before.

        """
        last = self._last()
        now = self._read(last) if last else None
        if now is None or not now.model:
            raise UnusableModel(f"{self._whose} has no model of its own, and so nothing to roll back from")
        if not now.before:
            return Target(last + 1, "", 0)
        back = self._read(now.before)
        return Target(last + 1, back.model, back.before)

    def roll_back(self, target: Target, who: str, why: str) -> Pointer:
        """Let that serve which did before.

        Raises:
            UnusableModel: somebody has changed what serves since `target` was asked for.

        """
        pointer = Pointer(target.model, datetime.now(UTC), who, why, target.before)
        if not self._create(target.number, pointer):
            raise UnusableModel(
                f"{self._whose}: somebody changed what serves just now; look, and say it again"
            )
        return pointer

    # --- inside

    def _last(self) -> int:
        names = map(_NUMBER.search, self._objects.names(self._folder))
        return max((int(name[1]) for name in names if name), default=0)

    def _create(self, number: int, pointer: Pointer) -> bool:
        return self._objects.create(self._path(number), msgspec.json.encode(pointer))

    def _read(self, number: int) -> Pointer:
        data = self._objects.read(self._path(number))
        if data is None:
            raise UnusableModel(f"{self._path(number)} is gone, which said what serves; promote a model anew")
        try:
            return msgspec.json.decode(data, type=Pointer)
        except msgspec.DecodeError as error:
            raise UnusableModel(f"{self._path(number)} is damaged: {error}; promote a model anew") from None

    def _path(self, number: int) -> str:
        return f"{self._folder}/{number:06}.json"
