"""TOML files that people write: read, made structs table by table, and every mistake told at once."""
