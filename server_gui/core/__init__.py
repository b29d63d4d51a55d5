"""The server without Qt: links to robots and what is made of their data."""
