"""What the chapters about wiring a sensor show works as it stands there."""

import re
from pathlib import Path

from drivers.cli.decode import FORMATS
from drivers.imu.canopen import FORMATS as CANOPEN_FORMATS
from gateway import config
from gateway.modules.component.assembly import assemble
from hil_sim.sensors.suite import IMUS, INSOLES

ROOT = Path(__file__).parents[3]


def test_the_readmes_table_of_a_sensor_builds_its_component(tmp_path: Path) -> None:
    _, _, chapter = (ROOT / "README.md").read_text(encoding="utf-8").partition("## Wire a sensor")
    found = re.search(r"```toml\n(.*?)```", chapter, re.DOTALL)
    assert found is not None
    file = tmp_path / "robot.toml"
    file.write_text(found[1], encoding="utf-8")
    robot = assemble(config.load(file))
    assert robot.absent == {}
    assert {"trunk.tilt_forward", "trunk.tilt_side"} <= {
        channel.name for channel in robot.components["trunk"].channels
    }


def test_the_document_names_every_format() -> None:
    text = (ROOT / "docs" / "sensors.md").read_text(encoding="utf-8")
    known = {*FORMATS, *CANOPEN_FORMATS}
    assert [name for name in known if f"`{name}`" not in text and f'"{name}"' not in text] == []
    assert {imu.removesuffix("-binary") for imu in IMUS} | set(INSOLES) == known
