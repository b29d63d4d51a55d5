"""`gwrms models` as somebody types it."""

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from gateway.main import main
from ml.registry.card import Card, DataSource, TableVersion
from ml.registry.classifier_scores import judged
from ml.registry.registry import CARD, FOLDER, Registry
from ml.store.objects import Objects
from tests.unit.registry.models import card, features, learned
from tests.unit.registry.test_registry import NOWHERE
from tests.unit.store.test_store import HERE
from tests.unit.store.test_upkeep import filled


class Desk:
    """A server's file and its store; `run` is the command line."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.url = (folder / "store").as_uri()
        self.registry = Registry(self.url, NOWHERE)
        config = folder / "server.toml"
        self.where = ("--config", str(config))
        config.write_text(f'[robots]\nexo-01 = "192.0.2.7:7420"\n[store]\nurl = "{self.url}"\n')
        self._capsys = capsys

    def run(self, *words: str, status: int = 0) -> str:
        """What it prints, or where `status` is another one, what it complains of."""
        assert main(["models", *words, *self.where]) == status
        said = self._capsys.readouterr()
        return said.err if status else said.out

    def ask(self, *words: str) -> Any:
        assert main(["models", *words, *self.where, "--json"]) == 0
        return json.loads(self._capsys.readouterr().out)

    def publish(self, seed: int = 0, **changes: Any) -> Card:
        model = learned(seed=seed)
        return self.registry.card(self.registry.publish(model.state(), card(model, **changes)))


@pytest.fixture
def desk(
    store_libraries: None,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> Desk:
    shipped = tmp_path / "shipped"
    model = learned(seed=2)
    Registry(shipped.as_uri(), NOWHERE).publish(model.state(), card(model, source=DataSource.SIMULATED))
    monkeypatch.setattr(Registry.__init__, "__defaults__", (shipped,))
    return Desk(tmp_path, capsys)


def test_models_are_listed_with_what_they_serve(desk: Desk) -> None:
    one, own = desk.publish(), desk.publish(robot="exo-01")
    assert desk.run("promote", one.id[:14]) == f"falling: {one.id} serves every robot\n"
    assert desk.ask("promote", own.id, "--robot", "exo-01", "--who", "Ada")["now"]["who"] == "Ada"
    shipped, first, second = desk.run("ls").splitlines()[1:]
    assert "shipped, simulated" in shipped
    assert "by default" in shipped
    assert first.split()[0] == one.id
    assert first.endswith("every robot (unsigned)")
    assert second.endswith("exo-01 (unsigned)")
    listed = desk.ask("ls", "--task", "falling")["models"]
    assert [(each["id"], each["shipped"], each["serves"]) for each in listed[1:]] == [
        (one.id, False, ["every robot"]),
        (own.id, False, ["exo-01"]),
    ]
    assert desk.ask("ls", "--task", "activity")["models"] == []


def test_a_robot_that_the_servers_file_does_not_name_is_pointed_out(
    desk: Desk, capsys: pytest.CaptureFixture[str]
) -> None:
    model = desk.publish().id
    assert main(["models", "promote", model, "--robot", "exo-02", *desk.where]) == 0
    assert "has no robot 'exo-02'; did you mean exo-01?" in capsys.readouterr().err
    assert main(["models", "promote", model, "--robot", "exo-01", *desk.where]) == 0
    assert "has no robot" not in capsys.readouterr().err


def test_a_rollback_brings_back_what_served_before(desk: Desk) -> None:
    one, other = desk.publish(), desk.publish(seed=1)
    desk.run("promote", one.id)
    desk.run("promote", other.id, "--who", "Ada", "--why", "stairs too")
    assert desk.run("rollback", "falling") == f"falling: {one.id} serves every robot\n"
    assert "no promoted model serves every robot any more; those that came" in desk.run("rollback", "falling")
    assert "nothing to roll back" in desk.run("rollback", "falling", status=1)
    assert "nothing to roll back" in desk.run("rollback", "falling", "--robot", "exo-01", status=1)
    lines = desk.run("history", "falling").splitlines()
    assert other.id in lines[2]
    assert lines[2].endswith("Ada (unsigned)   stairs too")
    assert [each["model"] for each in desk.ask("history", "falling")] == [one.id, other.id, one.id, ""]


def test_a_shipped_model_that_was_promoted_and_rolled_back_serves_by_default(desk: Desk) -> None:
    """It was said to serve nobody."""
    shipped = desk.ask("ls")["models"][0]["id"]
    desk.run("promote", shipped)
    assert desk.run("ls").splitlines()[1].endswith("every robot (unsigned)")
    desk.run("rollback", "falling")
    assert desk.run("ls").splitlines()[1].endswith("by default (unsigned)")
    assert "serves         by default (unsigned)" in desk.run("show", shipped)


def test_a_model_takes_the_place_of_the_one_that_is_named_or_of_none(desk: Desk) -> None:
    one, other = desk.publish(), desk.publish(seed=1)
    shipped = desk.ask("ls")["models"][0]["id"]
    said = desk.run("promote", one.id, "--instead-of", "nothing", status=1)
    assert f"in the place of nothing, and {shipped} serves by now (gwrms models history falling)" in said
    desk.run("promote", one.id, "--instead-of", shipped[:12])
    said = desk.run("promote", other.id, "--instead-of", shipped, status=1)
    assert f"in the place of {shipped}, and {one.id} serves by now" in said
    assert [each["model"] for each in desk.ask("history", "falling")] == [one.id]


def test_a_model_is_shown_with_all_that_says_how_far_to_trust_it(desk: Desk) -> None:
    rows, truth = features(seed=5)
    model = learned()
    verdicts = model.judge(rows)
    index = np.array([model.classes.index(name) for name in truth])
    people = ["Ada", "Bob"] * (len(rows) // 2)
    store = filled(desk.url)
    version = store.table(HERE).version()
    made = desk.publish(
        metrics=judged(model.classes, index, verdicts.probabilities, verdicts.label, people),
        learned=tuple(f"2026112{day}" for day in range(9)),
        held_out=("20261201",),
        tables=(TableVersion(desk.url, HERE, version),),
        ranges={model.recipe.channels[0]: (-3.25, 12.0)},
    )
    said = desk.run("show", made.id)
    for words in (
        "20261125 and 3 more",
        "never saw      20261201",
        f"{HERE} version {version}",
        " -3.25 ",
        "near_fall",
        "Bob",
        "steady  near_fall  fall  unknown",
        "PROBABILITY SAID",
        "probabilities are off by",
        "serves         nobody",
    ):
        assert words in said
    assert "CANNOT SERVE" not in said
    answer = desk.ask("show", made.id)
    assert answer["problem"] == ""
    assert len(answer["metrics"]["confusion"]) == 3


def test_what_cannot_serve_is_listed_and_said_and_not_promoted(desk: Desk) -> None:
    good, bad, gone = desk.publish(), desk.publish(seed=1), desk.publish(notes="gone")
    desk.run("promote", good.id)
    objects = Objects(desk.url)
    objects.write(f"{FOLDER}/{bad.id}/model.skops", [b"\x80\x04."])
    objects.write(f"{FOLDER}/{gone.id}/{CARD}", [b"{}"])
    assert f"{gone.id}: model.json is no model's card" in desk.run("ls", status=1)
    assert main(["models", "show", bad.id, "--url", desk.url]) == 1
    assert "SHA-256" in desk.run("promote", bad.id, status=1)
    assert "SHA-256" in desk.run("export", bad.id, "--onnx", "never.onnx", status=1)
    assert desk.registry.serving("falling") == good.id


def test_names_that_nothing_or_several_have_are_refused(desk: Desk, tmp_path: Path) -> None:
    desk.publish()
    assert "several begin: falling-" in desk.run("show", "falling", status=1)
    assert "has no model 'walking'" in desk.run("promote", "walking", status=1)
    assert "no name of a robot" in desk.run("promote", desk.publish().id, "--robot", "../x", status=1)
    nowhere = (tmp_path / "typo").as_uri()
    assert "no store at" in desk.run("ls", "--url", nowhere, status=1)
    assert not (tmp_path / "typo").exists()


def test_a_model_is_exported(desk: Desk, tmp_path: Path) -> None:
    pytest.importorskip("skl2onnx")
    made, file = desk.publish(), tmp_path / "model.onnx"
    assert made.id in desk.run("export", made.id, "--onnx", str(file))
    from ml.registry.onnx import differs

    rows, _ = features(seed=3)
    assert differs(learned(), file.read_bytes(), rows) < 1e-5


def test_a_promotion_warns_of_classes_that_are_lost(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    one, other = desk.publish(), desk.publish(1)
    desk.run("promote", one.id)
    known = Registry.card
    wider = msgspec.structs.replace(one, classes=(*one.classes, "sit_to_stand"))
    monkeypatch.setattr(Registry, "card", lambda self, it: wider if it == one.id else known(self, it))
    assert main(["models", "promote", other.id, *desk.where]) == 0
    assert "It does not know sit to stand; what serves now does." in capsys.readouterr().err
