"""The signals workspace without Qt: plots and their curves, expressions, triggers, layouts as files."""
