"""The signals' workspace: plots that take curves, layouts, the trigger."""
