"""The server's commands, a file each: `gwrms collect` is collect.py. Imported only when one runs."""
