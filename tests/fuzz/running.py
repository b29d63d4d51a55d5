"""Runs a target for some time, guided by coverage where atheris is there, and says what it found."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz.catalogue import HERE, corpus, target
from tests.fuzz.mutations import mutations

ROOT = HERE.parents[1]
ONE_INPUT_S = 20  # longer, and it counts as hanging
_EXECUTED = re.compile(r"stat::number_of_executed_units: (\d+)")
_LAST = re.compile(r"^#(\d+)\s", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run came to; `said` is the error, and `data` its input, where one was found."""

    executions: int
    seconds: float
    said: str | None = None
    data: bytes = b""


def is_guided() -> bool:
    """Whether coverage can guide the search here."""
    return importlib.util.find_spec("atheris") is not None


def run(name: str, seconds: float, *, seed: int = 1, tree: Path = ROOT) -> Outcome:
    """Try inputs for so long, or until one is found; `tree` is where the code under test is."""
    return (_guided if is_guided() else _blind)(name, seconds, seed, tree)


def _guided(name: str, seconds: float, seed: int, tree: Path) -> Outcome:
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="gwrms-fuzz-") as folder:
        kept = Path(folder)
        shutil.copytree(HERE / "corpus" / name, kept / "corpus")  # what is new stays out of the checkout
        _write_dictionary(kept / "tokens", target_tokens(name))
        options = [
            f"-max_total_time={max(1, round(seconds))}",
            f"-seed={seed}",
            f"-timeout={ONE_INPUT_S}",
            f"-dict={kept / 'tokens'}",
            f"-artifact_prefix={kept}/found-",
            "-max_len=4096",
            "-rss_limit_mb=3000",
            "-print_final_stats=1",
            str(kept / "corpus"),
        ]
        done = subprocess.run(
            [sys.executable, "-m", "tests.fuzz.guided", name, *options],
            cwd=tree,
            env=_environment(tree),
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
        output = done.stdout + done.stderr
        found = sorted(kept.glob("found-*"))
        data = found[0].read_bytes() if found else b""
    said = None if done.returncode == 0 else _said(output)
    return Outcome(_executions(output), time.monotonic() - began, said, data)


def _blind(name: str, seconds: float, seed: int, tree: Path) -> Outcome:
    """In a process of its own too, because the tree may be another."""
    with tempfile.TemporaryDirectory(prefix="gwrms-fuzz-") as folder:
        file = Path(folder) / "found"
        began = time.monotonic()
        done = subprocess.run(
            [sys.executable, "-m", "tests.fuzz.running", name, str(seconds), str(seed), str(file)],
            cwd=tree,
            env=_environment(tree),
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
        data = file.read_bytes() if file.exists() else b""
    tries = int(done.stdout.strip() or 0)
    said = None if done.returncode == 0 else done.stderr.strip()
    return Outcome(tries, time.monotonic() - began, said, data)


def _try_blindly(name: str, seconds: float, seed: int, file: Path) -> int:
    chosen = target(name)
    until = time.monotonic() + seconds
    tries = 0
    for data in _inputs(name, chosen.tokens, seed):
        tries += 1
        try:
            chosen.fuzz(data)
        except Exception:  # noqa: BLE001 - this is what is looked for
            file.write_bytes(data)
            sys.stdout.write(f"{tries}\n")
            traceback.print_exc()
            return 1
        if time.monotonic() > until:
            break
    sys.stdout.write(f"{tries}\n")
    return 0


def _inputs(name: str, tokens: tuple[bytes, ...], seed: int) -> Iterator[bytes]:
    known = list(corpus(name))
    yield from known
    yield from mutations(known, tokens, seed)


def target_tokens(name: str) -> tuple[bytes, ...]:
    return target(name).tokens


def _write_dictionary(file: Path, tokens: tuple[bytes, ...]) -> None:
    lines = ("".join(f"\\x{byte:02X}" for byte in token) for token in tokens)
    file.write_text("".join(f'"{line}"\n' for line in lines), encoding="ascii")


def _environment(tree: Path) -> dict[str, str]:
    paths = [str(tree), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths)), "PYTHONHASHSEED": "0"}


def _executions(output: str) -> int:
    told = _EXECUTED.findall(output) or _LAST.findall(output)
    return int(told[-1]) if told else 0


def _said(output: str) -> str:
    """From the error on, without what libFuzzer says of itself."""
    begin = output.find("=== Uncaught Python exception")
    if begin < 0:
        return output[-3000:].strip()
    return output[begin:].partition("\n")[2].partition("\n\n")[0].strip()


if __name__ == "__main__":
    raise SystemExit(_try_blindly(sys.argv[1], float(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4])))
