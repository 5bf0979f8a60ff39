"""STL files: triangles without shared corners, in binary or text form; corners at one position become one vertex.

Format: 3D Systems, "StereoLithography Interface Specification" (1989). Binary: 80 bytes of anything, the number of
facets, 50 bytes for each: normal, three corners, two bytes. The size tells the kinds apart, since binary files may
begin with "solid" as well: what is as long as its count asks for is binary, what begins with "solid" and has no
zero byte near its head is text, all else is binary with bytes behind its facets, or cut short.

Normals follow from the corners and are not kept. The two bytes are kept where they are a colour: Materialise Magics'
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
from meshtide_codec.mesh_files.formats import Written
from meshtide_codec.mesh_files.left_out import not_kept
from meshtide_codec.mesh_files.stl_text import read_text_corners
from meshtide_codec.mesh_files.welding import welded
from meshtide_codec.scene import Scene

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.source import Source

_HEADER = 80
_FACETS = 84
_LOOKED_AT = 1024
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
_TEXT = re.compile(rb"(?:\xef\xbb\xbf)?\s*solid(?!\w)", re.IGNORECASE)
_OWN = 0x8000
"""The highest bit of a facet's two bytes."""


def read_stl(source: Source, limits: FileLimits) -> Scene:
    """A scene of one mesh from an STL file of either kind.

    Raises:
        MeshFileError: it is none, is cut short, or claims too much.
    """
    data = source.data
    facets = int.from_bytes(data[_HEADER:_FACETS], "little") if len(data) >= _FACETS else 0
    size = _FACETS + _FACET.itemsize * facets
    if len(data) != size or facets == 0:
        if _TEXT.match(data) and b"\0" not in data[:_LOOKED_AT]:
            corners, notes = read_text_corners(data, limits)
            for note in notes:
                source.note(note)
            return Scene.of(_mesh(corners, ()))
        if len(data) < _FACETS:
            raise MeshFileError("the file is no STL: it begins without 'solid' and is too short for a binary one")
        if len(data) < size:
            held = (len(data) - _FACETS) // _FACET.itemsize
            raise MeshFileError(
                f"the STL file is cut short: it declares {facets} facets, but its size is that of {held}"
            )
        if facets == 0:
            raise MeshFileError(f"the STL file declares 0 facets, and {len(data) - _FACETS} bytes follow")
        source.note(f"{len(data) - size} bytes follow the last facet: left out")
    limits.check_counts(3 * facets, facets)
    rows = np.frombuffer(data, _FACET, facets, _FACETS)
    colors, note = _colors(rows["extra"], data[:_HEADER])
    if note:
        source.note(note)
    return Scene.of(_mesh(rows["corners"].reshape(-1, 3), colors))


def _mesh(corners: NDArray[np.floating], attributes: tuple[Attribute, ...]) -> Mesh:
    vertices, corner_vertices = welded(corners)
    return Mesh(vertices.astype(np.float64), corner_vertices.reshape(-1, 3), attributes)


def _colors(extra: NDArray[np.uint16], head: bytes) -> tuple[tuple[Attribute, ...], str]:
    """The colours of facets, and what to say of two bytes that are no colour."""
    if not extra.any():
        return (), ""
    fifths = np.stack([extra & 31, extra >> 5 & 31, extra >> 10 & 31], axis=1)
    levels = ((fifths * np.uint16(255) + 15) // 31).astype(np.uint8)
    own = (extra & _OWN) != 0
    place = head.find(b"COLOR=")
    if 0 <= place <= _HEADER - 10:
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


def write_stl(scene: Scene, name: str) -> Written:  # noqa: ARG001 - nothing is written beside it
    """The scene's mesh as a binary STL file: triangles, in single precision.

    Raises:
        MeshFileError: a position is beyond single precision, or there are more facets than the format can count.

    >>> from meshtide_codec.mesh import Mesh
    >>> written = write_stl(Scene.of(Mesh.checked([[0, 0, 0], [0.1, 0, 0], [0, 1, 0]], [[0, 1, 2]])), "a.stl")
    >>> len(written.data), written.notes
    (134, ('positions are rounded to single precision, by 1.5e-09 at most',))
    """
    mesh = scene.mesh()
    if len(mesh.faces) >= 1 << 32:
        raise MeshFileError(f"STL cannot count {len(mesh.faces)} facets; try ply")
    with np.errstate(over="ignore"):
        single = mesh.vertices.astype("<f4")
    if not np.isfinite(single).all():
        raise MeshFileError("a position is too large for single precision, all that STL has; try ply")
    rows = np.zeros(len(mesh.faces), _FACET)
    rows["corners"] = single[mesh.faces]
    rows["normal"] = _normals(mesh.vertices[mesh.faces])
    notes = not_kept(scene, mesh.attributes, polygons=0 if mesh.polygons is None else _polygons(mesh))
    rounding = float(np.abs(single - mesh.vertices).max()) if len(single) else 0.0
    if rounding:
        notes.insert(0, f"positions are rounded to single precision, by {rounding:.2g} at most")
    head = b"binary STL written by meshtide".ljust(_HEADER, b" ")
    return Written(head + len(rows).to_bytes(4, "little") + rows.tobytes(), notes=tuple(notes))


def _polygons(mesh: Mesh) -> int:
    """How many polygons of more than three corners there are."""
    return sum(len(outline) > 3 for outline in mesh.polygon_corners())


def _normals(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals (m, 3) of triangles (m, 3, 3); zeros where there is no area."""
    with np.errstate(all="ignore"):
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    unit: NDArray[np.float64] = np.nan_to_num(normals, nan=0.0, posinf=0.0, neginf=0.0)
    return unit
