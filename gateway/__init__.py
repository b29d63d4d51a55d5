"""The robot side: on-demand daemon, its modules, its client."""
