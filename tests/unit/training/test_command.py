"""`gwrms train` as a command: what it says, what it publishes, and what it refuses."""

import json
from pathlib import Path

import pytest
from msgspec.structs import replace

from gateway import main
from ml.progress import Tell
from ml.registry.registry import Registry
from ml.training import training
from ml.training.training import Trained
from ml.training.training_sessions import Wish
from tests.unit.training.walkers import day, put

pytestmark = pytest.mark.usefixtures("small_models")


@pytest.fixture
def config(folder_url: str, tmp_path: Path) -> str:
    file = tmp_path / "server.toml"
    file.write_text(f'[store]\nurl = "{folder_url}"\n')
    return str(file)


def test_a_better_model_serves_and_an_equal_one_does_not(
    config: str, folder_url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    put(folder_url, tmp_path / "spool", [day(f"s{number}", number, each_s=5.0) for number in range(4)])
    assert main.main(["train", "activity", "--config", config, "--held-out", "s3"]) == 0
    heard = capsys.readouterr()
    said = heard.out
    assert heard.err.splitlines() == [
        f"gwrms train: activity, from the sessions and labels of {folder_url}",
        "gwrms train: reading sessions",
        "gwrms train: learning",
        "gwrms train: judging",
    ]
    registry = Registry(folder_url)
    (model,) = {card.id for card in registry.entries("activity")} - registry.shipped()
    assert f"let it serve: gwrms models promote {model}" in said
    assert "F1 of walk" in said
    assert registry.history("activity") == []
    arguments = ["train", "activity", "--config", config, "--held-out", "s3", "--promote", "--robot", "exo"]
    assert main.main(arguments) == 0
    assert "it serves now, for exo" in capsys.readouterr().out
    (pointer,) = registry.history("activity", "exo")
    assert pointer.model == model
    assert "it has not seen (always guessing the same" in pointer.why
    assert main.main([*arguments, "--json"]) == 1
    heard = capsys.readouterr()
    told = json.loads(heard.out)
    assert heard.err == ""
    assert (told["model"], told["compared_with"], told["promoted"]) == (model, model, False)
    assert told["held_out"]["new"] == told["held_out"]["serving"]
    assert len(registry.history("activity", "exo")) == 1


def test_a_model_that_another_one_has_overtaken_while_it_was_judged_is_not_promoted(
    config: str,
    folder_url: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    put(folder_url, tmp_path / "spool", [day(f"s{number}", number, each_s=5.0) for number in range(4)])
    teach = training.train

    def overtaken(registry: Registry, wish: Wish, cluster: str, tell: Tell) -> Trained:
        trained = teach(registry, wish, cluster, tell)
        faster = registry.publish(trained.learned.state(), replace(trained.card, notes="faster"))
        registry.promote(faster, who="Ada", why="a test")
        return trained

    monkeypatch.setattr(training, "train", overtaken)
    arguments = ["train", "activity", "--config", config, "--held-out", "s3", "--promote"]
    assert main.main(arguments) == 1
    said = capsys.readouterr().out
    (pointer,) = Registry(folder_url).history("activity")
    assert pointer.who == "Ada"
    assert "not compared, but able to serve" in said
    assert f"in the place of nothing, and {pointer.model} serves by now" in said


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["running"], 2, "invalid choice: 'running'"),
        (["activity", "--pseudo-labels", "0.3"], 2, "'0.3' is no probability from 0.5 to 1"),
        (["activity"], 1, "nothing has been uploaded to it (gwrms collect --upload)"),
    ],
)
def test_what_cannot_be_is_a_sentence(
    config: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    status: int,
    words: str,
) -> None:
    try:
        ended: object = main.main(["train", *arguments, "--config", config])
    except SystemExit as error:
        ended = error.code
    assert ended == status
    assert words in capsys.readouterr().err
    assert not (tmp_path / "store").exists()


def test_a_store_without_labels_says_how_to_give_some(
    config: str, folder_url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = day("s0", 0, order=("walk",), each_s=3.0)
    put(folder_url, tmp_path / "spool", [made])
    assert main.main(["train", "activity", "--config", config, "--robot", "exo-9"]) == 1
    assert (
        f"no session of exo-9 in {folder_url} has labels: give some (gwrms label" in capsys.readouterr().err
    )
