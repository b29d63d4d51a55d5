"""Who has promoted a model is known by a signature over that very model, task, robot and place in history."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from gateway.main import main
from ml.registry.card import Card
from ml.registry.pointers import FOLDER, Pointer
from ml.registry.registry import Registry, Serving
from ml.store.objects import Objects
from server_gui.core.settings.promoters import objection
from tests.unit.prediction.robots import promoters, signature
from tests.unit.registry.models import CHANNELS, card, learned
from tests.unit.registry.test_registry import NOWHERE

KNOWN = ("anna",)


@pytest.fixture
def registry(folder_url: str) -> Registry:
    return Registry(folder_url, NOWHERE, sign=signature("anna"))


def published(registry: Registry, seed: int = 0) -> Card:
    model = learned(seed=seed)
    return registry.card(registry.publish(model.state(), card(model)))


def serving(registry: Registry, robot: str = "exo-01") -> Serving:
    found = Registry(registry.url, NOWHERE).served_to("falling", robot, CHANNELS)
    assert found is not None
    return found


def refused(registry: Registry, robot: str = "exo-01") -> str | None:
    found = serving(registry, robot)
    card = registry.card(found.model)
    return objection(found.pointer, "falling", found.robot, card, promoters(*KNOWN))


def test_what_somebody_with_the_right_has_promoted_or_rolled_back_to_is_believed(registry: Registry) -> None:
    first, second = published(registry), published(registry, seed=1)
    registry.promote(first.id, who="anna", why="good")
    registry.promote(second.id, who="anna", why="better")
    assert refused(registry) is None
    registry.rollback("falling", who="anna", why="worse")
    assert (serving(registry).model, refused(registry)) == (first.id, None)
    registry.promote(second.id, "exo-01", who="anna", why="for that one")
    assert (serving(registry).robot, refused(registry)) == ("exo-01", None)


@pytest.mark.parametrize("sign", [None, signature("ben")], ids=["unsigned", "somebody else"])
def test_what_others_promote_is_not(registry: Registry, sign: Any) -> None:
    name = published(registry).id
    Registry(registry.url, NOWHERE, sign=sign).promote(name, who="anna", why="they say so")
    assert "none of [promoters]" in str(refused(registry)) if sign else "unsigned" in str(refused(registry))


ALTERED: dict[str, Callable[[Pointer, Card], Pointer]] = {
    "another model": lambda now, other: msgspec.structs.replace(now, model=other.id),
    "another content": lambda now, _other: msgspec.structs.replace(now, content="0" * 64),
    "another name": lambda now, _other: msgspec.structs.replace(now, who="ben"),
    "no signature at all": lambda now, _other: msgspec.structs.replace(now, signature="!"),
    "no certificate": lambda now, _other: msgspec.structs.replace(now, certificate="none"),
}


@pytest.mark.parametrize("how", ALTERED)
def test_what_was_altered_in_the_store_is_not(registry: Registry, how: str) -> None:
    one, other = published(registry), published(registry, seed=1)
    now = registry.promote(one.id, who="anna", why="good")
    write(registry, "falling/_all/000001", ALTERED[how](now, other))
    assert refused(registry) is not None


def test_a_signature_is_for_one_robot_and_one_place_in_the_history(registry: Registry) -> None:
    """Who may write into the store cannot bring an old one back, nor let it serve another robot."""
    one, other = published(registry), published(registry, seed=1)
    old = registry.promote(one.id, "exo-01", who="anna", why="good")
    registry.promote(other.id, "exo-01", who="anna", why="better")
    write(registry, "falling/exo-02/000001", old)
    assert "does not hold" in str(refused(registry, "exo-02"))
    write(registry, "falling/exo-01/000003", msgspec.structs.replace(old, number=3))
    assert "does not hold" in str(refused(registry))


def write(registry: Registry, name: str, pointer: Pointer) -> None:
    Objects(registry.url).write(f"{FOLDER}/{name}.json", [msgspec.json.encode(pointer)])


def test_the_commands_sign_with_the_desks_key_and_say_unsigned_without_one(
    registry: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    name = published(registry).id
    config = tmp_path / "server.toml"

    def run(*words: str) -> str:
        assert main(["models", *words, "--config", str(config)]) == 0
        said = capsys.readouterr()
        return said.out + said.err

    config.write_text(f'[store]\nurl = "{registry.url}"\n')
    assert "unsigned, so its predictions cannot stop a robot" in run("promote", name)
    assert "every robot (unsigned)" in run("ls")
    assert "(unsigned)" in run("history", "falling")
    line = run("key")
    key = line.split('"')[3]
    assert "unsigned" not in run("promote", name)
    assert f"every robot (signed by {key})" in run("show", name)
    config.write_text(f'[store]\nurl = "{registry.url}"\n[promoters]\n{line}')
    listed = json.loads(run("ls", "--json"))["models"]
    assert [one["signed"] for one in listed if one["id"] == name] == [[f"signed by {line.split(chr(34))[1]}"]]
    config.write_text('[promoters]\nanna = "1234"\n')
    assert main(["models", "ls", "--config", str(config)]) != 0
    assert "is the SHA-256 of a key" in capsys.readouterr().err
