"""Pointers to the serving model and those before it: numbered objects, written once and never altered.

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


Sign = Callable[[bytes], tuple[str, str]]  # who signs a message: certificate (PEM) and signature (base64)
_KIND: Final = b"gwrms model serves 1\n"  # what else is signed with such a key begins with other words


class Pointer(Struct, frozen=True):
    """From `utc` on this model serves, or none where `model` is empty; a rollback goes to number `before`.

    Who said so has signed it, where they had a key: for a task and robot, in this place of the history, a
    model with this content (`card.digest`).
    """

    model: str
    utc: datetime
    who: str
    why: str
    before: int  # 0: nothing
    number: int = 0  # its own; 0: from before these were signed
    content: str = ""
    certificate: str = ""
    signature: str = ""

    def message(self, task: str, robot: str) -> bytes:
        """Return the bytes to be signed."""
        bare = msgspec.structs.replace(self, certificate="", signature="")
        return _KIND + msgspec.json.encode([task, robot, bare])


class RollbackTarget(NamedTuple):
    """Target of a rollback: the number that it writes, a model or "", and the one before that."""

    number: int
    model: str
    before: int


class Pointers:
    """The history of one task for one robot, or for all (`robot` is empty), oldest first."""

    def __init__(self, objects: Objects, task: str, robot: str = "", sign: Sign | None = None) -> None:
        name = checked_name(robot, "robot") if robot else EVERY_ROBOT
        self._objects = objects
        self._of = task, robot
        self._sign = sign
        self._whose = f"{robot or 'every robot'}: {task}"
        self._folder = f"{FOLDER}/{checked_name(task, 'task')}/{name}"

    def history(self) -> list[Pointer]:
        """Return all of it.

        Raises:
            UnusableModel: a pointer is damaged or gone.

        """
        return [self._read(number) for number in range(1, self._last() + 1)]

    def newest(self) -> Pointer | None:
        """Return the valid pointer; None if there is none yet."""
        last = self._last()
        return self._read(last) if last else None

    def promote(
        self, model: str, who: str, why: str, check: Callable[[], None] = lambda: None, content: str = ""
    ) -> Pointer:
        """Let this model serve, after whatever is promoted at the same time; nothing new where it does.

        What serves unsigned is said again, signed, where there is somebody who signs.

        What `check` has found to be so when it raised nothing, of what is kept here, is so until then.

        Raises:
            UnusableModel: others promote without end.

        """
        for _ in range(ATTEMPTS):
            last = self._last()
            with contextlib.suppress(UnusableModel):  # a damaged one is what this remedies
                now = self._read(last) if last else None
                if now is not None and now.model == model and (now.signature or self._sign is None):
                    return now
            check()  # who changes something after that takes our number
            pointer = Pointer(model, datetime.now(UTC), who, why, last, last + 1, content)
            if (done := self._create(pointer)) is not None:
                return done
        raise UnusableModel(f"{self._whose}: {ATTEMPTS} times somebody else was faster")

    def target(self) -> RollbackTarget:
        """Return the target of a rollback.

        Raises:
            UnusableModel: nothing was before.

        """
        last = self._last()
        now = self._read(last) if last else None
        if now is None or not now.model:
            raise UnusableModel(f"{self._whose} has no model of its own, and so nothing to roll back from")
        if not now.before:
            return RollbackTarget(last + 1, "", 0)
        back = self._read(now.before)
        return RollbackTarget(last + 1, back.model, back.before)

    def roll_back(self, target: RollbackTarget, who: str, why: str, content: str = "") -> Pointer:
        """Let that serve which did before.

        Raises:
            UnusableModel: somebody has changed what serves since `target` was asked for.

        """
        now = datetime.now(UTC)
        done = self._create(Pointer(target.model, now, who, why, target.before, target.number, content))
        if done is None:
            raise UnusableModel(
                f"{self._whose}: somebody changed what serves just now; look, and say it again"
            )
        return done

    # --- inside

    def _last(self) -> int:
        names = map(_NUMBER.search, self._objects.names(self._folder))
        return max((int(name[1]) for name in names if name), default=0)

    def _create(self, pointer: Pointer) -> Pointer | None:
        """Sign and write it; `None` where somebody else has taken its number."""
        if self._sign is not None:
            certificate, signature = self._sign(pointer.message(*self._of))
            pointer = msgspec.structs.replace(pointer, certificate=certificate, signature=signature)
        return (
            pointer
            if self._objects.create(self._path(pointer.number), msgspec.json.encode(pointer))
            else None
        )

    def _read(self, number: int) -> Pointer:
        data = self._objects.read(self._path(number))
        if data is None:
            raise UnusableModel(f"{self._path(number)} is gone, which said what serves; promote a model anew")
        try:
            found = msgspec.json.decode(data, type=Pointer)
        except msgspec.DecodeError as error:
            raise UnusableModel(f"{self._path(number)} is damaged: {error}; promote a model anew") from None
        if found.number not in (0, number):
            raise UnusableModel(f"{self._path(number)} is that of {found.number}; promote a model anew")
        return found

    def _path(self, number: int) -> str:
        return f"{self._folder}/{number:06}.json"
