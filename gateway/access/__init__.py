"""Access control: keys, known clients and their roles, and pairing."""
