"""What is said of a file says at which line: of the key, or of its table."""

import tomllib

import pytest

from gateway.tables.finding import Finding
from gateway.tables.line_numbers import Places

TEXT = '''\
# a robot
[robot]
name = "x"

[can.main]
more = [
  1,  # [joint.left_hip]
  2,
]
[joint.left_knee]   # bends
bus = "main"; zero_offset = 1
eds = "a.eds"
[parameter."gait.step"]
object = "0x2001:0"
[[stop.controller]]
component = "gait"
[[stop.controller]]
component = "gate"
words = """
node_id = 3
"""
value = 0
'''.replace("; zero", "\nzero")


@pytest.mark.parametrize(
    ("where", "key", "line"),
    [
        ("[robot]", "name", 3),
        ("[robot]", "nmae", 2),
        ("[robot]", "", 2),
        ("[can.main]", "more[1]", 6),
        ("[joint.left_knee]", "zero_offset", 12),
        ("[joint.left_knee]", "node_id", 10),
        ("[joint.left_hip]", "", None),
        ('[parameter."gait.step"]', "object", 15),
        ("[[stop.controller]] number 1", "component", 17),
        ("[[stop.controller]] number 2", "component", 19),
        ("[[stop.controller]] number 2", "value", 23),
        ("[[stop.controller]] number 3", "value", None),
        ("[stop]", "", 16),
        ("[guard]", "x", None),
        ("line 3", "", None),
        ("", "", None),
    ],
)
def test_a_finding_has_the_line_of_its_key_or_else_of_its_table(
    where: str, key: str, line: int | None
) -> None:
    assert Places(TEXT).line(Finding(where, key, "is wrong")) == line


@pytest.mark.parametrize(
    "text", ["", "[", "a = [", "= 1", "[a]\n" * 3, 'x = """\n' * 5, "[[a]]\n[a]\n", "a.b = 1\r\n"]
)
def test_what_is_no_toml_has_no_lines_and_raises_nothing(text: str) -> None:
    assert Places(text).line(Finding("[joint.x]", "y", "is wrong")) is None


def test_keys_without_a_table_and_dotted_ones_are_found() -> None:
    places = Places('nmae = "x"\nrobot.name = "y"\n')
    assert places.line(Finding("the file", "nmae", "is not known")) == 1
    assert places.line(Finding("[robot]", "name", "is wrong")) == 2


def test_a_value_of_thousands_of_lines_costs_no_more_than_to_pass_over_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    parsed: list[str] = []
    loads = tomllib.loads

    def counted(text: str) -> dict[str, object]:
        parsed.append(text)
        return loads(text)

    monkeypatch.setattr(tomllib, "loads", counted)
    places = Places("a = [\n" + "  1,\n" * 3000 + "]\n[can.main]\nbitrate = 1\n")
    assert places.line(Finding("[can.main]", "bitrate", "is wrong")) == 3004
    assert len(parsed) < 4000  # and not 400 for each line
