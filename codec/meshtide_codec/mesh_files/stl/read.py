"""STL files: triangles without shared corners, in binary or text form; corners at one position become one vertex.

Format: 3D Systems, "StereoLithography Interface Specification" (1989). Binary: 80 bytes of anything, the number of
facets, 50 bytes for each: normal, three corners, two bytes. The size tells the two kinds apart, since binary files may
begin with "solid" as well: what is as long as its count asks for is binary; what begins with "solid" and has no zero
byte near its head, or a facet there, or is in UTF-16 or UTF-32, is text; all else is binary with bytes behind its
facets, or cut short.

Normals follow from the corners and are not read. The two bytes are kept where they are a colour: Materialise Magics'
(the head has "COLOR=", the colour of facets whose highest bit is set; else red, green, blue from the lowest bits on) or
VisCAM's (blue, green, red from the lowest bits on where the highest bit is set).
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.attributes import NONE, Attribute, Domain, Kind
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.encodings import decoded, wide_encoding
from meshtide_codec.mesh_files.stl.text import read_text_corners
from meshtide_codec.mesh_files.welding import welded
from meshtide_codec.scene import Scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.source import Source

HEADER = 80
"""Bytes of anything, with which a binary file begins."""
_FACETS = 84
_LOOKED_AT = 1024
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
"""A facet of a binary file."""
_TEXT = re.compile(rb"(?:\xef\xbb\xbf)?\s*solid(?!\w)", re.IGNORECASE)
_FACET = re.compile(rb"\sfacet\s+normal\s", re.IGNORECASE)
_OWN = 0x8000
"""The highest bit of a facet's two bytes."""


def read_stl(source: Source, limits: FileLimits) -> Scene:
    """A scene of one mesh from an STL file of either kind.

    Raises:
        MeshFileError: it is none, is cut short, or claims too much.
    """
    data = source.view
    facets = int.from_bytes(data[HEADER:_FACETS], "little") if len(data) >= _FACETS else 0
    size = _FACETS + FACET.itemsize * facets
    if len(data) != size or facets == 0:
        if _is_text(data):
            corners, notes = read_text_corners(source.data, limits)
            for note in notes:
                source.note(note)
            return Scene.of(_mesh(corners, ()))
        if len(data) < _FACETS:
            raise MeshFileError("the file is no STL: it begins without 'solid' and is too short for a binary one")
        if len(data) < size:
            held = (len(data) - _FACETS) // FACET.itemsize
            raise MeshFileError(
                f"the STL file is cut short: it declares {facets} facets, but its size is that of {held}"
            )
        if facets == 0:
            raise MeshFileError(f"the STL file declares 0 facets, and {len(data) - _FACETS} bytes follow")
        source.note(f"{len(data) - size} bytes follow the last facet: left out")
    limits.check_counts(3 * facets, facets)
    rows = np.frombuffer(data, FACET, facets, _FACETS)
    colors, note = _colors(rows["extra"], bytes(data[:HEADER]))
    if note:
        source.note(note)
    return Scene.of(_mesh(rows["corners"].reshape(-1, 3), colors))


def _is_text(data: memoryview) -> bool:
    """Whether the bytes of a file whose size is not that of a binary one are those of a text."""
    head = bytes(data[:_LOOKED_AT])
    text = decoded(head)
    if _TEXT.match(text) is None:
        return False
    return wide_encoding(head) != "" or b"\0" not in text or _FACET.search(text) is not None


def _mesh(corners: NDArray[np.floating], attributes: tuple[Attribute, ...]) -> Mesh:
    vertices, corner_vertices = welded(corners)
    return Mesh(vertices.astype(np.float64), corner_vertices.reshape(-1, 3), attributes)


def _colors(extra: NDArray[np.uint16], head: bytes) -> tuple[tuple[Attribute, ...], str]:
    """The colours of facets, and what to say of two bytes that are not a colour."""
    if not extra.any():
        return (), ""
    fifths = np.stack([extra & 31, extra >> 5 & 31, extra >> 10 & 31], axis=1)
    levels = ((fifths * np.uint16(255) + 15) // 31).astype(np.uint8)
    own = (extra & _OWN) != 0
    place = head.find(b"COLOR=")
    if 0 <= place <= HEADER - 10:
        of_all = np.frombuffer(head, np.uint8, 4, place + 6)
        values = np.column_stack([levels, np.full(len(levels), of_all[3])])
        values[own] = of_all
        return (Attribute("COLOR_0", Kind.COLOR, Domain.FACE, values, normalized=True),), ""
    if not own.any():
        count = int((extra != 0).sum())
        return (), f"{count} facets have two bytes of unknown meaning behind them: left out"
    indices = np.where(own, np.cumsum(own) - 1, NONE)
    values = np.ascontiguousarray(levels[own, ::-1])
    return (Attribute("COLOR_0", Kind.COLOR, Domain.FACE, values, None if own.all() else indices, normalized=True),), ""
