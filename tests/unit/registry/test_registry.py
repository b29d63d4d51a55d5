"""The registry on a folder and on S3: published once, verified when loaded; what serves, and what did."""

import hashlib
import threading
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from ml.errors import Overtaken, UnusableModel
from ml.registry import archive
from ml.registry.card import Card, DataSource, Metrics, TableVersion, content_id, encoded
from ml.registry.pointers import Pointers
from ml.registry.registry import CARD, FOLDER, SKOPS, Registry
from ml.robot.learned import Learned
from ml.store import NoSuchTable, Store
from ml.store.objects import Objects
from ml.store.upkeep import compact, pins, vacuum
from tests.unit.registry.models import CHANNELS, card, features, learned
from tests.unit.store.test_store import HERE
from tests.unit.store.test_upkeep import filled

BY = {"who": "Ada", "why": "better"}
NOWHERE = Path("/nowhere")


@pytest.fixture
def in_folder(folder_url: str) -> Registry:
    return Registry(folder_url, NOWHERE)


def published(registry: Registry, seed: int = 0, **changes: Any) -> str:
    model = learned(seed=seed)
    return registry.publish(model.state(), card(model, **changes))


def replace(registry: Registry, model: str, name: str, data: bytes) -> None:
    """As somebody would who has the store's keys."""
    Objects(registry.url).write(f"{FOLDER}/{model}/{name}", [data])


def serves(registry: Registry, robot: str = "") -> str | None:
    return Registry(registry.url, NOWHERE).serving("falling", robot)


# --- publish and load


def test_a_model_comes_back_from_the_store_as_it_was(store_url: str) -> None:
    registry = Registry(store_url, NOWHERE)  # not a fixture: its connections end with it
    model = published(registry, notes="stairs")
    again = Registry(registry.url, NOWHERE)
    found, state = again.load(model)
    assert found.notes == "stairs"
    assert found.id == model
    assert model.startswith("falling-")
    rows, _ = features()
    verdicts = Learned.restored(state).judge(rows)
    np.testing.assert_array_equal(verdicts.probabilities, learned().judge(rows).probabilities)
    assert again.entries() == [found]
    assert again.entries("activity") == []


def test_what_differs_in_more_than_its_time_is_another_model(in_folder: Registry) -> None:
    now = datetime.now(UTC)
    same = {published(in_folder, made=now), published(in_folder, made=now + timedelta(days=1))}
    others = {
        published(in_folder, seed=1),
        published(in_folder, robot="exo-01"),
        published(in_folder, seed=0),
    }
    assert len(same) == 1
    assert len(same | others) == 3
    assert in_folder.card(same.pop()).made == now


def test_two_publishers_of_one_model_both_succeed(store_url: str) -> None:
    registry = Registry(store_url, NOWHERE)  # not a fixture: its connections end with it
    start = threading.Barrier(4)

    def publish(number: int) -> str:
        own = Registry(registry.url, NOWHERE)
        made = datetime.now(UTC) + timedelta(seconds=number)
        start.wait()
        return published(own, made=made)

    learned()
    with ThreadPoolExecutor(4) as pool:
        names = set(pool.map(publish, range(4)))
    assert len(names) == 1
    assert registry.load(names.pop())[0].task == "falling"


def test_a_publisher_that_was_killed_can_say_it_again(in_folder: Registry) -> None:
    model = published(in_folder)
    Objects(in_folder.url).remove(f"{FOLDER}/{model}/{CARD}")
    other = Registry(in_folder.url, NOWHERE)
    assert other.entries() == []
    with pytest.raises(UnusableModel, match=f"no {CARD} of it"):
        other.load(model)
    assert published(other) == model
    assert [found.id for found in other.entries()] == [model]


def test_a_name_that_is_taken_by_another_file_is_refused(in_folder: Registry) -> None:
    model = published(in_folder)
    replace(in_folder, model, SKOPS, b"something else")
    with pytest.raises(UnusableModel, match="there is another"):
        published(in_folder)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"task": "activity"}, "its task"),
        ({"classes": ("fall", "steady")}, "its classes"),
        ({"channels": ("trunk.tilt_forward",)}, "its channels"),
        ({"units": {}}, "channels with a unit"),
        ({"features_hash": "0" * 64}, "has changed since"),
    ],
)
def test_a_card_of_another_model_is_not_published(
    in_folder: Registry, changes: dict[str, Any], said: str
) -> None:
    with pytest.raises(UnusableModel, match=said):
        published(in_folder, **changes)
    assert in_folder.entries() == []


def test_a_card_that_could_not_be_read_again_is_not_published(in_folder: Registry) -> None:
    with pytest.raises(UnusableModel, match="card: Expected"):
        published(in_folder, metrics=Metrics({"macro_f1": float("nan")}))
    assert not in_folder.damaged()


# --- what is refused when it is loaded; what serves stays


def forged(registry: Registry, found: Card, data: bytes) -> str:
    """Another card with a proper id, and its file: as somebody would who knows how."""
    made = msgspec.structs.replace(found, id="")
    made = msgspec.structs.replace(made, id=content_id(made))
    replace(registry, made.id, CARD, encoded(made))
    replace(registry, made.id, SKOPS, data)
    return made.id


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        (SKOPS, b"", "SHA-256"),
        (SKOPS, b"\x80\x04N.", "SHA-256"),
        (CARD, b"", "no model's card"),
        (CARD, b'{"task": "falling"}', "no model's card"),
        (CARD, b"[" * 100_000, "no model's card"),
    ],
)
def test_a_file_that_was_replaced_is_refused_and_what_serves_stays(
    in_folder: Registry, name: str, data: bytes, said: str
) -> None:
    good, bad = published(in_folder), published(in_folder, seed=1)
    in_folder.promote(good, **BY)
    replace(in_folder, bad, name, data)
    fresh = Registry(in_folder.url, NOWHERE)
    for attempt in (fresh.load, lambda model: fresh.promote(model, **BY)):
        with pytest.raises(UnusableModel, match=f"{bad}.*{said}"):
            attempt(bad)
    assert serves(in_folder) == good
    assert good in {found.id for found in fresh.entries()}
    assert (bad in fresh.damaged()) == (name == CARD)


def test_a_card_that_was_altered_is_refused(store_url: str) -> None:
    registry = Registry(store_url, NOWHERE)  # not a fixture: its connections end with it
    model = published(registry)
    altered = msgspec.structs.replace(registry.card(model), units=dict.fromkeys(CHANNELS, "deg"))
    replace(registry, model, CARD, encoded(altered))
    with pytest.raises(UnusableModel, match="altered since it was published"):
        Registry(registry.url, NOWHERE).load(model)


def test_a_card_in_the_place_of_another_is_refused(in_folder: Registry) -> None:
    one, other = published(in_folder), published(in_folder, seed=1)
    replace(in_folder, one, CARD, in_folder.file(other, CARD))
    with pytest.raises(UnusableModel, match=f"is that of {other}"):
        Registry(in_folder.url, NOWHERE).load(one)


def test_a_card_of_a_later_format_is_refused(in_folder: Registry) -> None:
    found = in_folder.card(published(in_folder))
    model = forged(in_folder, msgspec.structs.replace(found, format=2), b"")
    with pytest.raises(UnusableModel, match="format 2"):
        in_folder.load(model)


def test_a_model_for_features_that_are_computed_otherwise_now_is_refused(in_folder: Registry) -> None:
    model = published(in_folder)
    other = msgspec.structs.replace(in_folder.card(model), features_hash="0" * 64)
    with pytest.raises(UnusableModel, match="has changed since then: learn it again"):
        in_folder.load(forged(in_folder, other, in_folder.file(model, SKOPS)))


def test_a_state_that_is_no_model_of_ours_is_refused(in_folder: Registry) -> None:
    found = in_folder.card(published(in_folder))
    data = archive.dump({"task": "falling"})
    other = msgspec.structs.replace(found, sha256={SKOPS: hashlib.sha256(data).hexdigest()})
    with pytest.raises(UnusableModel, match="recipe"):
        in_folder.load(forged(in_folder, other, data))


@pytest.mark.parametrize("name", ["", "../../etc", "falling-0/..", "a/b"])
def test_a_name_that_is_a_path_is_refused(in_folder: Registry, name: str) -> None:
    with pytest.raises(UnusableModel, match="no name of a model"):
        in_folder.load(name)


# --- what serves


def test_a_robots_own_model_comes_before_that_for_all(store_url: str) -> None:
    registry = Registry(store_url, NOWHERE)  # not a fixture: its connections end with it
    one, other = published(registry), published(registry, robot="exo-01")
    assert serves(registry) is None
    registry.promote(one, **BY)
    registry.promote(other, "exo-01", **BY)
    assert serves(registry) == serves(registry, "exo-02") == one
    assert serves(registry, "exo-01") == other
    assert [(task, robot, now.model) for task, robot, now in registry.served()] == [
        ("falling", "", one),
        ("falling", "exo-01", other),
    ]


def test_a_model_adapted_to_one_robot_serves_no_other(in_folder: Registry) -> None:
    model = published(in_folder, robot="exo-01")
    for robot in ("", "exo-02"):
        with pytest.raises(UnusableModel, match="adapted to exo-01"):
            in_folder.promote(model, robot, **BY)
    assert serves(in_folder) is None


def test_a_model_is_not_offered_to_a_robot_without_its_channels(in_folder: Registry) -> None:
    model = published(in_folder)
    in_folder.promote(model, **BY)
    assert in_folder.serving("falling", "exo-01", CHANNELS | {"more"}) == model
    assert in_folder.serving("falling", "exo-01", frozenset({"left_hip.position"})) is None


def test_rollback_after_rollback_goes_back_step_by_step(store_url: str) -> None:
    registry = Registry(store_url, NOWHERE)  # not a fixture: its connections end with it
    models = [published(registry, seed=seed) for seed in range(3)]
    for model in models:
        registry.promote(model, **BY)
    for expected in (models[1], models[0], None):
        registry.rollback("falling", who="Ada")
        assert serves(registry) == expected
    with pytest.raises(UnusableModel, match="nothing to roll back"):
        registry.rollback("falling", who="Ada")
    registry.promote(models[2], **BY)
    registry.rollback("falling", who="Ada")
    assert serves(registry) is None
    assert [now.model for now in registry.history("falling")] == [
        *models,
        models[1],
        models[0],
        "",
        models[2],
        "",
    ]


def test_a_model_that_is_promoted_again_is_no_step_to_roll_back(in_folder: Registry) -> None:
    one, other = published(in_folder), published(in_folder, seed=1)
    for model in (one, other, other):
        in_folder.promote(model, **BY)
    in_folder.rollback("falling", who="Ada")
    assert serves(in_folder) == one


def test_files_that_are_no_pointers_do_not_count(in_folder: Registry) -> None:
    Objects(in_folder.url).write(f"{FOLDER}/serving/falling/_all/README", [b"hello"])
    assert serves(in_folder) is None
    in_folder.promote(published(in_folder), **BY)
    assert [now.before for now in in_folder.history("falling")] == [0]


def test_a_rollback_of_a_robots_own_first_model_gives_it_that_for_all(in_folder: Registry) -> None:
    one, other = published(in_folder), published(in_folder, seed=1)
    in_folder.promote(one, **BY)
    in_folder.promote(other, "exo-01", **BY)
    in_folder.rollback("falling", "exo-01", who="Ada")
    assert serves(in_folder, "exo-01") == one


def test_a_rollback_to_a_model_that_is_gone_is_refused_and_what_serves_stays(in_folder: Registry) -> None:
    one, other = published(in_folder), published(in_folder, seed=1)
    in_folder.promote(one, **BY)
    in_folder.promote(other, **BY)
    Objects(in_folder.url).remove(f"{FOLDER}/{one}/{SKOPS}")
    with pytest.raises(UnusableModel, match=one):
        in_folder.rollback("falling", who="Ada")
    assert serves(in_folder) == other


def test_a_pointer_to_a_model_that_is_gone_is_told(in_folder: Registry) -> None:
    model = published(in_folder)
    in_folder.promote(model, **BY)
    Objects(in_folder.url).remove(f"{FOLDER}/{model}/{CARD}")
    fresh = Registry(in_folder.url, NOWHERE)
    with pytest.raises(UnusableModel, match=model):
        fresh.serving("falling", "exo-01", CHANNELS)
    with pytest.raises(UnusableModel, match=model):
        fresh.promote(model, **BY)


def test_a_pointer_that_is_damaged_is_told(in_folder: Registry) -> None:
    in_folder.promote(published(in_folder), **BY)
    Objects(in_folder.url).write(f"{FOLDER}/serving/falling/_all/000002.json", [b"{"])
    with pytest.raises(UnusableModel, match=r"000002\.json is damaged"):
        in_folder.serving("falling")
    in_folder.promote(published(in_folder), **BY)
    assert serves(in_folder) == published(in_folder)


def test_all_who_promote_at_once_are_in_the_history(store_url: str) -> None:
    registry = Registry(store_url, NOWHERE)  # not a fixture: its connections end with it
    models = [published(registry, seed=seed) for seed in range(3)]
    start = threading.Barrier(3)

    def promote(model: str) -> None:
        own = Registry(registry.url, NOWHERE)
        start.wait()
        own.promote(model, who=model, why="at once")

    with ThreadPoolExecutor(3) as pool:
        list(pool.map(promote, models))
    history = registry.history("falling")
    assert sorted(now.model for now in history) == sorted(models)
    assert [now.before for now in history] == [0, 1, 2]
    assert serves(registry) == history[-1].model


def test_of_several_who_replace_the_same_model_at_once_one_does(store_url: str) -> None:
    registry = Registry(store_url, NOWHERE)  # not a fixture: its connections end with it
    first, *others = (published(registry, seed=seed) for seed in range(3))
    registry.promote(first, **BY, over="")
    start = threading.Barrier(2)

    def promote(model: str) -> str:
        own = Registry(registry.url, NOWHERE)
        start.wait()
        try:
            own.promote(model, **BY, over=first)
        except Overtaken as error:
            return str(error)
        return model

    with ThreadPoolExecutor(2) as pool:
        told = list(pool.map(promote, others))
    winner = serves(registry)
    assert [now.model for now in registry.history("falling")] == [first, winner]
    assert told.count(str(winner)) == 1
    assert sum(f"in the place of {first}, and {winner} serves by now" in one for one in told) == 1


def test_a_model_for_one_robot_takes_the_place_of_that_for_all_only_while_it_serves(
    in_folder: Registry,
) -> None:
    one, other, own = (published(in_folder, seed=seed) for seed in range(3))
    in_folder.promote(one, **BY)
    with pytest.raises(Overtaken, match=f"the place of nothing, and {one} serves"):
        in_folder.promote(own, "exo-01", **BY, over="")
    in_folder.promote(other, **BY)
    with pytest.raises(Overtaken, match=f"exo-01 in the place of {one}, and {other} serves"):
        in_folder.promote(own, "exo-01", **BY, over=one)
    in_folder.promote(own, "exo-01", **BY, over=other)
    assert serves(in_folder, "exo-01") == own
    assert serves(in_folder) == other


@pytest.mark.parametrize("earlier", [False, True])
def test_a_model_for_one_robot_is_withdrawn_where_that_for_all_changes_just_then(
    in_folder: Registry, monkeypatch: pytest.MonkeyPatch, earlier: bool
) -> None:
    one, other, own, gone = (published(in_folder, seed=seed) for seed in range(4))
    in_folder.promote(one, **BY)
    if earlier:
        in_folder.promote(gone, "exo-01", **BY)
        in_folder.rollback("falling", "exo-01", who="Ada")
    check = Registry._check_serves

    def overtaken(self: Registry, *arguments: Any) -> None:
        check(self, *arguments)
        Pointers(Objects(self.url), "falling").promote(other, "Bob", "faster")

    monkeypatch.setattr(Registry, "_check_serves", overtaken)
    with pytest.raises(Overtaken, match=f"the place of {one}, and {other} serves every robot by now"):
        in_folder.promote(own, "exo-01", **BY, over=one)
    assert serves(in_folder, "exo-01") == other
    assert in_folder.history("falling", "exo-01")[-1].why == f"withdrawn: {one} did not serve any more"


def test_of_two_who_roll_back_at_once_one_is_told(in_folder: Registry) -> None:
    for seed in range(3):
        in_folder.promote(published(in_folder, seed=seed), **BY)
    pointers = Pointers(Objects(in_folder.url), "falling")
    seen = pointers.target()
    in_folder.rollback("falling", who="Ada")
    with pytest.raises(UnusableModel, match="changed what serves just now"):
        pointers.roll_back(seen, "Bob", "")
    assert serves(in_folder) == published(in_folder, seed=1)


# --- what comes with GWRMS


@pytest.fixture
def shipped(tmp_path: Path) -> Path:
    folder = tmp_path / "shipped"
    published(Registry(folder.as_uri(), NOWHERE), source=DataSource.SIMULATED)
    return folder


def test_a_shipped_model_serves_where_nothing_else_does(folder_url: str, shipped: Path) -> None:
    registry = Registry(folder_url, shipped)
    (base,) = registry.entries()
    assert registry.shipped() == {base.id}
    assert registry.serving("falling", "exo-01", CHANNELS) == base.id
    assert registry.serving("falling", "exo-01", frozenset()) is None
    assert registry.serving("activity", "exo-01", CHANNELS) is None
    assert registry.serving("falling", "exo-01") is None
    assert registry.load(base.id)[0] == base
    own = published(registry)
    registry.promote(own, **BY)
    assert registry.serving("falling", "exo-01", CHANNELS) == own
    registry.rollback("falling", who="Ada")
    assert registry.serving("falling", "exo-01", CHANNELS) == base.id


def test_a_shipped_model_that_is_promoted_stays_when_another_is_shipped(
    folder_url: str, shipped: Path
) -> None:
    registry = Registry(folder_url, shipped)
    (base,) = registry.entries()
    registry.promote(base.id, **BY)
    assert registry.shipped() == {base.id}, "it came with GWRMS all the same"
    assert Registry(folder_url, NOWHERE).load(base.id)[0] == base


# --- the data that a model names


def test_vacuum_keeps_the_version_that_a_card_names(store_url: str) -> None:
    registry = Registry(store_url, NOWHERE)  # not a fixture: its connections end with it
    store = filled(registry.url)
    old = store.table(HERE).version()
    model = published(registry, tables=(TableVersion(registry.url, HERE, old),))
    compact(store)
    assert vacuum(store, grace=timedelta(0)) == []
    assert [named.by for named in pins(store)] == [model]
    assert store.dataset(HERE, old).to_table().num_rows == 18


def test_a_card_that_names_data_that_is_not_there_is_not_published(in_folder: Registry) -> None:
    Store(in_folder.url)
    with pytest.raises(NoSuchTable):
        published(in_folder, tables=(TableVersion(in_folder.url, HERE, 3),))
    assert in_folder.entries() == []
