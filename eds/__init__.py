"""EDS and DCF files: loading, checking, finding."""
