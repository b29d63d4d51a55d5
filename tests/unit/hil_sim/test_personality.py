"""Drives with the EDS or DCF of any maker: what they serve, and that the joint behind them moves."""

import tomllib
from pathlib import Path

import pytest

import eds
from eds.shipped import SHIPPED, shipped
from hil_sim import personality
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import JOINTS, Exoskeleton
from hil_sim.node.abort import SdoAbort
from hil_sim.robot import SimulatedRobot
from hil_sim.scenario.script import load
from hil_sim.scenario.table import ScenarioError
from tests.unit.hil_sim.bench import NODE, Bench
from tests.unit.hil_sim.device_file import INTEGER32, UNSIGNED16, DeviceFile

ELMO, TRINAMIC, SCHUNK = (
    SHIPPED / name for name in ("elmo_gold.dcf", "trinamic_tmcm_1270.eds", "schunk_prl.eds")
)
POSITION_MODE, NEW_SETPOINT = 1, 0x1F


def answers(bench: Bench) -> dict[tuple[int, int], str]:
    """What an SDO client gets for every object: its bytes, or the abort code."""
    got = {}
    for entry in bench.node.dictionary:
        index, subindex = entry.key
        answer = bytes.fromhex(
            bench.sdo(f"40 {index & 0xFF:02X} {index >> 8:02X} {subindex:02X} 00000000") or ""
        )
        got[entry.key] = answer[:3:-1].hex() if answer[0] == 0x80 else answer.hex()
    return got


@pytest.mark.parametrize("name", shipped())
def test_every_object_of_a_file_is_served(name: str) -> None:
    bench = Bench(file=SHIPPED / name)
    bench.boot()
    refused = {key: code for key, code in answers(bench).items() if len(code) == 8}
    described = eds.load(SHIPPED / name, NODE)
    for key, code in refused.items():
        variable = described.variable(*key)
        assert variable is not None
        assert code == "06010001" if variable.access_type == "wo" else (code, key[0]) == ("08000024", 0x1003)


@pytest.mark.parametrize("file", [ELMO, TRINAMIC])
def test_identity_limits_and_access_are_the_vendors(file: Path) -> None:
    bench = Bench(file=file)
    bench.boot()
    described = eds.load(file, NODE)
    assert bench.read(0x1018, 1) == described.vendor_id
    assert bench.read(0x1018, 2) == described.product_code
    assert bench.write(0x1018, 1, 1, 4) == "06010002"


def test_a_dcf_is_a_device_that_has_been_commissioned() -> None:
    bench = Bench(file=ELMO)
    bench.boot()
    assert bench.read(0x1A00) == 3  # ParameterValue; the file gives no default
    assert bench.read(0x1800, 2) == 1
    bench.send(0x000, "01 00")
    bench.send(0x080)
    assert len(bench.of(0x180 + NODE)[0]) == 7  # 6041h, 6061h and four bytes of Elmo's own
    assert bench.write(0x1011, 1, int.from_bytes(b"load", "little"), 4) == "ok"
    bench.send(0x000, "81 00")
    bench.run(100)
    assert bench.read(0x1800, 2) == 255  # DefaultValue


def test_event_driven_pdos_of_a_vendor_go_as_the_file_says() -> None:
    bench = Bench(file=TRINAMIC)
    bench.start()
    assert len(bench.of(0x180 + NODE)) == 1
    bench.write(0x6040, 0, 0x06, 2)
    bench.run(5)
    assert [data[0] & 0x6F for data in bench.of(0x180 + NODE)] == [0x40, 0x21]


@pytest.mark.parametrize("file", [ELMO, TRINAMIC])
def test_the_joint_behind_a_vendors_drive_moves(file: Path) -> None:
    bench = Bench(file=file)
    bench.start()
    assert bench.write(0x6060, 0, POSITION_MODE, 1) == "ok"
    for index, value in ((0x6081, 60_000), (0x6083, 200_000), (0x6084, 200_000), (0x607A, 30_000)):
        assert bench.write(index, 0, value, 4) == "ok"
    for controlword in (0x06, 0x07, 0x0F, NEW_SETPOINT):
        bench.write(0x6040, 0, controlword, 2)
    bench.run(2000)
    assert bench.read(0x6064, signed=True) == pytest.approx(30_000, abs=200)
    assert bench.joint.position == pytest.approx(30_000 / 65_190, abs=0.01)


def test_manufacturers_objects_of_a_vendor_are_not_ours() -> None:
    bench = Bench(file=TRINAMIC)
    bench.boot()
    for key in ((0x2010, 0), (0x2030, 1)):
        entry = bench.node.dictionary.get(key)
        assert entry is None or entry.source is None


def test_a_file_without_a_drives_objects_is_a_device_without_a_drive() -> None:
    bench = Bench(file=SCHUNK)
    bench.start()
    bench.run(1000)
    assert {heard.cob_id for heard in bench.heard} == {0x700 + NODE}  # its boot-up; it has no 1017h
    with pytest.raises(SdoAbort):
        bench.node.dictionary.read(0x6041, 0)


def test_where_a_file_gives_no_value_the_drive_has_its_own(tmp_path: Path) -> None:
    file = DeviceFile().add(0x6040, None, UNSIGNED16).add(0x607A, None, INTEGER32, 0)
    file.add(0x6066, None, UNSIGNED16).add(0x6072, None, UNSIGNED16, 500)
    bench = Bench(file=file.write(tmp_path))
    bench.boot()
    assert bench.read(0x6066) == 500  # ms: the following error's time
    assert bench.read(0x6072) == 500  # ‰: what the file says


# -- the robot -------------------------------------------------------------------------------------------


def test_one_file_for_all_and_others_for_some(tmp_path: Path) -> None:
    (tmp_path / "mine.eds").write_text(SCHUNK.read_text(encoding="utf-8"), encoding="utf-8")
    words = ["elmo_gold.dcf", "left_knee=trinamic_tmcm_1270.eds", "left_hip=mine.eds"]
    chosen = personality.choose(words, JOINTS, tmp_path / "scenario.toml")
    assert chosen["right_hip"] == ELMO
    assert chosen["left_knee"] == TRINAMIC
    assert chosen["left_hip"] == tmp_path / "mine.eds"
    assert personality.choose([], JOINTS, None) == {}


@pytest.mark.parametrize(
    ("word", "said"),
    [("knee=elmo_gold.dcf", "no joint 'knee'; there are left_hip"), ("none.eds", "no EDS file 'none.eds'")],
)
def test_what_cannot_be_chosen_is_named(word: str, said: str) -> None:
    with pytest.raises(SimulatorError, match=said):
        personality.choose([word], JOINTS, None)


def test_a_file_that_is_no_eds_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.eds").write_text("[FileInfo]\n", encoding="utf-8")
    with pytest.raises(SimulatorError, match=r"node 2: .*x\.eds"):
        Exoskeleton(drives={"left_knee": tmp_path / "x.eds"})


@pytest.mark.parametrize("file", [ELMO, TRINAMIC])
def test_the_controller_sets_foreign_drives_up_and_the_robot_walks(file: Path) -> None:
    robot = Exoskeleton(drives={"left_knee": file, "right_hip": file})
    heard = list[int]()
    robot.bus.attach("listener", lambda frame, _: heard.append(frame.cob_id))
    robot.power_on()
    robot.clock.run_until(2_000_000_000)
    angles = list[float]()
    for step in range(30):
        robot.clock.run_until(2_000_000_000 + step * 50_000_000)
        angles.append(robot.drives["left_knee"].joint.position)
    assert max(angles) - min(angles) > 0.5
    assert not [cob_id for cob_id in heard if 0x080 < cob_id < 0x100]  # no EMCY
    robot.drives["left_knee"].power_off()
    robot.clock.run_until(3_800_000_000)
    robot.drives["left_knee"].power_on()
    robot.clock.run_until(4_800_000_000)
    objects = robot.drives["left_knee"].dictionary
    assert objects.number((0x1A00, 0)) == 2  # set up once more
    assert objects.number((0x608F, 1)) == 4096


def test_a_drive_that_cannot_be_set_up_holds_the_robot(tmp_path: Path) -> None:
    robot = Exoskeleton(drives={"left_knee": SCHUNK})
    robot.power_on()
    robot.clock.run_until(2_000_000_000)
    assert robot.drives["left_hip"].dictionary.read(0x6041, 0)[0] & 0x6F != 0x27


def test_robot_toml_names_the_files_and_what_they_do_not_say(tmp_path: Path) -> None:
    own = tmp_path / 'my "drive".eds'
    own.write_text(TRINAMIC.read_text(encoding="utf-8"), encoding="utf-8")
    with SimulatedRobot(tmp_path / "robot", drives={"left_hip": own, "left_knee": ELMO}) as robot:
        config = tomllib.loads(robot.config.read_text(encoding="utf-8"))
    joints = config["joint"]
    assert joints["left_hip"]["eds"] == str(own)
    assert joints["left_knee"]["eds"] == "elmo_gold.dcf"
    assert joints["left_ankle"]["eds"] == "joint_drive.eds"
    assert joints["left_knee"]["rated_torque"] == 40.0
    assert "rated_torque" not in joints["left_ankle"]
    assert "left_hip.max_torque" not in config["parameter"]  # the file has no 6072h
    assert "left_hip.profile_velocity" in config["parameter"]


def test_what_a_drive_stores_is_there_at_the_next_start(tmp_path: Path) -> None:
    for expected, value in ((2000, 1500), (1500, 1400)):
        robot = SimulatedRobot(tmp_path, virtual_channel=str(tmp_path), speed=None)
        robot.open()
        robot.run(seconds=0.1)
        objects = robot.exoskeleton.drives["left_knee"].dictionary
        assert objects.number((0x6072, 0)) == expected
        objects.write(0x6072, 0, value.to_bytes(2, "little"))
        objects.write(0x1010, 1, b"save")
        robot.close()
    assert [path.name for path in (tmp_path / "stored").iterdir()] == ["left_knee.json"]


def test_a_scenario_names_files_beside_it(tmp_path: Path) -> None:
    (tmp_path / "mine.eds").write_text(TRINAMIC.read_text(encoding="utf-8"), encoding="utf-8")
    scenario = tmp_path / "scenario.toml"
    for text, knee, hip in (
        ('drive = "mine.eds"', "mine.eds", "mine.eds"),
        ('drive = ["elmo_gold.dcf", "left_knee=mine.eds"]', "mine.eds", "elmo_gold.dcf"),
    ):
        scenario.write_text(f"[robot]\n{text}\n", encoding="utf-8")
        drives = load(scenario).drives
        assert (drives["left_knee"].name, drives["left_hip"].name) == (knee, hip)


@pytest.mark.parametrize("value", ["3", "[3]", '"none.eds"', '"knee=elmo_gold.dcf"'])
def test_a_scenario_that_names_no_file_is_refused(tmp_path: Path, value: str) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(f"[robot]\ndrive = {value}\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"scenario\.toml: \[robot\] drive: "):
        load(scenario)
