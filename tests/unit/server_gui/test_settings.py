"""The server's file: what it says, what it may leave out, and how it says what is wrong."""

from pathlib import Path

import pytest

from gateway.client import Address
from server_gui.core.settings.prediction import Action, RuleSettings
from server_gui.core.settings.server_file import RecordingSettings, SettingsError, Upload, add_robots, load
from tests.newcomer.pages import blocks

WHOLE = """
[robots]
exo-01 = "192.0.2.7:7421"
exo-02 = { address = "exo-02.local" }
[store]
url = "s3://bucket/prefix/"
shards = 10
[recorder]
spool = "spool"
upload = "idle"
rate_hz = 200
channels = ["*_knee.*", "trunk.*"]
resources_s = 2
batch_s = 30
[prediction]
every_ms = { falling = 20 }
poll_s = 5
[[rules]]
task = "falling"
label = "near_fall"
at_least = 0.9
for_ms = 60
robot = "exo-*"
action = "stop"
"""
RULE = "[[rules]]\ntask = 'falling'\nlabel = 'near_fall'\nat_least = 0.9\n"


def written(folder: Path, text: str) -> Path:
    file = folder / "server.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_the_whole_file_is_read(tmp_path: Path) -> None:
    settings = load(written(tmp_path, WHOLE))
    assert {name: robot.where for name, robot in settings.robots.items()} == {
        "exo-01": Address("192.0.2.7", 7421),
        "exo-02": Address("exo-02.local", 7420),
    }
    assert (settings.store.url, settings.store.shards) == ("s3://bucket/prefix", 10)
    assert settings.store.compact_s == 3600.0
    assert settings.recorder == RecordingSettings(
        tmp_path / "spool", Upload.IDLE, 200.0, ("*_knee.*", "trunk.*"), 2.0, 30.0
    )
    assert settings.prediction.every_ns("falling") == 20_000_000
    assert settings.prediction.every_ns("activity") == 100_000_000
    (rule,) = settings.rules
    assert rule == RuleSettings("falling", "near_fall", 0.9, 60, None, "exo-*", Action.STOP)
    assert rule.concerns("exo-01")
    assert not rule.concerns("other")


def test_no_rule_is_there_unless_somebody_writes_one(tmp_path: Path) -> None:
    assert load(written(tmp_path, "")).rules == ()


def test_without_a_file_everything_has_its_usual_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    settings = load()
    assert settings.robots == {}
    assert settings.recorder.spool == tmp_path / "data" / "gwrms" / "spool"
    assert settings.store.url == (tmp_path / "data" / "gwrms" / "store").as_uri()
    (tmp_path / "config" / "gwrms").mkdir(parents=True)
    written(tmp_path / "config" / "gwrms", '[robots]\nexo-01 = "192.0.2.7"\n')
    assert set(load().robots) == {"exo-01"}


def test_an_empty_file_is_as_none(tmp_path: Path) -> None:
    assert load(written(tmp_path, "")) == load()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[robot]", r"\[robot\]: is not known: did you mean 'robots'\?"),
        (
            "[recorder]\nupload = 'never'",
            r"\[recorder\] upload: 'never' is not known: allowed are always, idle, manual",
        ),
        ("[recorder]\nrate = 5", r"\[recorder\] rate: is not known: did you mean 'rate_hz'\?"),
        ("[recorder]\nrate_hz = 2000", r"\[recorder\] rate_hz: must be a number, at most 1000"),
        ("[recorder]\nrate_hz = nan", r"\[recorder\] rate_hz: nan is no finite number"),
        ("[recorder]\nspool = 5", r"\[recorder\] spool: must be a folder's path in quotes, not 5"),
        ("[recorder]\nchannels = []", r"\[recorder\] channels: must not be empty"),
        ("recorder = 5", r"\[recorder\]: is a table, not 5"),
        ("robots = []", r"\[robots\]: is a table of names"),
        ("[robots]\nexo = 5", r'\[robots\] exo: write "HOST:PORT"'),
        ("[robots]\nexo = {}", r"\[robots\.exo\] address: is missing"),
        ("[robots]\nexo = 'h:x'", r"\[robots\] exo: 'h:x' is not a robot's address; write HOST:PORT"),
        ("[robots]\n'a/b' = 'h'", r"\[robots\] a/b: a robot's name is letters"),
        ("[robots]\na = 'h'\nb = 'h:7420'", r"\[robots\] b: h:7420 is a already; remove one"),
        ("[store]\nurl = 'ftp://h'", r"\[store\] url: 'ftp://h' is no store: use file:///folder or s3://"),
        ("[store]\nurl = 's3://k:s@b/p'", r"\[store\] url: a store's URL has no keys in it"),
        (
            "[prediction]\nevery_ms = {walking = 20}",
            r"\[prediction\] every_ms: 'walking' is not known",
        ),
        ("[prediction]\nevery_ms = {activity = 30}", r"\[prediction\] every_ms.*multiple of 20"),
        ("[prediction]\nenabled = 1", r"\[prediction\] enabled: must be true or false"),
        ("[rules]\ntask = 'falling'", r"\[\[rules\]\]: is a list of tables: write it with double brackets"),
        (RULE.replace("at_least = 0.9", ""), r"\[\[rules\]\] number 1 at_least: is missing"),
        (RULE + RULE.replace("0.9", "2"), r"\[\[rules\]\] number 2 at_least: must be a number, at most 1"),
        (RULE.replace("'falling'", "'fall'"), r"number 1 task: 'fall' is not known: did you mean"),
        (
            RULE.replace("near_fall", "nearfall"),
            r"number 1 label: 'nearfall' is not known: did you mean 'near_",
        ),
        (RULE + "release = 0.95", r"number 1 release: 0\.95 is above at_least 0\.9"),
        (RULE + "action = 'halt'", r"number 1 action: 'halt' is not known: allowed are alarm, stop"),
        ("a = ", "is no TOML"),
    ],
)
def test_what_cannot_work_is_named_with_what_to_do(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(SettingsError, match=rf"server\.toml: .*({words})"):
        load(written(tmp_path, text))


def test_a_file_that_is_named_must_be_there(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"other\.toml: is not there; name the server's file"):
        load(tmp_path / "other.toml")


def test_robots_of_the_command_line_come_on_top(tmp_path: Path) -> None:
    settings = add_robots(load(written(tmp_path, WHOLE)), {"exo-01": "127.0.0.1", "exo-03": ":7430"})
    assert settings.robots["exo-01"].where == Address("127.0.0.1", 7420)
    assert settings.robots["exo-03"].where == Address("127.0.0.1", 7430)
    with pytest.raises(SettingsError, match=r"exo-04: 127\.0\.0\.1:7430 is exo-03 already"):
        add_robots(settings, {"exo-04": ":7430"})


def test_the_file_of_the_docs_is_one(tmp_path: Path) -> None:
    page = Path(__file__).parents[3] / "docs" / "how-to" / "record.md"
    shown = next(block.text for block in blocks(page) if block.language == "toml")
    settings = load(written(tmp_path, shown))
    assert set(settings.robots) == {"exo-01", "exo-02"}
    assert (settings.store.url, settings.recorder.upload) == ("s3://exoskeletons/lab", Upload.IDLE)


@pytest.mark.parametrize("line", ["compact_h = 0", "several_writers = false"])
def test_a_store_that_others_compact_or_that_takes_no_second_writer_is_left_alone(
    tmp_path: Path, line: str
) -> None:
    assert load(written(tmp_path, f"[store]\n{line}\n")).store.compact_s is None
