"""Effect of a promotion or rollback, shown before it is done; done only while it still holds."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from gateway.amounts import counted
from ml.registry.card import Card
from ml.registry.pointers import Pointer
from ml.registry.registry import Registry
from server_gui.core.models.catalogue import open_registry
from server_gui.core.models.comparison import headline, unknown_to
from server_gui.core.models.names import EVERY, model_names, task_name
from server_gui.core.settings.promoters import UNSIGNED, desk_signature

SOON: Final = "Servers that run take it within seconds, without a restart."
SIGNED: Final = "It is signed with this desk's key."
KEYLESS: Final = (
    f"This desk has no key, so it is {UNSIGNED}: its predictions cannot stop a robot. "
    "gwrms models key makes one."
)
OWN: Final = "A robot with a model of its own keeps that."
UNPROMOTED: Final = (
    "no promoted model; robots use the model that came with GWRMS, where it fits their sensors"
)


@dataclass(frozen=True, slots=True)
class ModelChange:
    """Change of the model that serves one robot, or all ("") without their own; None: no promoted model."""

    task: str
    robot: str
    now: Card | None
    then: Card | None
    is_rollback: bool
    names: Mapping[str, str]  # of models by their ids
    is_signed: bool  # whether this desk has a key to sign it with
    is_anew: bool = False  # what serves unsigned is said again, signed
    lost: str = ""  # which classes what serves now knows, and that model does not, in a sentence
    judged: str = ""  # what its training said of it, where this window knows

    @property
    def changes_nothing(self) -> bool:
        """Whether that serves already."""
        same = self.now is not None and self.then is not None and self.now.id == self.then.id
        return same and not self.is_anew

    @property
    def outcome(self) -> str:
        """Return the state afterwards, in words."""
        then = "no model of its own" if self.then is None else self.names[self.then.id]
        return f"{task_name(self.task)}: {then} serves {self.robot or EVERY}"

    @property
    def title(self) -> str:
        """Return the question."""
        what = "Roll back" if self.is_rollback else "Promote"
        return f"{what}: {task_name(self.task)} for {self.robot or EVERY}"

    @property
    def sentences(self) -> tuple[str, ...]:
        """Return the effects of the change, in words."""
        return tuple(self._sentences())

    def _sentences(self) -> Iterator[str]:
        if self.changes_nothing:
            yield f"{self._told(self.now)} serves {self.robot or EVERY} already: nothing changes."
            return
        yield f"Serves now: {self._told(self.now)}."
        yield f"Will serve: {self._told(self.then)}."
        if self.judged:
            yield f"Training has judged it: {self.judged}"
        if self.then is None:
            yield "What serves then is what does so for every robot, or what came with GWRMS."
        yield f"{SOON} {'' if self.robot else OWN}".rstrip()
        if self.then is not None:
            yield SIGNED if self.is_signed else KEYLESS

    def _told(self, card: Card | None) -> str:
        if card is None:
            return "no model of its own" if self.robot else UNPROMOTED
        people = len(card.metrics.per_subject)
        whom = f"{counted(people, 'person', 'people')} never seen" if people else "people never seen"
        return f"{self.names[card.id]} ({headline(card)} on {whom})"


def promotion(url: str, model: str, robot: str) -> ModelChange:
    """Return the effect of promoting a model for a robot, or for all; blocks.

    Raises:
        UnusableModel: it is refused, as `gwrms models promote` refuses it.
        StoreError: the store cannot be read.

    """
    registry = open_registry(url)
    card = registry.promotable(model, robot)
    now = registry.serving(card.task, robot, set(card.channels))
    anew = _signs() and _serves_unsigned(registry, card, robot)
    lost = loss(registry, card, robot)
    held = _card(registry, now)
    return ModelChange(card.task, robot, held, card, False, _names(registry), _signs(), anew, lost)


def way_back(url: str, task: str, robot: str) -> ModelChange:
    """Return the effect of a rollback; blocks.

    Raises:
        UnusableModel: it is refused, as `gwrms models rollback` refuses it.
        StoreError: the store cannot be read.

    """
    registry = open_registry(url)
    before = registry.before(task, robot)
    now = registry.serving(task, robot)
    then = _card(registry, before)
    lost = "" if then is None else loss(registry, then, robot)
    held = _card(registry, now)
    return ModelChange(task, robot, held, then, True, _names(registry), _signs(), lost=lost)


def loss(registry: Registry, then: Card, robot: str) -> str:
    """Return which classes would be lost if this model served, in a sentence; "" where none is.

    Where none was promoted, robots use what came with GWRMS; blocks.
    """
    now = registry.serving(then.task, robot)
    shipped = (card for card in map(registry.card, registry.shipped()) if card.task == then.task)
    return unknown_to(then, shipped if now is None else [registry.card(now)], "what serves now")


def carry_out(url: str, change: ModelChange, who: str, why: str) -> Pointer:
    """Carry out a confirmed change; blocks.

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


def _serves_unsigned(registry: Registry, card: Card, robot: str) -> bool:
    history = registry.history(card.task, robot)
    return bool(history) and history[-1].model == card.id and not history[-1].signature


def _signs() -> bool:
    return desk_signature() is not None


def _names(registry: Registry) -> Mapping[str, str]:
    return model_names(registry.entries(), registry.shipped())


def _card(registry: Registry, model: str | None) -> Card | None:
    return registry.card(model) if model else None
