"""STL: a binary file's count of facets against its size; of a text file, the facets are counted.

Format: 3D Systems, "StereoLithography Interface Specification" (1989). Binary: 80 bytes of anything, the number of
facets, 50 bytes a facet. Some programs begin binary files with "solid" too, so the size decides.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, BinaryIO

from meshtide_codec.errors import MeshFileError
from meshtide_codec.file_checks.text_lines import lines

if TYPE_CHECKING:
    from meshtide_server.upload_checks.limits import UploadLimits

HEADER_BYTES = 84
FACET_BYTES = 50
CORNERS = 3


def check_stl(file: BinaryIO, size: int, limits: UploadLimits) -> None:
    """Check an uploaded STL file of `size` bytes.

    Raises:
        MeshFileError: it is none, declares more facets than it holds, or too many.
    """
    head = file.read(HEADER_BYTES)
    facets = struct.unpack("<I", head[80:])[0] if len(head) == HEADER_BYTES else 0
    if len(head) == HEADER_BYTES and size == HEADER_BYTES + FACET_BYTES * facets:
        limits.check_counts(CORNERS * facets, facets)
    elif head.lstrip()[:5].lower() == b"solid":
        file.seek(0)
        _check_text(file, limits)
    else:
        held = max(0, size - HEADER_BYTES) // FACET_BYTES
        raise MeshFileError(f"the STL file declares {facets} facets, but its size is that of {held}")


def _check_text(file: BinaryIO, limits: UploadLimits) -> None:
    facets = corners = 0
    for line in lines(file):
        word = line.split(None, 1)[:1]
        facets += word == [b"facet"]
        corners += word == [b"vertex"]
        limits.check_counts(corners, facets)
    if facets == 0 or corners != CORNERS * facets:
        raise MeshFileError(f"the STL file has {facets} facets and {corners} vertices, which are three for each facet")
