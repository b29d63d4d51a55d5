"""What an extra is for is imported with the packages that it brings, and checks files without any."""

import subprocess
import sys
from pathlib import Path

import pytest

from gateway.main import COMMANDS
from tests.support.extras import EXTRAS, PROJECT, ROOT, brought, imported, names

ROBOT_SIDE = ("gateway", "drivers", "eds", "hil_sim")
BASE = [
    "gwrms",
    "gateway.daemon",
    "gateway.service",
    "hil_sim.robot",
    "hil_sim.scenario.runner",
    "server_gui.core.settings.schema",
    *(where.partition(":")[0] for where, _ in COMMANDS.values() if where.startswith(ROBOT_SIDE)),
]
TERMINAL = ["server_gui.terminal.demo", "server_gui.terminal.dashboard", "server_gui.cli.top"]
DESK = sorted(
    str(file.relative_to(ROOT).with_suffix("")).replace("/", ".")
    for part in (
        "server_gui/cli",
        "server_gui/core",
        "server_gui/terminal",
        "ml/store",
        "ml/robot",
        "ml/serving",
    )
    for file in (ROOT / part).rglob("[!_]*.py")
)
ASKING = ["server_gui.cli.query", "ml.store.query"]
COLLECTING = [name for name in DESK if name not in ASKING]
FOR = {
    None: BASE,
    "sim": [*BASE, *TERMINAL],
    "collect": [*BASE, *COLLECTING],
    "query": DESK,
    "server": [*DESK, "server_gui.app"],
}
# In a process of its own: what is imported once cannot be missing any more.
ALONE = """
import importlib, sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {missing}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
"""


def alone(extra: str | None, script: str) -> subprocess.CompletedProcess[str]:
    """Run it where no package is that does not come with the extra."""
    everything = set().union(*map(brought, EXTRAS))
    missing = imported(everything) - imported(brought(extra))
    return subprocess.run(
        [sys.executable, "-c", ALONE.format(missing=sorted(missing)) + script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("extra", FOR)
def test_what_an_extra_is_for_is_imported_with_it(extra: str | None) -> None:
    done = alone(extra, f"for name in {FOR[extra]}: importlib.import_module(name)")
    assert done.returncode == 0, done.stderr


def test_a_robot_needs_five_packages() -> None:
    five = {"python-can", "canopen", "pyserial", "psutil", "msgspec"}
    assert names(PROJECT["dependencies"]) == five
    assert not {"numpy", "rich", "pyarrow"} & brought(None)


def test_a_servers_file_is_checked_without_any_extra(tmp_path: Path) -> None:
    file = tmp_path / "server.toml"
    file.write_text(
        '[robots]\nexo-01 = "192.0.2.7:7420"\n[store]\nurl = "ftp://lab"\n'
        '[[rules]]\ntask = "faling"\nlabel = "fall"\nat_least = 0.9\n'
    )
    done = alone(None, f"from gateway.main import main; sys.exit(main(['check', {str(file)!r}]))")
    assert (done.returncode, done.stderr) == (1, "")
    assert "'ftp://lab' is no store: use file:///folder or s3://bucket/prefix" in done.stdout
    assert "did you mean" in done.stdout
