"""The EDS loader."""
