"""What the images are made from is there, and what they run are commands; nothing is built here."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from gateway.main import COMMANDS
from gateway.missing_extras import help_of
from tests.support.extras import EXTRAS, ROOT
from tests.support.waiting import until
from tests.unit.docker.dockerfile import Step, read

DOCKERFILE = ROOT / "docker" / "Dockerfile"
IGNORED = (ROOT / ".dockerignore").read_text(encoding="utf-8").split()
STEPS = read(DOCKERFILE)
TARGETS = ("collect", "sim")


def of(kind: str, stage: str | None = None) -> list[Step]:
    return [step for step in STEPS if step.kind == kind and stage in (None, step.stage)]


def inherited(kind: str, stage: str) -> list[Step]:
    """The steps of a stage and of those that it goes on from."""
    (begin,) = of("FROM", stage)
    before = begin.words[0]
    earlier = inherited(kind, before) if of("FROM", before) else []
    return [*earlier, *of(kind, stage)]


def test_what_is_copied_is_there_and_not_ignored() -> None:
    copied = [word for step in of("COPY") if not step.words[0].startswith("--") for word in step.words[:-1]]
    assert {"gateway", "pyproject.toml", "docker/sim.sh"} <= set(copied)
    assert [name for name in copied if not (ROOT / name).exists()] == []
    assert [name for name in copied if f"!{name.partition('/')[0]}" not in IGNORED] == []


def test_stages_are_there() -> None:
    stages = [step.stage for step in of("FROM")]
    assert set(TARGETS) <= set(stages)
    named = [word.partition("=")[2] for step in STEPS for word in step.words if word.startswith("--from=")]
    assert set(named) <= set(stages)


def test_all_that_the_wheel_is_made_of_is_copied() -> None:
    copied = {word for step in of("COPY", "source") for word in step.words}
    built = re.findall(r"^packages = (\[.*\])$", (ROOT / "pyproject.toml").read_text(), re.MULTILINE)[0]
    assert set(json.loads(built)) | {"docs", "scenarios"} <= copied


def test_extras_that_are_installed_exist() -> None:
    named = re.findall(r"'\.\[(\w+)\]'", DOCKERFILE.read_text(encoding="utf-8"))
    assert named == ["collect"]
    assert set(named) <= set(EXTRAS)


@pytest.mark.parametrize("target", TARGETS)
def test_an_image_runs_as_nobody_in_particular_and_keeps_data(target: str) -> None:
    assert [step.words for step in inherited("USER", target)] == [["gwrms"]]
    assert [step.words for step in inherited("VOLUME", target)] == [["/data"]]


@pytest.mark.parametrize("target", TARGETS)
def test_health_is_asked_by_a_command_that_there_is(target: str) -> None:
    (asked,) = inherited("HEALTHCHECK", target)
    program, command, *rest = json.loads(asked.text[asked.text.index("[") :])
    assert program == "gwrms"
    assert command in COMMANDS
    page = help_of([command, "--help"])
    assert page is not None
    assert all(word in page for word in rest)


def test_the_collector_has_its_files_where_the_page_says() -> None:
    told = {name: value for step in inherited("ENV", "collect") for name, value in step.pairs()}
    assert (told["XDG_DATA_HOME"], told["XDG_CONFIG_HOME"]) == ("/data", "/etc")
    page = (ROOT / "docs/how-to/containers.md").read_text(encoding="utf-8")
    assert "/etc/gwrms/server.toml" in page
    assert "gwrms-data:/data" in page


def test_versions_are_those_of_the_lock() -> None:
    lines = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    (made,) = re.findall(r"(sed .*) > versions.txt", DOCKERFILE.read_text(encoding="utf-8"))
    ran = subprocess.run(shlex.split(made), cwd=ROOT, capture_output=True, text=True, check=True)
    versions = [line for line in ran.stdout.splitlines() if not line.lstrip().startswith("#")]
    assert versions == re.findall(r"^(\w[^\\\n]*?) \\?$", lines, re.MULTILINE)


ASKED = re.compile(r"gwrms pair (127\.0\.0\.1:\d+)\s+It asks for this code:\s+(\S+)")


@pytest.fixture
def programs(tmp_path: Path) -> dict[str, str]:
    """An environment in which `gwrms` is ours."""
    program = tmp_path / "bin" / "gwrms"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -P -m gateway.main "$@"\n')
    program.chmod(0o755)
    return os.environ | {
        "PATH": f"{program.parent}:{os.environ['PATH']}",
        "ROBOT_DIR": str(tmp_path / "robot"),
        "ROBOT_HOST": "127.0.0.1",
        "ROBOT_PORT": "0",
        "ROBOT_PAIRING_PORT": "0",
    }


def test_the_simulators_image_serves_a_robot_with_keys_once_paired_and_ends_whole(
    programs: dict[str, str], tmp_path: Path
) -> None:
    said = tmp_path / "said"
    with said.open("wb") as out:
        process = subprocess.Popen(
            [ROOT / "docker/sim.sh", "--scenario", "stand"],
            env=programs,
            stdout=out,
            stderr=out,
            process_group=0,
        )
    try:
        until(lambda: said.read_text().count("listening on 127.0.0.1:") == 1, "it listens without keys")
        asked = until(lambda: ASKED.search(said.read_text()), "it shows a code")
        home = programs | {"HOME": str(tmp_path)}
        subprocess.run(["gwrms", "pair", *asked.groups()], env=home, check=True, capture_output=True)
        until(lambda: said.read_text().count("listening on 127.0.0.1:") == 2, "it listens with keys")
        process.send_signal(signal.SIGTERM)
        assert process.wait(60.0) == 128 + signal.SIGTERM
        with pytest.raises(ProcessLookupError):
            os.killpg(process.pid, 0)  # nobody is left of simulator and gateway
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def test_a_simulator_that_cannot_run_ends_the_image(programs: dict[str, str]) -> None:
    script = [str(ROOT / "docker/sim.sh"), "--scenario", "dance"]
    ended = subprocess.run(script, env=programs, capture_output=True, text=True, timeout=60.0, check=False)
    assert ended.returncode == 1
    assert "dance" in ended.stderr
