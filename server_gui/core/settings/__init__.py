"""The server's file, `server.toml`: read, checked, and edited line by line."""
