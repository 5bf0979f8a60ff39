"""What an uploaded mesh file may claim, and the one sentence that refuses a larger one."""

from __future__ import annotations

from dataclasses import dataclass

from meshtide_codec.errors import MeshFileError


@dataclass(frozen=True, slots=True)
class UploadLimits:
    """Largest claims of an uploaded file.

    Args:
        vertices: vertices that reading it makes, those of repeated parts counted each time.
        faces: faces, in the same way.

    >>> UploadLimits(vertices=100, faces=200).check_counts(50, 300)
    Traceback (most recent call last):
    ...
    meshtide_codec.errors.MeshFileError: the file claims 300 faces; this server takes 200 (MESHTIDE_MAX_FACES)
    """

    vertices: int
    faces: int

    def check_counts(self, vertices: int, faces: int) -> None:
        """Hold what a file claims against the limits.

        Raises:
            MeshFileError: it is more.
        """
        for name, claimed in (("vertices", vertices), ("faces", faces)):
            if claimed > getattr(self, name):
                message = f"the file claims {claimed} {name}; this server takes {getattr(self, name)}"
                raise MeshFileError(f"{message} (MESHTIDE_MAX_{name.upper()})")
