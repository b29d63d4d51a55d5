"""`gwrms completion bash`, in a bash: what is offered for what was typed."""

import subprocess
from typing import Final

import pytest

from gateway.cli.completion import main

ASKED: Final = """
COMP_WORDS=("$@"); COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
COMP_LINE="${COMP_WORDS[*]}"; COMP_POINT=${#COMP_LINE}
complete -p gwrms >/dev/null || exit 1
function=$(complete -p gwrms | sed 's/.*-F \\([^ ]*\\).*/\\1/')
"$function" gwrms "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (("gatew",), {"gateway"}),
        (("sessions", "ex"), {"export"}),
        (("check", "--kind", "s"), {"server", "scenario"}),
        (("sim-fault", "node_"), {"node_lost", "node_stopped"}),
        (("sim-fault", "--on", "left_k"), {"left_knee"}),
        (("sim-fault", "--clear", "al"), {"all"}),
        (("sim-fault", "--activity", "stairs_"), {"stairs_up", "stairs_down"}),
    ],
)
def test_words_and_names_are_offered(
    typed: tuple[str, ...], offered: set[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bash"]) == 0
    command = ["bash", "-c", capsys.readouterr().out + ASKED, "bash", "gwrms", *typed]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (set(ended.stdout.split()), ended.stderr) == (offered, "")
