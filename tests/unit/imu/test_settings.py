"""`[imu.NAME]` in the robot's file: by what it says, an IMU on a port, on a bus, or a node of it."""

import subprocess
import sys
from pathlib import Path

import pytest

from drivers.component import ComponentKind
from drivers.identify import recognise
from drivers.imu import formats
from drivers.imu.can_device import CanImu
from drivers.imu.device import Imu
from drivers.imu.inclinometer import Inclinometer
from gateway import config as configs
from gateway.modules.component.assembly import BUILDERS, assemble

BUS = '[robot]\nname = "x"\n[can.main]\ninterface = "virtual"\nchannel = "imu settings"\n[imu.trunk]\n'
JOINT = """
[joint.left_knee]
bus = "main"
node_id = 20
eds = "joint_drive.eds"
counts_per_revolution = 4096
gear_ratio = 100.0
"""


def load(folder: Path, text: str) -> configs.RobotConfig:
    path = folder / "robot.toml"
    path.write_text(BUS + text)
    return configs.load(path)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ('port = "/dev/ttyUSB0"', Imu),
        ('port = "/dev/ttyUSB0"\nformat = "xsens"', Imu),
        ('bus = "main"\nformat = "witmotion-can"\ncan_id = 0x50', CanImu),
        ('bus = "main"\ncan_id = 0x50\naxes = ["y", "-x", "z"]', CanImu),
        ('bus = "main"\nformat = "cia410"\nnode_id = 20', Inclinometer),
        ('bus = "main"\nnode_id = 20\ndirections = [1, -1]', Inclinometer),
    ],
)
def test_each_table_builds_its_component(
    tmp_path: Path, text: str, kind: type[Imu | CanImu | Inclinometer]
) -> None:
    robot = assemble(load(tmp_path, text))
    assert robot.absent == {}
    assert type(robot.components["trunk"]) is kind
    assert [channel.name for channel in robot.components["trunk"].channels][:2] == [
        "trunk.tilt_forward",
        "trunk.tilt_side",
    ]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('bus = "main"\nformat = "cia410"', "[imu.trunk] node_id: is missing"),
        ('bus = "main"\nformat = "witmotion-can"', "[imu.trunk] can_id: is missing"),
        ('format = "witmotion"', "[imu.trunk] port: is missing"),
        ('format = []\nport = "x"', "[imu.trunk] format: must"),
        ('format = "morse"\nport = "x"', "[imu.trunk] format: 'morse' is not known: allowed are bno08x"),
        ('format = "../xsens"\nport = "x"', "format: '../xsens' is not known"),
        ('format = "cia410"\nport = "x"', "[imu.trunk] port: is not known"),
        ('bus = "main"\nformat = "xsens"\ncan_id = 80', "[imu.trunk] bus: is not known"),
        ('bus = "mian"\nnode_id = 20', "[imu.trunk] bus: there is no bus 'mian'"),
        ('bus = "mian"\ncan_id = 80', "[imu.trunk] bus: there is no bus 'mian'"),
        ('bus = "main"\nnode_id = 20\nport = "x"', "port: is not known"),
        (
            'bus = "main"\nnode_id = 20' + JOINT,
            "[imu.trunk] node_id: 20 on bus 'main' belongs to [joint.left_",
        ),
        ('bus = "main"\nnode_id = 20\ndirections = [1, 2]', "[imu.trunk] directions[1]: 2"),
    ],
)
def test_a_table_that_cannot_work_is_named(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(configs.ConfigError) as refused:
        load(tmp_path, text)
    assert says in str(refused.value)


NOVA = """
from drivers.imu.format import Format
from drivers.imu.frame import ImuFrame
from drivers.imu.settings import ImuSettings
from drivers.parsing import DelimitedParser


class NovaSettings(ImuSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    gain: float = 2.0


class NovaParser(DelimitedParser[ImuFrame]):
    def _decode(self, raw):
        return [ImuFrame("nova")] if raw == b"nova" else None


FORMAT = Format(NovaParser, settings=NovaSettings)
"""


@pytest.fixture
def nova(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file more in the folder."""
    (tmp_path / "nova.py").write_text(NOVA)
    monkeypatch.setattr(formats, "__path__", [*formats.__path__, str(tmp_path)])
    monkeypatch.delitem(sys.modules, "drivers.imu.formats.nova", raising=False)


@pytest.mark.usefixtures("nova")
def test_a_file_in_the_folder_is_all_that_a_new_format_needs(tmp_path: Path) -> None:
    robot = assemble(load(tmp_path, 'port = "/dev/ttyUSB0"\nformat = "nova"'))
    assert type(robot.components["trunk"]) is Imu
    assert load(tmp_path, 'port = "x"\nformat = "nova"\ngain = 3.0').imu["trunk"].gain == 3.0  # type: ignore[attr-defined]
    with pytest.raises(configs.ConfigError, match=r"\[imu.trunk\] gain"):
        load(tmp_path, 'port = "x"\nformat = "nova"\ngain = "much"')
    match = recognise(b"nova\0" * 20)
    assert match is not None
    assert match.format_name == "nova"


LOADS = """
import pathlib, sys
from gateway import config

there = lambda: print(*sorted(name for name in sys.modules if ".formats." in name))
robot = config.load(pathlib.Path(sys.argv[1]))
there()
from gateway.modules.component.assembly import assemble
assemble(robot)
there()
"""


def test_a_robot_imports_only_the_formats_that_it_has(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(
        '[robot]\nname = "x"\n[imu.trunk]\nport = "/dev/a"\nformat = "xsens"\n'
        '[insole.left_insole]\nport = "/dev/b"\nformat = "insole-csv"\n'
    )
    found = subprocess.run(
        [
            sys.executable,
            "-c",
            LOADS,
            str(tmp_path / "robot.toml"),
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout.splitlines() == ["", "drivers.imu.formats.xsens drivers.insole.formats.insole_csv"]


def test_every_kind_of_component_has_a_builder() -> None:
    assert set(BUILDERS) == set(ComponentKind)
