"""The robot's file: what is right loads, what is wrong is named with file, table, key and remedy."""

from pathlib import Path

import pytest

from drivers.bus.settings import Role
from gateway import config as configs
from gateway.tables.reading import parse
from tests.unit.gateway.harness import HEAD, ROBOT, config

JOINT = """
[joint.knee]
bus = "main"
node_id = 2
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100.0
"""


def test_a_whole_robot_loads(tmp_path: Path) -> None:
    robot = config(tmp_path, ROBOT)
    assert robot.robot.name == "exo-test"
    assert robot.gateway.role is Role.OBSERVER
    assert list(robot.joint) == ["left_knee", "right_knee"]
    assert robot.joint["right_knee"].node_id == 5
    assert robot.parameter["gait.step_length"].address == (0x2001, 0)
    assert robot.parameter["gait.step_length"].live
    assert not robot.parameter["gait.toe_height"].live


def test_a_robot_is_no_more_than_a_name(tmp_path: Path) -> None:
    robot = config(tmp_path, '[robot]\nname = "bare"\n')
    assert (robot.gateway.host, robot.gateway.port, robot.gateway.linger_s) == ("127.0.0.1", 7420, 5.0)


def test_further_keys_of_a_bus_are_python_cans_own(tmp_path: Path) -> None:
    text = (
        '[robot]\nname="x"\n[can.main]\ninterface="socketcand"\nchannel="sim"\nhost="127.0.0.1"\nport=29536\n'
    )
    assert config(tmp_path, text).can["main"].more == {"host": "127.0.0.1", "port": 29536}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "[robot]: is missing"),
        ("[robot]", "[robot] name: is missing"),
        ("robot = 3", "[robot]: is a table, not 3"),
        ("[robot\n", "is no TOML"),
        ('[robot]\nname = ""', "[robot] name: must not be empty"),
        ("[robto]\n", "[robto]: is not known: did you mean 'robot'?"),
        (
            '[robot]\nname="x"\nnmae="y"',
            "[robot] nmae: is not known: did you mean 'name'? allowed are name",
        ),
        (HEAD + "[gatway]\n", "did you mean 'gateway'?"),
        (HEAD + "[joint]\nbus = 1", "[joint]: holds tables, each with its name: write [joint.NAME]"),
        (
            HEAD + JOINT.replace("node_id = 2", 'node_id = "two"'),
            "[joint.knee] node_id: must be a whole number, not text",
        ),
        (
            HEAD + JOINT.replace("node_id = 2", "node_id = 128"),
            "[joint.knee] node_id: must be a whole number, at most 127",
        ),
        (HEAD + JOINT.replace("node_id = 2\n", ""), "[joint.knee] node_id: is missing"),
        (HEAD + JOINT.replace("gear_ratio", "gear_ration"), "did you mean 'gear_ratio'?"),
        (HEAD + JOINT + "direction = 2", "[joint.knee] direction: 2 is not known: allowed are 1, -1"),
        (
            HEAD + JOINT.replace('"main"', '"mian"'),
            "[joint.knee] bus: there is no bus 'mian': did you mean 'main'? [can.NAME] tables here: main",
        ),
        (
            HEAD + JOINT + JOINT.replace("knee", "hip"),
            "[joint.hip] node_id: 2 on bus 'main' belongs to [joint.knee]",
        ),
        (
            HEAD + JOINT + '[device.gait]\nbus="main"\nnode_id=2\neds="x.eds"',
            "[device.gait] node_id: 2 on bus 'main'",
        ),
        (HEAD + JOINT + '[insole.knee]\nport="/dev/a"', "the name 'knee' is that of [joint.knee] too"),
        (
            HEAD + '[insole."a.b"]\nport="/dev/a"',
            '[insole."a.b"]: a name is a letter, then letters, digits, _ and -',
        ),
        (HEAD + '[insole.resource]\nport="/dev/a"', "is taken by the gateway itself"),
        (
            HEAD + '[imu.a]\nport="/dev/a"\n[imu.b]\nport="/dev/a"',
            "[imu.b] port: '/dev/a' is in use by [imu.a]",
        ),
        (HEAD + '[insole.a]\nport="/dev/a"\n[imu.b]\nport="/dev/a"', "in use by [insole.a]"),
        (
            HEAD + '[insole.a]\nport="/dev/a"\n[insole.b]\nport="/dev/a"\nbaudrate=9600',
            "same baudrate and format",
        ),
        (
            HEAD + '[parameter."knee.x"]\nobject="0x2001:0"',
            "there is no joint or device 'knee': here are none",
        ),
        (HEAD + JOINT + '[parameter.knee.x]\nobject="0x2001:0"', 'write [parameter."knee.x"]'),
        (HEAD + JOINT + '[parameter."knee"]\nobject="0x2001:0"', 'a parameter is called "component.name"'),
        (
            HEAD + JOINT + '[parameter."knee.x"]\nobject="2001"',
            '[parameter."knee.x"] object: must be index and sub-index',
        ),
        (HEAD + JOINT + '[parameter."knee.x"]\nobject="0x2001:256"', "subindex goes from 0 to 255"),
        (HEAD + JOINT + '[parameter."knee.x"]\nobject="0x6040:0"', "a controlword: it enables drives"),
        (HEAD + JOINT + '[parameter."knee.x"]\nobject="0x6840:0"', "a controlword: it enables drives"),
        (HEAD + JOINT + '[parameter."knee.x"]\nobject="0x2001:0"\nmin=2\nmax=1', "min: 2 is above max 1"),
        (HEAD + JOINT + '[parameter."knee.x"]\nobject="0x2001:0"\nmax=nan', "max: nan is no finite number"),
        (
            HEAD + JOINT + '[parameter."knee.x"]\nobject="0x2001:0"\nscale=0',
            "scale: 0 would make every value 0",
        ),
        (
            HEAD
            + JOINT
            + '[parameter."knee.x"]\nobject="0x2001:0"\n[parameter."knee.y"]\nobject="0x2001:0x0"',
            """0x2001:0x0 of node 2 on bus 'main' is [parameter."knee.x"] already; keep one""",
        ),
        (
            HEAD
            + JOINT
            + JOINT.replace("knee", "hip")
            + 'axis = 1\n[parameter."knee.x"]\nobject="0x2001:1"\n[parameter."hip.x"]\nobject="0x2001:1"',
            '[parameter."hip.x"] object: 0x2001:1 of node 2 on bus \'main\' is [parameter."knee.x"] already',
        ),
        (
            HEAD + JOINT + '[parameter."knee.x"]\nobject="0x2001:0"\nmax_step=0',
            "max_step: must be a number above 0",
        ),
        (
            HEAD + JOINT + '[parameter."knee.x"]\nobject="0x2001:0"\nstates=["on"]',
            "states: drive state 'on' is not known",
        ),
    ],
)
def test_what_is_wrong_is_named_with_table_key_and_remedy(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(configs.ConfigError) as caught:
        config(tmp_path, text)
    assert str(caught.value).startswith(f"{tmp_path / 'robot.toml'}: ")
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("subindex", "says"),
    [
        ("256", "the subindex goes from 0 to 255"),
        ("300", "the subindex goes from 0 to 255"),
        ("999", "the subindex goes from 0 to 255"),
        ("0x100", "must be index and sub-index"),
        ("65536", "must be index and sub-index"),
        ("-1", "must be index and sub-index"),
    ],
)
def test_a_subindex_that_no_object_has_is_refused_with_what_is_allowed(
    tmp_path: Path, subindex: str, says: str
) -> None:
    text = HEAD + JOINT + f'[parameter."knee.x"]\nobject = "0x2000:{subindex}"'
    with pytest.raises(configs.ConfigError) as caught:
        config(tmp_path, text)
    assert str(caught.value).startswith(f'{tmp_path / "robot.toml"}: [parameter."knee.x"] object')
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("subindex", "number"), [("0", 0), ("255", 255), ("0xFF", 255), ("010", 10), ("007", 7)]
)
def test_every_subindex_that_an_object_may_have_is_taken(tmp_path: Path, subindex: str, number: int) -> None:
    gait = '[device.gait]\nbus = "main"\nnode_id = 16\neds = "gait_controller.eds"\n'
    stop = f'[[stop.controller]]\ncomponent = "gait"\nobject = "0x2001:{subindex}"\nvalue = 0\n'
    named = f'[parameter."knee.x"]\nobject = "0x2000:{subindex}"'
    robot = config(tmp_path, HEAD + JOINT + gait + stop + named)
    assert robot.parameter["knee.x"].address == (0x2000, number)
    assert robot.stop.controller[0].address == (0x2001, number)


def test_two_axes_of_one_drive_share_a_node(tmp_path: Path) -> None:
    robot = config(tmp_path, HEAD + JOINT + JOINT.replace("knee", "hip") + "axis = 1\n")
    assert robot.joint["hip"].node_id == robot.joint["knee"].node_id


def test_objects_of_two_nodes_or_two_objects_of_one_are_different_parameters(tmp_path: Path) -> None:
    hip = JOINT.replace("knee", "hip").replace("node_id = 2", "node_id = 3")
    tables = '[parameter."knee.x"]\nobject="0x2001:0"\n[parameter."knee.y"]\nobject="0x2001:1"\n'
    robot = config(tmp_path, HEAD + JOINT + hip + tables + '[parameter."hip.x"]\nobject="0x2001:0"\n')
    assert list(robot.parameter) == ["knee.x", "knee.y", "hip.x"]


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(configs.ConfigError, match=r"none\.toml: cannot be read"):
        configs.load(tmp_path / "none.toml")


def test_bytes_that_are_no_text_are_named(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_bytes(b"[robot]\nname = '\xff'")
    with pytest.raises(configs.ConfigError, match="line 2: is no TOML: it is not in UTF-8"):
        configs.load(tmp_path / "robot.toml")


@pytest.mark.parametrize(
    "deep",
    ["deep = " + "[" * 5000, "deep = " + "[" * 40 + "]" * 40, "[" + ".".join("d" * 5000) + "]"],
    ids=["lists without an end", "lists", "a header"],
)
def test_a_file_that_is_nested_too_deeply_says_so_and_nothing_runs_out_of_stack(
    tmp_path: Path, deep: str
) -> None:
    """It was no TOML at a line that was not to blame, or an error of our own further on."""
    (tmp_path / "robot.toml").write_text(f"{HEAD}\n{deep}\n\n# the end")
    with pytest.raises(configs.ConfigError, match=r"robot\.toml: is nested too deeply: more than 32 tables"):
        configs.load(tmp_path / "robot.toml")


def test_what_is_nested_as_deeply_as_files_may_be_is_read() -> None:
    assert parse(b"deep = " + b"[" * 31 + b"]" * 31)
