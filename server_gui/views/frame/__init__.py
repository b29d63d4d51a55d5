"""The window around the pages: header, STOP and its keys, pages' names, panels, last line, what is kept."""
