"""What a promotion or a way back would change, said before it is done; done only while that is still so."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from ml.registry.card import Card
from ml.registry.pointers import Pointer
from ml.registry.registry import Registry
from server_gui.core.models.catalogue import open_registry
from server_gui.core.models.comparison import headline
from server_gui.core.models.names import EVERY, model_names, task_name

SOON: Final = "Servers that run take it within seconds, without a restart."
OWN: Final = "A robot with a model of its own keeps that."


@dataclass(frozen=True, slots=True)
class Change:
    """Of what serves one robot, or all ("") that have no model of their own; None: no promoted model."""

    task: str
    robot: str
    now: Card | None
    then: Card | None
    is_rollback: bool
    names: Mapping[str, str]  # of models by their ids

    @property
    def changes_nothing(self) -> bool:
        """Whether that serves already."""
        return self.now is not None and self.then is not None and self.now.id == self.then.id

    @property
    def outcome(self) -> str:
        """Return what is so afterwards."""
        then = "no model of its own" if self.then is None else self.names[self.then.id]
        return f"{task_name(self.task)}: {then} serves {self.robot or EVERY}"

    @property
    def title(self) -> str:
        """Return the question."""
        what = "Roll back" if self.is_rollback else "Promote"
        return f"{what}: {task_name(self.task)} for {self.robot or EVERY}"

    @property
    def sentences(self) -> tuple[str, ...]:
        """Return what changes."""
        return tuple(self._sentences())

    def _sentences(self) -> Iterator[str]:
        if self.changes_nothing:
            yield f"{self._told(self.now)} serves {self.robot or EVERY} already: nothing changes."
            return
        yield f"Serves now: {self._told(self.now)}."
        yield f"Will serve: {self._told(self.then)}."
        if self.then is None:
            yield "What serves then is what does so for every robot, or what came with GWRMS."
        yield f"{SOON} {'' if self.robot else OWN}".rstrip()

    def _told(self, card: Card | None) -> str:
        if card is None:
            return f"no model {'of its own' if self.robot else 'that somebody has promoted'}"
        return f"{self.names[card.id]} ({headline(card)} on people never seen)"


def promotion(url: str, model: str, robot: str) -> Change:
    """What it would change to let a model serve a robot, or all; blocks.

    Raises:
        UnusableModel: it is refused, as `gwrms models promote` refuses it.
        StoreError: the store cannot be read.

    """
    registry = open_registry(url)
    card = registry.promotable(model, robot)
    now = registry.serving(card.task, robot, set(card.channels))
    return Change(card.task, robot, _card(registry, now), card, False, _names(registry))


def way_back(url: str, task: str, robot: str) -> Change:
    """What a rollback would change; blocks.

    Raises:
        UnusableModel: it is refused, as `gwrms models rollback` refuses it.
        StoreError: the store cannot be read.

    """
    registry = open_registry(url)
    before = registry.before(task, robot)
    now = registry.serving(task, robot)
    return Change(task, robot, _card(registry, now), _card(registry, before), True, _names(registry))


def carry_out(url: str, change: Change, who: str, why: str) -> Pointer:
    """Do what was confirmed; blocks.

    Raises:
        Overtaken: something else serves by now than what was confirmed; that stays.
        UnusableModel: it is refused.
        StoreError: the store cannot be written.

    """
    registry = open_registry(url)
    now = "" if change.now is None else change.now.id
    if change.is_rollback:
        to = "" if change.then is None else change.then.id
        return registry.rollback(change.task, change.robot, who=who, why=why, to=to)
    if change.then is None:
        raise ValueError("a promotion is of a model")
    return registry.promote(change.then.id, change.robot, who=who, why=why, over=now)


def _names(registry: Registry) -> Mapping[str, str]:
    return model_names(registry.entries(), registry.shipped())


def _card(registry: Registry, model: str | None) -> Card | None:
    return registry.card(model) if model else None
