"""What docs/reference/store.md says of the tables is so, and its questions have answers."""

import re
import shlex
from pathlib import Path

import pytest

from gateway.main import main
from ml.store.tables import TABLES, Table
from tests.unit.cloud.recordings import record

TEXT = (Path(__file__).parents[3] / "docs" / "reference" / "store.md").read_text(encoding="utf-8")
CHANNELS = ("left_knee.position", "left_knee.torque", "left_insole.force")


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_every_column_is_described(table: Table) -> None:
    said = TEXT.partition(f"**{table.name}**")[2].partition("\n**")[0]
    origin = () if table.name == "telemetry" else ("spool", "batch", "number")
    assert [name for name in table.schema.names if f"`{name}`" not in said and name not in origin] == []


def test_every_question_has_an_answer(
    folder_url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record(folder_url, tmp_path / "spool", channels=CHANNELS)
    [block] = re.findall(r"```sh\n(gwrms query .*?)```", TEXT, re.DOTALL)
    questions = [words.split("\0") for words in "\0".join(shlex.split(block)).split("gwrms\0")[1:]]
    assert len(questions) == 5
    for question in questions:
        words = [word for word in question if word]
        assert main([*words, "--url", folder_url]) == 0, capsys.readouterr().err
        assert capsys.readouterr().out
