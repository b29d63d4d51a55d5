"""Parameters as files: TOML and DCF, and their comparison with what a robot holds."""
