"""The installed command `gwrms`: Ctrl-C while it still loads ends it as well as later."""


def main() -> int:
    """Run `gwrms` with the process's own arguments and return its exit status."""
    try:
        from gateway.main import main as run

        return run()
    except KeyboardInterrupt:
        return 130
