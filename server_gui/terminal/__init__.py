"""The terminal's views and the demo: child processes, keys, the dashboard, the headless run."""
