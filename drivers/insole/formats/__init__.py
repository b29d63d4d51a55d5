"""The insoles' languages: a file each that defines FORMAT, found by its name."""

from typing import TYPE_CHECKING

from drivers.folder import Folder

if TYPE_CHECKING:
    from drivers.insole.format import Format

FORMATS: "Folder[Format]" = Folder(__name__)
