"""A model that was refused is tried again when something of it changes, or after a time; it is told once."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from ml.registry.pointers import Pointers
from ml.registry.registry import CARD, SKOPS, Registry
from ml.store.objects import Objects
from server_gui.core.prediction import model_loading as module
from server_gui.core.prediction.model_loading import Serving
from tests.unit.ml.serving.small import CHANNELS, learned
from tests.unit.prediction.robots import ROBOT, card, publish

WAIT_S = 60.0
KEY = ROBOT, "activity"


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often a model was loaded, by its name; "looks" are those for what serves."""
    counts: Counter[str] = Counter()
    load, served = Registry.load, Registry.served

    def counted_load(self: Registry, model: str) -> Any:
        counts[model] += 1
        return load(self, model)

    def counted_look(self: Registry) -> Any:
        counts["looks"] += 1
        return served(self)

    monkeypatch.setattr(Registry, "load", counted_load)
    monkeypatch.setattr(Registry, "served", counted_look)
    return counts


@contextmanager
def serving(url: str) -> Iterator[Serving]:
    with Serving(url, poll_s=0.02) as one:
        one.robot(ROBOT, dict.fromkeys(CHANNELS, "rad"))
        yield one


def until(condition: Callable[[], object]) -> None:
    deadline_s = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.01)


def looked(calls: Counter[str]) -> None:
    """Wait until it has looked again, from the beginning of a look to its end."""
    before = calls["looks"]
    until(lambda: calls["looks"] > before + 2)


def damaged(url: str, name: str) -> tuple[str, Path, bytes]:
    """A model that should serve now, its damaged file, and what was in it."""
    model = Registry(url).publish(learned().state(), card(learned(), notes="another"))
    file = Path(url.removeprefix("file://")) / "models" / model / name
    whole = file.read_bytes()
    file.write_bytes(b"damaged")
    Pointers(Objects(url), "activity").promote(model, "tester", "a test")
    return model, file, whole


def written(file: Path, data: bytes) -> None:
    """All at once, as a store does."""
    aside = file.parents[2] / "aside"
    aside.write_bytes(data)
    aside.rename(file)


@pytest.mark.parametrize("name", [SKOPS, CARD])
def test_a_refused_model_is_tried_again_when_its_file_changes_and_serves_once_it_is_right(
    folder_url: str, calls: Counter[str], caplog: pytest.LogCaptureFixture, name: str
) -> None:
    first = publish(folder_url)
    second, file, whole = damaged(folder_url, name)
    with serving(folder_url) as one:
        until(lambda: one.problems)
        looked(calls)
        tried = calls[second]
        looked(calls)
        assert calls[second] == tried
        written(file, b"damaged in another way")
        looked(calls)
        assert calls[second] == tried + (name == SKOPS)  # without a card nothing is loaded
        assert second in one.problems[KEY]
        written(file, whole)
        until(lambda: KEY in one.models and one.models[KEY].card.id == second)
        assert not one.problems
    assert first != second
    assert len([record for record in caplog.records if second in record.getMessage()]) == 1


def test_a_refused_model_is_tried_again_after_a_time(
    folder_url: str, calls: Counter[str], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "RETRY_S", 0.05)
    publish(folder_url)
    second, *_ = damaged(folder_url, SKOPS)
    with serving(folder_url) as one:
        until(lambda: calls[second] > 3)
        assert second in one.problems[KEY]
    assert len([record for record in caplog.records if second in record.getMessage()]) == 1


def test_another_robot_is_no_reason_to_try_again(folder_url: str, calls: Counter[str]) -> None:
    publish(folder_url)
    second, *_ = damaged(folder_url, SKOPS)
    with serving(folder_url) as one:
        until(lambda: one.problems)
        looked(calls)
        tried = calls[second]
        one.robot("exo-02", dict.fromkeys(CHANNELS, "rad"))
        until(lambda: ("exo-02", "activity") in one.problems)
    assert calls[second] == tried
