"""Who may do what: keys, the clients that are known by theirs, roles, and how both are made known."""
