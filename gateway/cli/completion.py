"""`gwrms completion`: what completes the command line, for each shell."""

import argparse
from typing import Final

from gateway.cli.text import say
from gateway.missing_extras import FOLDER

SHELLS: Final = ("bash", "zsh", "fish")
EPILOG: Final = """once, for your account
  bash  gwrms completion bash > ~/.local/share/bash-completion/completions/gwrms
  zsh   gwrms completion zsh > ~/.zfunc/_gwrms      # with fpath+=~/.zfunc before compinit in ~/.zshrc
  fish  gwrms completion fish > ~/.config/fish/completions/gwrms.fish"""


def main(argv: list[str]) -> int:
    """Run `gwrms completion`."""
    parser = argparse.ArgumentParser(
        prog="gwrms completion",
        description="Print the script that completes commands, options and files in a shell.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("shell", choices=SHELLS)
    shell = parser.parse_args(argv).shell
    say((FOLDER / f"gwrms.{shell}").read_text(encoding="utf-8"))
    return 0
