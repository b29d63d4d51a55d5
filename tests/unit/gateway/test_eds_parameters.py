"""Parameters that an EDS offers: their names, what locks them, what releases them, and every number type."""

from collections.abc import Callable
from pathlib import Path

import pytest

import eds
from drivers.samples import Quality
from eds.datatypes import DATA_TYPES
from eds.naming import identifier
from gateway.config import ConfigError
from gateway.config.robot import DeviceTable, JointTable
from gateway.modules.control.catalogue import Catalogue, resolve
from gateway.modules.control.parameters import Lock, Parameter
from gateway.wire.framing import RpcError
from gateway.wire.parameter import ParameterInfo
from tests.unit.gateway.harness import DISABLED, HEAD, ROBOT, Bench, Client, config, serving

KNEE = """
[joint.knee]
bus = "main"
node_id = 2
eds = "{eds}"
counts_per_revolution = 4096
gear_ratio = 100.0
parameters = "eds"
release = {release}
"""
NUMBERS = {
    code: one for code, one in DATA_TYPES.items() if one.kind in ("boolean", "signed", "unsigned", "real")
}


def catalogue(
    folder: Path, release: str = "[]", eds_file: str = "joint_drive.eds", more: str = ""
) -> Catalogue:
    robot = config(folder, HEAD + KNEE.format(eds=eds_file, release=release) + more)
    tables: dict[str, JointTable | DeviceTable] = {**robot.joint, **robot.device}
    found = {name: eds.load(eds.locate(one.eds, robot.path), one.node_id) for name, one in tables.items()}
    return resolve(robot, found, {})


# Names


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("Profile velocity (counts/s)", "profile_velocity"),
        ("Current controller P gain", "current_controller_p_gain"),
        ("software_position_limit_min", "software_position_limit_min"),
        ("Grenzwert für Strom", "grenzwert_fur_strom"),
        ("位置", ""),
        ("(only a remark)", ""),
    ],
)
def test_a_name_is_what_the_eds_says_made_typeable(text: str, name: str) -> None:
    assert identifier(text) == name


def test_what_is_no_number_is_there_to_be_read_and_never_taken_for_a_value(tmp_path: Path) -> None:
    known = catalogue(tmp_path, eds_file="elmo_gold.dcf")
    texts = [one for one in known.values() if not one.is_number]
    assert texts
    assert {one.read_only for one in texts} == {"no number"}
    assert not {one.name for one in texts} & {one.name for one in known.chosen(None)}
    name, domain = known["knee.0x1008:0"], next(one for one in texts if one.is_long)
    assert name.told(b"Gold\0\0") == "Gold"
    assert name.told(b"\xff\x07") == "\N{REPLACEMENT CHARACTER}" * 2
    assert domain.told(bytes(3)) == "00 00 00"
    assert str(domain.told(bytes(5000))).endswith("… (5000 bytes)")
    assert [one.is_long for one in known.chosen(["knee.*"])].count(True) == 0
    assert known.chosen([domain.name]) == [domain]
    with pytest.raises(RpcError, match="read-only, the EDS says"):
        name.encode(1)


def test_every_writable_number_of_the_eds_is_there_once_by_name_and_by_address(tmp_path: Path) -> None:
    for file in ("joint_drive.eds", "elmo_gold.dcf", "trinamic_tmcm_1270.eds"):
        known = catalogue(tmp_path, eds_file=file)
        description = eds.load(eds.locate(file, None), 2)
        expected = {
            (one.index, one.subindex)
            for one in description.variables()
            if one.access_type in ("rw", "rwr", "rww") and one.data_type in NUMBERS
        }
        numbers = [one for one in known.values() if one.is_number]
        assert {(one.index, one.subindex) for one in numbers} == expected
        assert len(numbers) == len(expected) > 80
        for name, one in known.items():
            assert known[f"knee.0x{one.index:04X}:{one.subindex}"] is one
            assert name.removeprefix("knee.").replace("_", "").replace(":", "").isalnum()


def test_the_default_of_the_eds_is_told_in_the_parameters_own_unit(tmp_path: Path) -> None:
    table = '[parameter."knee.torque"]\nobject = "0x6072:0"\nunit = "N·m"\nscale = 0.04\nmax = 50.0\n'
    known = catalogue(tmp_path, more=table)
    description = eds.load(eds.locate("joint_drive.eds", None), 2)
    for one in known.values():
        variable = description.variable(one.index, one.subindex)
        assert variable is not None
        if one.name == "knee.torque":
            assert (variable.default, one.info.default) == (2000, 80.0)
        else:
            assert one.info.default == (variable.default if one.is_number else None)
    assert any(one.info.default is None for one in catalogue(tmp_path, eds_file="elmo_gold.dcf").values())


def test_a_sub_object_is_named_behind_its_object(tmp_path: Path) -> None:
    known = catalogue(tmp_path)
    assert known["knee.software_position_limit_min_position_limit"].object == "0x607D:1"
    assert known["knee.interpolation_time_period_value"].object == "0x60C2:1"
    assert known["knee.max_torque"].settings.unit == "0.001 of rated torque"


SAME_NAMES = """\
[DeviceInfo]
ProductName=Twins
[2001]
ParameterName=Gain
DataType=0x0006
AccessType=rw
[2002]
ParameterName=GAIN
DataType=0x0006
AccessType=rw
[2003]
ParameterName=位置
DataType=0x0006
AccessType=rw
[2004]
ParameterName=Stiffness
DataType=0x0006
AccessType=rw
"""


def test_names_that_are_not_unique_or_no_names_carry_the_address(tmp_path: Path) -> None:
    (tmp_path / "twins.eds").write_text(SAME_NAMES, encoding="utf-8")
    assert list(catalogue(tmp_path, eds_file="twins.eds")) == [
        "knee.gain_2001:0",
        "knee.gain_2002:0",
        "knee.object_2003:0",
        "knee.stiffness",
    ]


def test_a_table_of_the_robots_file_stands_in_for_what_the_eds_offers(tmp_path: Path) -> None:
    table = '[parameter."knee.{}"]\nobject = "0x6072:0"\nunit = "N·m"\nscale = 0.04\nmax = 50.0\n'
    known = catalogue(tmp_path, more=table.format("torque_limit"))
    one = known["knee.0x6072:0"]
    assert (one.name, one.settings.unit, one.max, one.lock) == ("knee.torque_limit", "N·m", 50.0, None)
    assert "knee.max_torque" not in known
    # a name that the file gives to another object is not taken by the EDS
    known = catalogue(tmp_path, more=table.format("profile_velocity"))
    assert known["knee.profile_velocity"].object == "0x6072:0"
    assert known["knee.0x6081:0"].name == "knee.profile_velocity_6081:0"


# Locks


@pytest.mark.parametrize(
    ("object_", "release", "lock"),
    [
        ("0x6072:0", "[]", Lock.UNRELEASED),
        ("0x6072:0", '["max_torque"]', None),
        ("0x6072:0", '["0x6072:0"]', None),
        ("0x6072:0", '["max_*"]', None),
        ("0x6072:0", '["profile_*"]', Lock.UNRELEASED),
        ("0x6040:0", '["*", "controlword", "0x6040:0"]', Lock.CONTROLWORD),
        ("0x607A:0", '["*"]', Lock.COMMANDED),
        ("0x607A:0", '["target_position"]', None),
        ("0x607A:0", '["0x607A:0"]', None),
        ("0x6060:0", '["modes_*"]', Lock.COMMANDED),
        ("0x605A:0", '["*"]', Lock.STOPPING),
        ("0x605A:0", '["quick_stop_option_code"]', None),
        ("0x6007:0", '["*"]', Lock.STOPPING),
        ("0x6085:0", '["quick_*"]', Lock.STOPPING),
        ("0x60C1:1", '["*"]', Lock.COMMANDED),
        ("0x1017:0", '["*", "producer_heartbeat_time", "0x1017:0"]', Lock.COMMUNICATION),
        ("0x1801:1", '["*"]', Lock.COMMUNICATION),
        ("0x1010:1", '["*", "0x1010:1"]', Lock.STORAGE),
        ("0x1011:1", '["*", "0x1011:1"]', Lock.STORAGE),
    ],
)
def test_what_a_release_reaches(tmp_path: Path, object_: str, release: str, lock: Lock | None) -> None:
    known = catalogue(tmp_path, release, "elmo_gold.dcf" if object_ == "0x60C1:1" else "joint_drive.eds")
    assert known[f"knee.{object_}"].lock is lock


def test_what_an_rpdo_brings_is_released_by_its_whole_name_only(tmp_path: Path) -> None:
    gait = '[device.gait]\nbus = "main"\nnode_id = 16\neds = "gait_controller.eds"\nparameters = "eds"\n'
    known = catalogue(tmp_path, more=gait + 'release = ["*", "position_actual_value_left_knee"]')
    assert known["gait.0x2121:1"].lock is Lock.COMMANDED
    assert known["gait.0x2121:2"].lock is None
    assert known["gait.0x2001:0"].lock is None


def test_the_second_axis_offers_its_own_objects_and_none_that_the_first_has(tmp_path: Path) -> None:
    text = "".join(
        f"[{index:04X}]\nParameterName=Object {index:04X}\nDataType=0x0006\nAccessType=rw\n"
        for index in (0x2000, 0x6040, 0x6072, 0x6840, 0x6872, 0x7072)
    )
    (tmp_path / "axes.eds").write_text(text)
    ankle = KNEE.format(eds="axes.eds", release='["*"]').replace("joint.knee", "joint.ankle") + "axis = 1\n"
    known = catalogue(tmp_path, '["*"]', "axes.eds", ankle)
    assert list(known) == [
        "knee.object_2000",
        "knee.object_6040",
        "knee.object_6072",
        "ankle.object_6840",
        "ankle.object_6872",
    ]
    assert known["ankle.object_6840"].lock is Lock.CONTROLWORD
    assert known["ankle.object_6872"].lock is None


CONTRADICTING = """\
[2001]
ParameterName=Gain
DataType=0x0006
AccessType=rw
LowLimit=100
HighLimit=10
[2002]
ParameterName=Step
DataType=0x0006
AccessType=rw
LowLimit=10
HighLimit=100
"""


def test_limits_that_contradict_each_other_lock_what_they_are_of(tmp_path: Path) -> None:
    (tmp_path / "limits.eds").write_text(CONTRADICTING)
    table = '[parameter."knee.size"]\nobject = "0x2002:0"\n'
    for eds_file, release in (("limits.eds", '["*"]'), ("limits.eds", '["gain"]')):
        one = catalogue(tmp_path, release, eds_file)["knee.gain"]
        assert one.info.problem == (
            "its limits allow nothing: minimum 100 is above maximum 10; correct limits.eds"
        )
        with pytest.raises(RpcError, match="its limits allow nothing"):
            one.encode(50)
    for limits, problem in (("min = 50", None), ("min = 101", "minimum 101"), ("max = 9", "maximum 9")):
        known = catalogue(tmp_path, "[]", "limits.eds", table + limits)
        said = known["knee.size"].problem
        assert (said is None) if problem is None else (problem in str(said))
        assert said is None or 'correct limits.eds or [parameter."knee.size"]' in said
    own = '[parameter."knee.gain"]\nobject = "0x2001:0"\nmin = 20\nmax = 30\n'
    assert catalogue(tmp_path, "[]", "limits.eds", own)["knee.gain"].problem is not None


def test_what_another_axis_of_the_node_names_is_not_offered_once_more(tmp_path: Path) -> None:
    text = "[2000]\nParameterName=Gain\nDataType=0x0006\nAccessType=rw\n"
    (tmp_path / "axes.eds").write_text(text)
    ankle = KNEE.format(eds="axes.eds", release='["*"]').replace("joint.knee", "joint.ankle") + "axis = 1\n"
    ankle += '[parameter."ankle.gain"]\nobject = "0x2000:0"\nmax = 5\n'
    assert list(catalogue(tmp_path, '["*"]', "axes.eds", ankle)) == ["ankle.gain", "knee.*"]


def test_a_release_that_means_nothing_is_seen_where_parameters_are(tmp_path: Path) -> None:
    known = catalogue(tmp_path, '["max_torq", "gian_*", "0x6072:1", "max_torque"]')
    problems = {one.name: one.problem for one in known.values() if one.problem}
    assert set(problems) == {"knee.max_torq", "knee.gian_*", "knee.0x6072:1"}
    assert "[joint.knee] release: joint_drive.eds" in str(problems["knee.max_torq"])
    assert "did you mean 'max_torque'?" in str(problems["knee.max_torq"])


@pytest.mark.parametrize(
    ("release", "parameters", "words"),
    [
        ('["max_torque"]', "", 'nothing to release without parameters = "eds"'),
        ('["knee.max_torque"]', 'parameters = "eds"', "write 'max_torque', without the table's own name"),
        ('"max_torque"', 'parameters = "eds"', "[joint.knee] release: must be a list, not text"),
        ("[]", 'parameters = "all"', "[joint.knee] parameters: 'all' is not known"),
    ],
)
def test_a_release_that_cannot_work_is_refused(
    tmp_path: Path, release: str, parameters: str, words: str
) -> None:
    table = KNEE.format(eds="joint_drive.eds", release=release).replace('parameters = "eds"', parameters)
    with pytest.raises(ConfigError) as caught:
        config(tmp_path, HEAD + table)
    assert words in str(caught.value)


@pytest.mark.parametrize("object_", ["0x1010:1", "0x1011:4"])
def test_store_and_restore_are_no_parameters(tmp_path: Path, object_: str) -> None:
    table = KNEE.format(eds="joint_drive.eds", release="[]")
    with pytest.raises(ConfigError, match="use gwrms store and gwrms restore"):
        config(tmp_path, HEAD + table + f'[parameter."knee.x"]\nobject = "{object_}"\n')


# Through the wire


@pytest.fixture
def offering(bench: Bench, tmp_path: Path) -> str:
    """The harness's robot, whose left knee offers its EDS and releases two of it."""
    bench.left.node.objects |= {
        (0x6081, 0): (65190).to_bytes(4, "little"),
        (0x6085, 0): (1_300_000).to_bytes(4, "little"),
        (0x1017, 0): (100).to_bytes(2, "little"),
    }
    bench.left.set_state(DISABLED)
    released = 'parameters = "eds"\nrelease = ["profile_*", "following_*"]'
    return ROBOT.replace("[joint.right_knee]", released + "\n[joint.right_knee]", 1)


def test_read_only_until_released_and_the_refusal_says_how(
    offering: str, bench: Bench, tmp_path: Path
) -> None:
    with serving(config(tmp_path, offering)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        written = client.call("parameter.write", changes={"left_knee.profile_velocity": 70000})
        assert written["after"] == {"left_knee.profile_velocity": 70000}
        error = client.refused("parameter.write", changes={"left_knee.quick_stop_deceleration": 20000})
        assert (error.kind, error.data["object"]) == ("read_only", "0x6085:0")
        assert 'its whole name "quick_stop_deceleration" to release in [joint.left_knee]' in str(error)
        error = client.refused("parameter.write", changes={"left_knee.0x6040:0": 15})
        assert (error.kind, "enables drives" in str(error)) == ("read_only", True)
        error = client.refused("parameter.write", changes={"left_knee.producer_heartbeat_time": 0})
        assert (error.kind, "how the bus works" in str(error)) == ("read_only", True)
        assert bench.left.node.written() == [(0x6081, (70000).to_bytes(4, "little"))]


def test_the_limits_of_the_eds_hold_and_a_moving_drive_keeps_what_is_not_live(
    offering: str, bench: Bench, tmp_path: Path
) -> None:
    with serving(config(tmp_path, offering)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        error = client.refused("parameter.write", changes={"left_knee.profile_velocity": 520001})
        assert (error.kind, error.data["limit"]) == ("out_of_limit", 520000)
        bench.left.set_state(0x1237)  # OPERATION ENABLED
        error = client.refused("parameter.write", changes={"left_knee.profile_velocity": 70000})
        assert error.kind == "wrong_state"
        assert bench.left.node.written() == []


def test_the_address_of_what_is_no_parameter_is_the_name_of_none(tmp_path: Path) -> None:
    plain = config(
        tmp_path,
        HEAD
        + KNEE.format(eds="joint_drive.eds", release="[]")
        .replace('parameters = "eds"', "")
        .replace("release = []", ""),
    )
    found = resolve(plain, {"knee": eds.load(eds.locate("joint_drive.eds", None), 2)}, {})
    for wrong in (
        "knee.0x6065:0",
        "knee.0x1008:0",
        "knee.0x7FFF:0",
        "hip.0x6065:0",
        "knee.0x6065:9",
        "knee.0x6065",
    ):
        with pytest.raises(RpcError, match="there is no parameter"):
            found.chosen([wrong])


def test_an_object_of_what_has_no_parameters_is_refused_and_holds_up_nobody(tmp_path: Path) -> None:
    text = HEAD + '[imu.trunk]\nbus = "main"\nnode_id = 9\nformat = "cia410"\n'
    known = {"trunk": eds.load(eds.locate("inclinometer.eds", None), 9)}
    with pytest.raises(RpcError, match="there is no parameter"):
        resolve(config(tmp_path, text), known, {}).chosen(["trunk.0x1000:0"])


def test_an_address_means_the_parameter_and_answers_go_by_name(
    offering: str, bench: Bench, tmp_path: Path
) -> None:
    with serving(config(tmp_path, offering)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        read = client.call("parameter.read", names=["left_knee.0x6081:0", "gait.0x2001:0"])
        assert set(read["values"]) == {"left_knee.profile_velocity", "gait.step_length"}
        written = client.call("parameter.write", changes={"left_knee.0x6081:0": 2000})
        assert written["after"] == {"left_knee.profile_velocity": 2000}
        twice = {"left_knee.0x6081:0": 2000, "left_knee.profile_velocity": 3000}
        assert client.refused("parameter.write", changes=twice).kind == "bad_params"
        assert client.refused("parameter.read", names=["left_knee.0x6081:1"]).kind == "unknown_name"


def test_without_names_only_what_can_be_changed_is_read(offering: str, bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path, offering)) as address, Client(address) as client:
        released = {f"left_knee.{name}" for name in ("profile_velocity", "profile_acceleration")}
        released |= {f"left_knee.{name}" for name in ("profile_deceleration", "following_error_window")}
        released |= {"left_knee.following_error_time_out", "left_knee.max_torque"}
        gait = {"gait.step_length", "gait.cycle_time", "gait.toe_height"}
        assert set(client.call("parameter.list")["values"]) == released | gait
        assert set(client.call("parameter.read")["values"]) == released | gait
        uploads = [index for what, index, _ in bench.left.node.log if what == "upload"]
        assert sorted(uploads) == sorted([0x6081, 0x6083, 0x6084, 0x6065, 0x6066, 0x6072])
        everything = client.call("parameter.list", names=["*"])["values"]
        assert len(everything) > 80
        infos = {one["name"]: one for one in client.call("robot.describe")["parameters"]}
        assert set(infos) == set(everything)
        assert (infos["left_knee.controlword"]["read_only"], infos["left_knee.controlword"]["access"]) == (
            "controlword",
            "rww",
        )
        assert infos["left_knee.profile_velocity"]["read_only"] is None
        assert infos["left_knee.profile_velocity"]["type"] == "UNSIGNED32"


def test_sixty_four_bits_go_over_the_wire_unharmed(bench: Bench, tmp_path: Path) -> None:
    object_ = "[2000]\nParameterName=Serial\nDataType=0x001B\nAccessType=rw\n"
    (tmp_path / "wide.eds").write_text(object_)
    bench.gait.node.objects[0x2000, 0] = (2**63 + 1).to_bytes(8, "little")
    text = ROBOT.replace(
        'eds = "gait_controller.eds"', 'eds = "wide.eds"\nparameters = "eds"\nrelease = ["*"]'
    )
    robot = config(tmp_path, text)
    bench.files["gait"] = str(tmp_path / "wide.eds")
    bench.left.set_state(DISABLED)
    bench.right.set_state(DISABLED)
    with serving(robot) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        read = client.call("parameter.read", names=["gait.serial"])["values"]
        assert read["gait.serial"]["value"] == 2**63 + 1
        after = client.call("parameter.write", changes={"gait.serial": 2**64 - 1})["after"]
        assert after == {"gait.serial": 2**64 - 1}
        assert client.refused("parameter.write", changes={"gait.serial": 2.0**60}).kind == "out_of_limit"


def test_hundreds_of_parameters_are_told_for_one_look_at_each_device(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a client lists must not hold up what another one asks for."""
    looks: list[int] = []
    built: list[str] = []
    quality = bench.left.quality
    info: Callable[[Parameter], ParameterInfo] = vars(Parameter)["info"].fget

    def counted(now_ns: int) -> Quality:
        looks.append(now_ns)
        return quality(now_ns)

    def build(parameter: Parameter) -> ParameterInfo:
        built.append(parameter.name)
        return info(parameter)

    monkeypatch.setattr(Parameter, "info", property(build))
    offering = ROBOT.replace("node_id = 2\n", 'node_id = 2\nparameters = "eds"\nrelease = ["*"]\n', 1)
    with serving(config(tmp_path, offering)) as address, Client(address) as client:
        assert len(client.call("robot.describe")["parameters"]) > 100
        monkeypatch.setattr(bench.left, "quality", counted)
        for method, params in (
            ("parameter.list", {"names": ["*"]}),
            ("parameter.read", {"names": ["left_*"]}),
        ):
            looks.clear()
            assert len(client.call(method, **params)["values"]) > 100
            assert len(looks) <= 2  # waiting for its device is one of them
        built.clear()
        assert len(client.call("robot.describe")["parameters"]) > 100
        assert built == []
