"""The models of a store: published once and never altered, loaded only when everything about them is right.

models/<id>/model.skops, model.json
models/serving/<task>/<robot, or _all>/<n>.json
"""

import hashlib
from collections.abc import Iterator, Set
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec

from ml.errors import Overtaken, UnusableModel
from ml.registry.card import Card, checked_name, content_id, decoded, digest, encoded
from ml.registry.code import features_hash
from ml.registry.pointers import EVERY_ROBOT, Pointer, Pointers, RollbackTarget, Sign
from ml.registry.pointers import FOLDER as SERVING
from ml.robot.learned import Learned
from ml.store import Store, upkeep
from ml.store.objects import Object, Objects

FOLDER: Final = "models"
CARD: Final = "model.json"
SKOPS: Final = "model.skops"
SHIPPED: Final = Path(__file__).parents[1] / "shipped"  # models that come with GWRMS, laid out as in a store


class Serving(NamedTuple):
    """The model that serves; `pointer` is who said so for `robot` ("": all), `None`: it came with GWRMS."""

    model: str
    robot: str = ""
    pointer: Pointer | None = None


class Registry:
    """The models under a store's URL, and those that come with GWRMS; for one thread at a time.

    What is promoted or rolled back is signed by `sign`, where there is one.
    """

    def __init__(self, store_url: str, shipped: Path = SHIPPED, *, sign: Sign | None = None) -> None:
        self.url = store_url
        self._sign = sign
        self._objects = Objects(store_url)
        self._shipped = Objects(shipped.as_uri()) if shipped.is_dir() else None
        self._known: dict[str, Card] = {}  # a card never changes

    # --- models

    def publish(self, state: dict[str, Any], card: Card) -> str:
        """Put a model into the store, and keep the versions of tables that its card names; its id.

        The same model again, by whomever, is one model, and the first card stays.

        Raises:
            UnusableModel: state and card do not fit together, or something else has this model's name.
            StoreError: the store does not take it, or a table's version is not there.

        """
        from ml.registry import archive  # brings scikit-learn, which takes seconds: not for a look around

        data = archive.dump(state)
        card = msgspec.structs.replace(card, id="", sha256={SKOPS: hashlib.sha256(data).hexdigest()})
        card = msgspec.structs.replace(card, id=content_id(card))
        decoded(encoded(card))  # what cannot be read again, such as NaN, is refused now
        _check(card, state)
        for named in card.tables:
            upkeep.pin(Store.existing(named.store), named.location, named.version, card.id)
        self._create(card.id, SKOPS, data)
        self._create(card.id, CARD, encoded(card))  # last: now it is there
        return card.id

    def entries(self, task: str | None = None) -> list[Card]:
        """Return the models that can be looked at, oldest first, those that come with GWRMS before them."""
        cards = [card for card in map(self._card, self._ids()) if isinstance(card, Card)]
        shipped = self.shipped()
        cards = [card for card in cards if task in (None, card.task)]
        return sorted(cards, key=lambda card: (card.id not in shipped, card.made))

    def damaged(self) -> dict[str, str]:
        """Models whose card cannot be read, and why."""
        return {
            name: str(card) for name in self._ids() if isinstance(card := self._card(name), UnusableModel)
        }

    def card(self, model: str) -> Card:
        """Return the card of a model.

        Raises:
            UnusableModel: it is not there, or its card is damaged.

        """
        if model not in self._known:
            self._known[model] = self._read_card(model)
        return self._known[model]

    def load(self, model: str) -> tuple[Card, dict[str, Any]]:
        """Return a model, of which everything was verified: files, types, versions, the code of its features.

        Raises:
            UnusableModel: something is not as it must be; the message says what.

        """
        from ml.registry import archive

        card = self._read_card(model)
        data = self.file(model, SKOPS)
        try:
            if hashlib.sha256(data).hexdigest() != card.sha256.get(SKOPS):
                raise UnusableModel(f"{SKOPS} is not the file that was published: its SHA-256 is another")
            state = archive.load(data)
            _check(card, state)
        except UnusableModel as error:
            raise UnusableModel(f"{model}: {error}") from None
        return card, state

    def file(self, model: str, name: str) -> bytes:
        """One of a model's files; raises `UnusableModel` where it is not there."""
        path = f"{FOLDER}/{checked_name(model, 'model')}/{name}"
        for objects in self._places():
            data = objects.read(path)
            if data is not None:
                return data
        raise UnusableModel(f"{model}: there is no {name} of it in {self.url} (gwrms models ls lists models)")

    def files(self, model: str) -> list[Object]:
        """Return a model's files in the store as it lists them: other ones when something is written anew."""
        found = self._objects.listing(f"{FOLDER}/{checked_name(model, 'model')}")
        return sorted(found, key=lambda each: each.path)

    def shipped(self) -> frozenset[str]:
        """Return the models that come with GWRMS: they serve robots for which no other was promoted."""
        return frozenset(_ids(self._shipped))

    # --- which one serves

    def serving(self, task: str, robot: str = "", channels: Set[str] | None = None) -> str | None:
        """Return the model that serves a robot, as `served_to`."""
        found = self.served_to(task, robot, channels)
        return None if found is None else found.model

    def served_to(self, task: str, robot: str = "", channels: Set[str] | None = None) -> Serving | None:
        """Return the model that serves a robot: promoted for it, else for all, else a shipped one.

        With `channels` only a model that needs no other; without them, none that comes with GWRMS.

        Raises:
            UnusableModel: the model that should serve is gone, or its card is damaged.

        """
        for whose in dict.fromkeys((robot, "")):
            now = Pointers(self._objects, task, whose).newest()
            if now and now.model and (channels is None or channels >= set(self.card(now.model).channels)):
                return Serving(now.model, whose, now)
        fitting = [
            card
            for card in map(self.card, _ids(self._shipped))
            if card.task == task and channels is not None and channels >= set(card.channels)
        ]
        if not fitting:
            return None
        return Serving(max(fitting, key=lambda card: (len(card.channels), card.made)).id)

    def promote(self, model: str, robot: str = "", *, who: str, why: str, over: str | None = None) -> Pointer:
        """Let a model serve one robot, or all that have no model of their own.

        With `over` only in the place of that model, or of none where it is empty.

        Raises:
            Overtaken: another one than `over` serves now; it stays.
            UnusableModel: as `promotable`; what serves stays.

        """
        card = self.promotable(model, robot)
        if model in self.shipped():  # the next version of GWRMS may bring another in its place
            for name in (*card.sha256, CARD):
                self._create(model, name, self.file(model, name))
        check = partial(self._check_serves, card, robot, over)
        pointers, every = (self._pointers(card.task, whose) for whose in (robot, ""))
        if over is None or not robot:
            return pointers.promote(model, who, why, check, digest(card))
        own, before = pointers.newest(), every.newest()
        done = pointers.promote(model, who, why, check, digest(card))
        stood = done == own or (own is not None and own.model and own.model == over)
        if not stood and every.newest() != before:  # which does not take our number
            self._withdraw(pointers, done, over, every.newest())
        return done

    def promotable(self, model: str, robot: str = "") -> Card:
        """Return the card of a model that may be promoted.

        Raises:
            UnusableModel: it cannot be loaded, or was adapted to another robot.

        """
        card, _ = self.load(model)
        if card.robot not in ("", robot):
            raise UnusableModel(f"{model} was adapted to {card.robot}: promote it for that robot alone")
        return card

    def rollback(
        self, task: str, robot: str = "", *, who: str, why: str = "", to: str | None = None
    ) -> Pointer:
        """Let that serve which did before; after another rollback, what did before that.

        With `to` only where that is this model, or none where it is empty.

        Raises:
            Overtaken: it would go back to another one than `to` by now; what serves stays.
            UnusableModel: as `before`, or somebody else changed what serves at the same time; what serves
                stays.

        """
        target = self._target(task, robot)
        if to is not None and target.model != to:
            raise Overtaken(
                f"{task}: going back leads to {target.model or 'no model of its own'} by now, not to "
                f"{to or 'none'}: somebody changed what serves; look, and say it again"
            )
        content = digest(self.card(target.model)) if target.model else ""
        return self._pointers(task, robot).roll_back(target, who, why, content)

    def before(self, task: str, robot: str = "") -> str:
        """Return the model that a rollback leads to, or none ("").

        Raises:
            UnusableModel: nothing was before, or that model cannot be loaded any more.

        """
        return self._target(task, robot).model

    def history(self, task: str, robot: str = "") -> list[Pointer]:
        """Return the models that served, oldest first; raises `UnusableModel` if a pointer is damaged."""
        return Pointers(self._objects, task, robot).history()

    def served(self) -> Iterator[tuple[str, str, Pointer]]:
        """Yield the promoted models that serve now: tasks, robots ("" for all), pointers."""
        folders = {name.rpartition("/")[0] for name in self._objects.names(SERVING)}
        for folder in sorted(folders):
            task, robot = folder.split("/")[-2:]
            robot = "" if robot == EVERY_ROBOT else robot
            now = Pointers(self._objects, task, robot).newest()
            if now and now.model:
                yield task, robot, now

    # --- inside

    def _pointers(self, task: str, robot: str) -> Pointers:
        return Pointers(self._objects, task, robot, self._sign)

    def _target(self, task: str, robot: str) -> RollbackTarget:
        target = Pointers(self._objects, task, robot).target()
        if target.model:
            self.load(target.model)
        return target

    def _check_serves(self, card: Card, robot: str, over: str | None) -> None:
        if over is None:
            return
        now = self.serving(card.task, robot, set(card.channels)) or ""
        if now != over:
            raise Overtaken(
                f"{card.id} was to serve {robot or 'every robot'} in the place of {over or 'nothing'}, and "
                f"{now or 'nothing'} serves by now (gwrms models history {card.task}): train again, or "
                "gwrms models promote without --instead-of"
            )

    def _withdraw(self, pointers: Pointers, done: Pointer, over: str, now: Pointer | None) -> None:
        """Take back what was promoted while what serves every robot changed; raises `Overtaken`."""
        target = pointers.target()
        if pointers.newest() == done:  # else somebody has taken its place already
            content = digest(self.card(target.model)) if target.model else ""
            why = f"withdrawn: {over or 'nothing'} did not serve any more"
            pointers.roll_back(target, done.who, why, content)
        raise Overtaken(
            f"{done.model} was to serve in the place of {over or 'nothing'}, and "
            f"{(now and now.model) or 'nothing'} serves every robot by now: train again, or "
            "gwrms models promote without --instead-of"
        )

    def _places(self) -> Iterator[Objects]:
        yield self._objects
        if self._shipped is not None:
            yield self._shipped

    def _ids(self) -> list[str]:
        return list(dict.fromkeys(name for place in self._places() for name in _ids(place)))

    def _card(self, model: str) -> Card | UnusableModel:
        try:
            return self.card(model)
        except UnusableModel as error:
            return error

    def _read_card(self, model: str) -> Card:
        data = self.file(model, CARD)
        try:
            card = decoded(data)
        except UnusableModel as error:
            raise UnusableModel(f"{model}: {error}") from None
        if card.id != model:
            raise UnusableModel(f"{model}: its {CARD} is that of {card.id}")
        return card

    def _create(self, model: str, name: str, data: bytes) -> None:
        """Write a file, unless it is there; then it must be the same."""
        if self._objects.create(f"{FOLDER}/{model}/{name}", data):
            return
        same = self._read_card(model).id == model if name == CARD else self.file(model, name) == data
        if not same:
            raise UnusableModel(f"{model}: there is another {name} in {self.url} already")


def _ids(objects: Objects | None) -> list[str]:
    """Return the ids of the models with a card."""
    if objects is None:
        return []
    paths = [name.split("/") for name in objects.names(FOLDER)]
    return [path[1] for path in paths if len(path) == 3 and path[2] == CARD]


def _check(card: Card, state: dict[str, Any]) -> None:
    """Refuse a state that is not what the card says, or that this GWRMS would feed other features."""
    learned = Learned.restored(state)
    for what, said, found in (
        ("task", card.task, learned.task.name),
        ("recipe", card.recipe, learned.recipe.name),
        ("classes", card.classes, learned.classes),
        ("channels", card.channels, learned.recipe.channels),
        ("channels with a unit", sorted(card.units), sorted(card.channels)),
    ):
        if said != found:
            raise UnusableModel(f"the card and the model disagree about its {what}: {said}, and {found}")
    if card.features_hash != features_hash(learned.recipe):
        raise UnusableModel(
            f"the code that makes the features of {card.recipe} has changed since then: learn it again"
        )
