"""`gwrms check`: what it is told of files and of this computer, as text, as JSON and by its exit status."""

import json
import os
import re
import socket
import tomllib
from pathlib import Path
from typing import Any

import pytest

from gateway.cli.check import KINDS, check, main, recognised
from gateway.cli.connect import UnknownName, check_names
from gateway.main import main as gwrms
from gateway.tables.finding import Severity
from tools.draw.schemas import SCHEMAS

DATA = Path(__file__).parents[2] / "data" / "mistakes"
ROOT = Path(__file__).parents[3]
BARE = '[robot]\nname = "x"\n'
KNEE = (
    '[can.main]\ninterface = "virtual"\nchannel = "check"\n[joint.knee]\nbus = "main"\nnode_id = 2\n'
    'eds = "joint_drive.eds"\ncounts_per_revolution = 4096\ngear_ratio = 100\n'
    '[device.gait]\nbus = "main"\nnode_id = 16\neds = "gait_controller.eds"\n'
    '[[stop.controller]]\ncomponent = "gait"\nobject = "0x2000:0"\nvalue = 0\n'
)

STEP = '[parameter."gait.step_length"]\nobject = "0x2001:0"\nunit = "m"\nscale = 0.001\n'


def written(folder: Path, text: str, name: str = "robot.toml") -> Path:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def told(file: Path, *, machine: bool = False) -> str:
    return "\n".join(f"{one.severity}: {one.words}" for one in check(file, machine=machine).findings)


@pytest.mark.parametrize("kind", KINDS)
def test_the_kind_of_a_file_shows_in_its_tables_whatever_it_is_called(kind: str, tmp_path: Path) -> None:
    file = written(tmp_path, (DATA / f"{kind}.toml").read_text(encoding="utf-8"), "some.toml")
    checked = check(file, machine=False)
    assert (checked.kind, checked.findings) == (kind, [])


@pytest.mark.parametrize(
    ("name", "kind"), [("robot.toml", "robot"), ("server.toml", "server"), ("x.toml", "robot")]
)
def test_a_file_that_shows_nothing_is_what_it_is_called(name: str, kind: str) -> None:
    assert recognised(Path(name), {}) == kind


@pytest.mark.parametrize("file", sorted((ROOT / "scenarios").glob("*.toml")), ids=lambda file: file.stem)
def test_every_scenario_in_the_tree_is_well(file: Path) -> None:
    assert (check(file).kind, told(file)) == ("scenario", "")


GUARDED = 'title = "x"\n[guard.rule.hot]\nwatch = "temperature"\nabove = 90.0\n'
GUARDED += '[[expect]]\nrule = "hot"\ntripped = false\nat_s = 1\n'


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("", ""), ""),
        (("above", "abvoe"), "mistake: [guard.rule.hot] abvoe: is not known: did you mean 'above'?"),
        (('"temperature"', '"temprature"'), "mistake: [guard.rule.hot] watch: 'temprature' is not known"),
        (("90.0", '90.0\non = ["left_kne"]'), "mistake: [guard.rule.hot] on: "),
        (("[guard", "[guard]\nheartbeat_ms = 1\n[guard"), "mistake: [guard] heartbeat_ms: "),
        (("[guard", "[guard]\nheartbeat_ms = 100\n[guard"), ""),
    ],
)
def test_a_scenarios_guard_is_checked_as_the_gateway_will(
    tmp_path: Path, change: tuple[str, str], says: str
) -> None:
    said = told(written(tmp_path, GUARDED.replace(*change, 1), "guarded.toml"))
    assert said.startswith(says)
    assert bool(said) is bool(says)


def test_mistakes_end_with_1_and_warnings_only_where_it_is_strict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    well = written(tmp_path, BARE)
    assert main(["--no-machine", "--strict", str(well)]) == 0
    assert capsys.readouterr().out == f"{well}: a robot's file, nothing is wrong\n"
    unlikely = written(tmp_path, f'{BARE}[gateway]\nhost = "0.0.0.0"\n', "unlikely.toml")
    assert main(["--no-machine", str(unlikely)]) == 0
    assert main(["--no-machine", "--strict", str(unlikely)]) == 1
    capsys.readouterr()
    wrong = written(tmp_path, '[robot]\nnmae = "x"\n', "wrong.toml")
    assert main(["--no-machine", str(well), str(wrong)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith(f"{wrong}:2: mistake: [robot] nmae: is not known: did you mean 'name'?")
    assert lines[-1] == f"{wrong}: a robot's file, 2 mistakes"


def test_with_keys_and_no_socket_nobody_on_the_robots_own_computer_can_stop_it(tmp_path: Path) -> None:
    file = written(tmp_path, f'{BARE}[gateway]\nsocket = ""\n')
    assert told(file) == "", "without keys the port serves this computer"
    (tmp_path / "keys").mkdir()
    said = told(file)
    assert said.startswith("warning: [gateway] socket: is empty, and this robot has keys: nobody on its own")
    assert "can stop it without a key" in said


def test_without_a_file_it_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main([])
    assert ended.value.code == 2
    assert "name a file, or use --schema" in capsys.readouterr().err


def test_a_program_reads_the_same_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [written(tmp_path, "[robot]\n"), written(tmp_path, "x", "none.toml"), tmp_path / "away.toml"]
    assert main(["--json", "--no-machine", *map(str, files)]) == 1
    wrong, no_toml, away = map(json.loads, capsys.readouterr().out.splitlines())
    assert wrong == {
        "file": str(files[0]),
        "kind": "robot",
        "ok": False,
        "findings": [
            {"severity": "mistake", "where": "[robot]", "key": "name", "text": "is missing", "line": 1}
        ],
    }
    assert (no_toml["kind"], no_toml["findings"][0]["where"]) == (None, "line 1")
    assert away["findings"][0]["text"] == "cannot be read: No such file or directory"


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("joint_drive.eds", "drive.eds"), "mistake: [joint.knee]: there is no EDS file 'drive.eds'"),
        (
            ("", '[parameter."knee.x"]\nobject = "0x2001:0"\nmin = 0\nmax = 1\n'),
            'mistake: [parameter."knee.x"]: joint_drive.eds has no object 0x2001:0',
        ),
        (
            ("", '[channel."knee.x"]\nobject = "0x1008:0"\n'),
            'mistake: [channel."knee.x"] object: 0x1008:0 is no number in joint_drive.eds',
        ),
        (
            ("", '[channel."knee.temperature"]\nobject = "0x6065:0"\nunit = "K"\n'),
            'mistake: [channel."knee.temperature"] unit: a joint\'s temperature is in °C: write unit = "°C"',
        ),
        (
            ("gear_ratio = 100", "gear_ratio = 10"),
            "warning: [joint.knee] gear_ratio: 10 is far from 100, as joint_drive.eds has it in 6091h",
        ),
        (
            ("per_revolution = 4096", "per_revolution = 65536"),
            "warning: [joint.knee] counts_per_revolution: 65536 is far from 4096, as joint_drive.eds has it",
        ),
        (
            ("", STEP + "min = 2\nmax = 3\n"),
            'mistake: [parameter."gait.step_length"]: its limits allow nothing: minimum 2 is above maximum',
        ),
        (
            ("", STEP + "min = 0.3\nmax = 3\n"),
            'warning: [parameter."gait.step_length"] max: 3 is beyond gait_controller.eds, where it is',
        ),
        (
            ("", '[imu.trunk]\nport = "/dev/x"\nzero = "trunk.toml"\n'),
            "mistake: [imu.trunk]: IMU zero",
        ),
        (
            ("", '[insole.left]\nport = "/dev/x"\ncalibration = "left.toml"\n'),
            "gwrms calibrate insole writes it; leave the key `calibration` out until then",
        ),
        (
            ("", '[insole.left]\nport = "/dev/x"\nlayout = "mine.toml"\n'),
            "mistake: [insole.left]: ",
        ),
        (
            ("0x2000:0", "0x2FFF:0"),
            "mistake: [[stop.controller]] number 1 object: 0x2FFF:0 of gait_controller.eds: its EDS has no",
        ),
        (
            ("value = 0", "value = 70000"),
            "mistake: [[stop.controller]] number 1 object: 0x2000:0 of gait_controller.eds: 70000 is 70000",
        ),
        (
            ("0x2000:0", "0x2010:0"),
            "warning: [[stop.controller]] number 1 object: 0x2010:0 cannot be written, says",
        ),
    ],
)
def test_files_beside_it_and_limits_are_looked_at(tmp_path: Path, change: tuple[str, str], says: str) -> None:
    old, new = change
    text = (BARE + KNEE).replace(old, new) if old else BARE + KNEE + new
    assert says in told(written(tmp_path, text))
    assert "Errno" not in told(written(tmp_path, text))


def test_a_port_that_is_not_there_is_no_port_or_is_not_ours_is_warned_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = written(tmp_path, f'{BARE}[imu.trunk]\nport = "{tmp_path}/port"\n')
    assert f"warning: [imu.trunk] port: {tmp_path}/port does not exist" in told(file, machine=True)
    (tmp_path / "port").write_bytes(b"")
    assert f"{tmp_path}/port is no serial port" in told(file, machine=True)
    master, slave = os.openpty()
    try:
        file.write_text(f'{BARE}[imu.trunk]\nport = "{os.ttyname(slave)}"\n', encoding="utf-8")
        assert told(file, machine=True) == ""
        monkeypatch.setattr(os, "access", lambda path, mode: not str(path).startswith("/dev/pts"))
        assert "no permission to open" in told(file, machine=True)
        assert "usermod -aG" in told(file, machine=True)
    finally:
        os.close(master)
        os.close(slave)


def test_a_bus_and_an_address_that_are_not_here_are_warned_of(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    text = (
        f'{BARE}[gateway]\nhost = "192.0.2.1"\n'
        '[can.none]\ninterface = "socketcan"\nchannel = "can77"\n'
        f'[can.hub]\ninterface = "socketcand"\nchannel = "x"\nhost = "127.0.0.1"\nport = {port}\n'
        '[can.line]\ninterface = "slcan"\nchannel = "/dev/none"\n'
    )
    said = told(written(tmp_path, text), machine=True)
    assert "warning: [gateway] host: 192.0.2.1 is no address of this computer" in said
    assert "warning: [can.none] channel: there is no interface can77" in said
    assert f"warning: [can.hub] channel: nothing answers at 127.0.0.1:{port}" in said
    assert "warning: [can.line] channel: /dev/none does not exist" in said


def test_records_that_are_a_file_are_warned_of(tmp_path: Path) -> None:
    file = written(tmp_path, f'{BARE}[gateway]\nrecords = "robot.toml"\n')
    assert f"warning: [gateway] records: {file} is no folder" in told(file, machine=True)


def test_nothing_of_this_computer_is_looked_at_where_nobody_wants_it(tmp_path: Path) -> None:
    assert told(written(tmp_path, f'{BARE}[imu.trunk]\nport = "/dev/none"\n')) == ""


@pytest.mark.parametrize("kind", KINDS)
def test_a_schema_is_printed_and_fits_the_good_file(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--schema", kind]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert schema == json.loads(json.dumps(SCHEMAS[kind]()))
    tables = tomllib.loads((DATA / f"{kind}.toml").read_text(encoding="utf-8"))
    assert list(misfits(tables, schema, schema)) == []


@pytest.mark.parametrize(
    ("kind", "table", "key"),
    [
        ("robot", "joint", "gear_ration"),
        ("robot", "can", "node_id"),
        ("robot", "gatway", ""),
        ("server", "recorder", "upload"),
        ("scenario", "robot", "imu"),
    ],
)
def test_a_schema_finds_what_is_wrong(kind: str, table: str, key: str) -> None:
    tables = tomllib.loads((DATA / f"{kind}.toml").read_text(encoding="utf-8"))
    schema = SCHEMAS[kind]()
    place = tables.setdefault(table, {})
    while place and all(isinstance(one, dict) for one in place.values()):
        place = next(iter(place.values()))
    place[key] = "wrong"
    assert list(misfits(tables, schema, schema)) != []


TYPES: dict[str, Any] = {
    "object": dict,
    "array": list,
    "string": str,
    "integer": int,
    "number": (int, float),
    "boolean": bool,
}


def misfits(value: Any, schema: dict[str, Any], whole: dict[str, Any], at: str = "") -> list[str]:
    """What does not fit, as far as our schemas go: JSON Schema 2020-12 without the rest."""
    if "$ref" in schema:
        schema = {**whole["$defs"][schema["$ref"].rpartition("/")[2]], **schema}
    found = []
    if "type" in schema and not isinstance(value, TYPES[schema["type"]]):
        return [f"{at} is no {schema['type']}"]
    if "enum" in schema and value not in schema["enum"]:
        found.append(f"{at} is none of {schema['enum']}")
    if "anyOf" in schema and all(misfits(value, one, whole, at) for one in schema["anyOf"]):
        found.append(f"{at} fits none of {len(schema['anyOf'])}")
    if isinstance(value, str) and not re.search(schema.get("pattern", ""), value):
        found.append(f"{at} is not like {schema['pattern']}")
    if isinstance(value, int | float) and not schema.get("minimum", value) <= value <= schema.get(
        "maximum", value
    ):
        found.append(f"{at} is beyond")
    if isinstance(value, dict):
        found += [f"{at}.{key} is missing" for key in schema.get("required", ()) if key not in value]
        for key, one in value.items():
            further = schema.get("additionalProperties", True)
            part = schema.get("properties", {}).get(key, further)
            found += [f"{at}.{key} is not known"] if part is False else []
            found += misfits(one, part, whole, f"{at}.{key}") if isinstance(part, dict) else []
    if isinstance(value, list):
        kinds = [*schema.get("prefixItems", ()), *[schema.get("items", True)] * len(value)]
        for place, (one, part) in enumerate(zip(value, kinds, strict=False)):
            found += misfits(one, part, whole, f"{at}[{place}]") if isinstance(part, dict) else []
    return found


def test_a_component_with_a_bad_file_says_why_it_has_no_channel() -> None:
    with pytest.raises(UnknownName, match="knee has no channel: there is no EDS file"):
        check_names("channel", ["knee.position"], ["hip.position"], {"knee": "there is no EDS file 'x.eds'"})
    with pytest.raises(UnknownName, match=r"no channel 'nose\.x'"):
        check_names("channel", ["nose.x"], ["hip.position"], {"knee": "there is no EDS file 'x.eds'"})


def test_a_file_that_ships_is_found_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert gwrms(["eds", "--brief", "joint_drive.eds"]) == 0
    assert "GWRMS joint drive" in capsys.readouterr().out
    assert gwrms(["eds", "joint_drve.eds"]) == 1
    assert "shipped are: elmo_gold.dcf" in capsys.readouterr().err


def test_severities_are_told_in_their_order(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path, f'{BARE}[gateway]\nhost = "0.0.0.0"\nport = 70000\n')
    assert main(["--no-machine", str(file)]) == 1
    said = [line.split(": ")[1] for line in capsys.readouterr().out.splitlines()[:-1]]
    assert said == [Severity.MISTAKE, Severity.WARNING]


def test_what_files_and_computer_lack_is_told_beside_mistakes_in_one_run(tmp_path: Path) -> None:
    text = BARE + KNEE.replace("node_id = 2", "node_id = 200").replace("gait_controller.eds", "gone.eds")
    text += f'[insole.left]\nport = "{tmp_path}/gone"\nlayout = "sole"\n'
    text += '[joint.hip]\nbus = "mian"\nnode_id = 3\neds = "gone.eds"\n'
    text += "counts_per_revolution = 4096\ngear_ratio = 100\n"
    found = told(written(tmp_path, text), machine=True)
    for words in (
        "mistake: [joint.knee] node_id: must be",
        "mistake: [joint.hip] bus: there is no bus 'mian'",
        "mistake: [insole.left] layout: 'sole' is not known",
        "mistake: [device.gait]: there is no EDS file 'gone.eds'",
        f"warning: [insole.left] port: {tmp_path}/gone does not exist",
    ):
        assert words in found, found


def test_every_line_that_is_no_toml_is_told_and_the_rest_is_checked_without_them(tmp_path: Path) -> None:
    text = BARE + KNEE.replace("node_id = 2", "node_id 2").replace('"joint_drive.eds"', "joint_drive.eds")
    found = told(written(tmp_path, text.replace("gear_ratio", "gear_ration"))).splitlines()
    assert [line.partition(" is no TOML")[0] for line in found[:2]] == [
        "mistake: line 8:",
        "mistake: line 9:",
    ]
    assert found[2].startswith("mistake: [joint.knee] gear_ration: is not known")
    assert len(found) == 3, "what is missing is not known where lines could not be read"


def test_a_number_that_is_too_long_for_any_is_a_mistake_as_any_other(tmp_path: Path) -> None:
    """The command ended with an error of its own, where it stood in the last line."""
    found = told(written(tmp_path, BARE + "\n[joint.x]\nnode_id = " + "1" * 5000))
    assert "is no TOML: 'node_id = 111" in found


@pytest.mark.parametrize("cut", ["[can.main", 'name = """x', "x = [\n1,"])
def test_behind_what_does_not_end_nothing_is_guessed(cut: str, tmp_path: Path) -> None:
    found = told(written(tmp_path, f'{cut}\nbus = "main"\n[joint.x]\nnode_id = "y"\n'))
    assert found.count("is no TOML") == len(found.splitlines()) == 1
