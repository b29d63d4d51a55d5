"""What serves is changed only as it was confirmed; what the command refuses, the window refuses."""

from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import msgspec
import pytest

from ml.errors import Overtaken, UnusableModel
from ml.registry.card import Card
from ml.registry.registry import FOLDER, SKOPS, Registry
from ml.store import StoreError
from ml.store.objects import Objects
from server_gui.core.models.catalogue import Looking, open_registry
from server_gui.core.models.changes import carry_out, promotion, way_back
from server_gui.core.models.models import Models, Tone
from server_gui.core.models.training import Trained
from server_gui.core.settings.promoters import own_line
from tests.support.waiting import until
from tests.unit.registry.models import card, learned
from tests.unit.registry.test_registry import NOWHERE


@pytest.fixture
def registry(
    store_libraries: None, folder_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Registry:
    monkeypatch.setattr(Registry.__init__, "__defaults__", (NOWHERE,))
    (tmp_path / "store").mkdir(exist_ok=True)
    made = Registry(folder_url)
    publish(made)
    return made


def publish(registry: Registry, seed: int = 0, **changes: object) -> Card:
    model = learned(seed=seed)
    return registry.card(registry.publish(model.state(), card(model, **changes)))


def test_a_promotion_says_what_serves_now_and_what_will(registry: Registry) -> None:
    one, other = publish(registry), publish(registry, 1)
    first = promotion(registry.url, one.id, "")
    assert first.sentences[0] == (
        "Serves now: no promoted model; robots use the model that came with GWRMS, "
        "where it fits their sensors."
    )
    assert registry.history("falling") == []
    carry_out(registry.url, first, "Ada", "a test")
    second = promotion(registry.url, other.id, "")
    assert (second.now and second.now.id, second.then and second.then.id) == (one.id, other.id)
    assert one.id.rpartition("-")[2] not in " ".join(second.sentences)
    assert registry.serving("falling") == one.id
    assert promotion(registry.url, one.id, "").changes_nothing


def test_what_was_confirmed_is_refused_where_another_serves_meanwhile(registry: Registry) -> None:
    one, other, third = publish(registry), publish(registry, 1), publish(registry, notes="third")
    registry.promote(one.id, who="Ada", why="")
    change = promotion(registry.url, other.id, "")
    registry.promote(third.id, who="Bob", why="faster")
    with pytest.raises(Overtaken, match=f"{third.id} serves by now"):
        carry_out(registry.url, change, "Ada", "")
    assert registry.serving("falling") == third.id


def test_a_way_back_leads_where_it_said_or_nowhere(registry: Registry) -> None:
    one, other, third = publish(registry), publish(registry, 1), publish(registry, notes="third")
    for model in (one, other):
        registry.promote(model.id, who="Ada", why="")
    change = way_back(registry.url, "falling", "")
    assert (change.now and change.now.id, change.then and change.then.id) == (other.id, one.id)
    registry.promote(third.id, who="Bob", why="faster")
    with pytest.raises(Overtaken, match="going back leads to"):
        carry_out(registry.url, change, "Ada", "")
    assert registry.serving("falling") == third.id
    carry_out(registry.url, way_back(registry.url, "falling", ""), "Ada", "")
    assert registry.serving("falling") == other.id


def test_what_the_command_refuses_is_refused_before_anything_is_confirmed(registry: Registry) -> None:
    own, bad = publish(registry, robot="exo-01"), publish(registry, 1)
    Objects(registry.url).write(f"{FOLDER}/{bad.id}/{SKOPS}", [b"\x80\x04."])
    with pytest.raises(UnusableModel, match="was adapted to exo-01"):
        promotion(registry.url, own.id, "")
    with pytest.raises(UnusableModel, match="SHA-256"):
        promotion(registry.url, bad.id, "")
    with pytest.raises(UnusableModel, match="nothing to roll back from"):
        way_back(registry.url, "falling", "")
    with pytest.raises(StoreError, match="there is no store at"):
        promotion(f"{registry.url}-typo", own.id, "")


def test_a_look_says_whom_each_serves_and_what_is_damaged(registry: Registry) -> None:
    one, gone = publish(registry), publish(registry, 1)
    registry.promote(one.id, who="Ada", why="")
    registry.promote(one.id, "exo-01", who="Ada", why="")
    Objects(registry.url).write(f"{FOLDER}/{gone.id}/model.json", [b"{}"])
    found = Looking(registry.url).look({"exo-01"})
    (entry,) = found.entries
    assert (set(entry.serves), entry.serving) == ({"every robot", "exo-01"}, one.id)
    assert entry.signature == "unsigned"
    assert gone.id in found.damaged[0]
    assert found.hits_problem  # nothing was ever uploaded to this store, and that is said


def test_what_a_desk_with_a_key_promotes_is_said_to_be_signed_before_and_after(
    registry: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    one = publish(registry)
    assert "has no key, so it is unsigned" in promotion(registry.url, one.id, "").sentences[-1]
    registry.promote(one.id, who="Ada", why="before there was a key")
    _, key = own_line()
    registry.promote(one.id, "exo-01", who="Ada", why="likewise")
    change = promotion(registry.url, one.id, "exo-01")
    assert change.sentences[-1] == "It is signed with this desk's key."
    assert not change.changes_nothing
    carry_out(registry.url, change, "Ada", "")
    assert promotion(registry.url, one.id, "exo-01").changes_nothing
    (entry,) = Looking(registry.url).look(set()).entries
    assert set(entry.signature.split("; ")) == {"every robot: unsigned", f"exo-01: signed by {key[:16]}…"}
    (entry,) = Looking(registry.url, {"anna": key}).look(set()).entries
    assert "exo-01: signed by anna" in entry.signature


def test_a_store_that_is_gone_is_a_problem_in_words(
    registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    def away(self: Registry, task: str | None = None) -> list[Card]:
        raise StoreError("s3://lab cannot be reached: Connection refused")

    monkeypatch.setattr(Registry, "entries", away)
    found = Looking(registry.url).look(set())
    assert (found.entries, found.problem) == ((), "s3://lab cannot be reached: Connection refused")


def test_a_store_whose_folder_has_gone_is_no_new_one_without_models(
    registry: Registry, tmp_path: Path
) -> None:
    publish(registry)
    looking = Looking(registry.url)
    assert len(looking.look(set()).entries) == 1
    folder = Path(urlsplit(registry.url).path)
    folder.rename(tmp_path / "elsewhere")
    found = looking.look(set())
    assert (found.entries, found.problem) == ((), f"there is no store at {registry.url}")
    assert Looking(registry.url).look(set()).problem == "", "it may be one that nothing was put into yet"


# --- as the window has it


class Desk:
    """The window's thread."""

    def __init__(self, url: str) -> None:
        self.posted: list[Callable[[], None]] = []
        self.models = Models(url, self.posted.append, lambda: {"exo-01"}, "Ada")

    def until(self, so: Callable[[], object]) -> None:
        def done() -> bool:
            while self.posted:
                self.posted.pop(0)()
            return bool(so())

        until(done)


@pytest.fixture
def desk(registry: Registry) -> Iterator[Desk]:
    made = Desk(registry.url)
    yield made
    assert made.models.close(30.0)


def test_what_was_found_stays_with_its_time_while_the_store_is_away(
    desk: Desk, registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    publish(registry)
    models = desk.models

    def look() -> None:
        before = models.revision
        models.look(now=True)
        desk.until(lambda: models.revision > before)

    look()
    known_s = models.known_s
    assert known_s is not None
    models.reach.problem = "Connection refused"
    monkeypatch.setattr(Registry, "entries", lambda *_: [])  # what is left without it
    look()
    assert (len(models.found.entries), models.known_s) == (1, known_s)
    assert not models.is_reached
    models.reach.problem = None
    look()
    assert models.found.entries == ()
    assert models.is_reached
    assert models.known_s > known_s


def test_nothing_is_promoted_before_it_is_confirmed(desk: Desk, registry: Registry) -> None:
    model = publish(registry).id
    desk.models.ask_promotion(model, "")
    desk.until(lambda: desk.models.change)
    assert registry.history("falling") == []
    desk.models.forget()
    desk.models.confirm()
    assert (desk.models.change, registry.history("falling")) == (None, [])
    desk.models.ask_promotion(model, "")
    desk.until(lambda: desk.models.change)
    desk.models.confirm("stairs too")
    desk.until(lambda: desk.models.tone is Tone.GOOD)
    (pointer,) = registry.history("falling")
    assert (pointer.model, pointer.who, pointer.why) == (model, "Ada", "stairs too")
    desk.models.ask_promotion(model, "")
    desk.until(lambda: "nothing changes" in desk.models.said)
    assert desk.models.change is None


def test_what_was_judged_not_better_is_not_promoted(desk: Desk, registry: Registry) -> None:
    model = publish(registry).id
    desk.models.trained[model] = Trained(model, "not better", ("macro_f1 on held-out people: 0.5",))
    desk.models.ask_promotion(model, "")
    assert desk.models.tone is Tone.BAD
    assert "is not better: F1 on held-out people: 0.5" in desk.models.said
    assert not desk.models.said.startswith("Looking")
    assert registry.history("falling") == []


def test_a_refusal_is_said_in_the_words_of_the_command(desk: Desk) -> None:
    desk.models.ask_rollback("activity", "exo-01")
    desk.until(lambda: desk.models.tone is Tone.BAD)
    assert desk.models.said == (
        "Refused: exo-01: activity has no model of its own, and so nothing to roll back from"
    )


def test_a_registry_of_a_folder_that_is_given_must_be_there(tmp_path: Path) -> None:
    nowhere = (tmp_path / "typo").as_uri()
    with pytest.raises(StoreError, match="there is no store at"):
        open_registry(nowhere)
    assert not (tmp_path / "typo").exists()


def test_a_promotion_names_the_classes_that_what_serves_knows_and_the_new_one_does_not(
    registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, other = publish(registry), publish(registry, 1)
    registry.promote(one.id, who="Ada", why="")
    known = Registry.card
    wider = msgspec.structs.replace(one, classes=(*one.classes, "sit_to_stand", "stairs"))
    monkeypatch.setattr(Registry, "card", lambda self, it: wider if it == one.id else known(self, it))
    said = "It does not know sit to stand, stairs; what serves now does."
    assert promotion(registry.url, other.id, "").lost.startswith(said)
    registry.promote(other.id, who="Ada", why="")
    assert not way_back(registry.url, "falling", "").lost


def test_where_none_was_promoted_classes_of_what_came_with_gwrms_are_lost(
    registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, came = publish(registry), publish(registry, 1)
    known = Registry.card
    wider = msgspec.structs.replace(came, classes=(*came.classes, "stairs"))
    monkeypatch.setattr(Registry, "shipped", lambda _: frozenset({came.id}))
    monkeypatch.setattr(Registry, "card", lambda self, it: wider if it == came.id else known(self, it))
    assert "does not know stairs" in promotion(registry.url, one.id, "").lost
