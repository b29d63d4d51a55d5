"""`pytest --gwrms DIR`: which scenario files pytest takes.

It loads this in every run, whoever's tests these are: all else is imported when there is a scenario.
"""

from pathlib import Path

import pytest

_NAMED: pytest.StashKey[frozenset[Path]] = pytest.StashKey()  # what --gwrms names


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add our options."""
    group = parser.getgroup("gwrms", "scenarios of a simulated robot")
    group.addoption(
        "--gwrms",
        action="append",
        default=[],
        metavar="DIR",
        help="run the scenarios in DIR (*.toml), or this one file; tests besides only where paths name them",
    )
    group.addoption(
        "--gwrms-strict",
        action="store_true",
        help="a scenario for which this computer was too slow fails; else it is skipped",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Let pytest look into the folders that are named."""
    named = [_named(config, word) for word in config.getoption("gwrms")]
    config.stash[_NAMED] = frozenset(named)
    if not named:
        return
    if config.args_source is not pytest.Config.ArgsSource.ARGS:
        config.args.clear()
    config.args.extend(str(path) for path in named if str(path) not in config.args)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Take the scenario files among those that pytest comes across."""
    named = parent.config.stash[_NAMED]
    if file_path.suffix != ".toml" or named.isdisjoint({file_path, file_path.parent}):
        return None
    from hil_sim.pytest_scenarios import ScenarioFile

    return ScenarioFile.from_parent(parent, path=file_path)


def _named(config: pytest.Config, word: str) -> Path:
    path = (config.invocation_params.dir / word).resolve()
    if not path.exists():
        raise pytest.UsageError(f"--gwrms {word}: there is no such file or folder")
    return path
