"""The `gwrms eds` command."""
