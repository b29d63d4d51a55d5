"""CiA 402 joint drives."""
