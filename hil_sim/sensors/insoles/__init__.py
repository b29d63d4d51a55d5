"""The insoles: a file each, whose INSOLE is its language and CELLS its cells; its name is the file's."""
