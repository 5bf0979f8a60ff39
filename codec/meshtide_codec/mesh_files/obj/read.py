"""Wavefront OBJ: vertices and faces in the file's own order, wedges as they are written, polygons cut inside.

The file is read in blocks of lines (`lines`), each kind of line of a block at once. What a face means depends on
what comes before it, its relative indices on the vertices so far, its group and material on the last statement: the
lines of a block are counted for that. Format: "Object Files (.obj)", Wavefront Advanced Visualizer manual, appendix B1.
Cost: linear in the file; memory: the file, the arrays of one block, and less than twice what the scene takes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.encodings import plain_text
from meshtide_codec.mesh_files.obj.corners import ZeroIndexError, read_corners
from meshtide_codec.mesh_files.obj.lines import FACE, NORMAL, NOTHING, OTHER, TEXCOORD, VERTEX, blocks
from meshtide_codec.mesh_files.obj.materials import read_materials
from meshtide_codec.mesh_files.obj.scene import Parts, obj_scene
from meshtide_codec.mesh_files.obj.statements import Statements
from meshtide_codec.mesh_files.text_numbers import NotANumber, decimals

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.obj.lines import Block, Gathered
    from meshtide_codec.mesh_files.source import Source
    from meshtide_codec.scene import Scene

_SHOWN = 60  # bytes of a line that a message shows
_KINDS = (VERTEX, TEXCOORD, NORMAL)
_NAMES = ("vertex", "texture coordinate", "normal")
_PLURALS = ("vertices", "texture coordinates", "normals")
_LEAST = (3, 1, 3)  # numbers in a line of each kind
_HOMOGENEOUS, _COLORED, _TRANSPARENT = 4, 6, 7  # numbers after v
_TEXCOORDS = 3
_MOST_ROWS = (1 << 31) - 1  # that an int32 counts


def read_obj(source: Source, limits: FileLimits) -> Scene:
    r"""The scene of an OBJ file: one mesh with the file's own vertices, its materials and images.

    Texture coordinates and normals become `TEXCOORD_0` and `NORMAL` of corners (of vertices where each has its own),
    numbers after x y z `COLOR_0`, `g`, `o` and `s` the labels `group`, `object` and `smoothing` of faces where the file
    has several. Of the numbers after `v`, 4 are x y z w, 6 end in r g b, and 7 in r g b a.

    Raises:
        MeshFileError: there are no vertices, a number or index cannot be read or is out of range (the message names
            the line), all faces vanish, or a limit is passed.

    >>> from meshtide_codec.limits import FileLimits
    >>> from meshtide_codec.mesh_files.source import Source
    >>> read_obj(Source("a.obj", ".obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), FileLimits()).mesh()
    Mesh(3 vertices, 1 faces)
    """
    text = plain_text(source.data)
    reading = _Reading(limits)
    for block in blocks(text):
        reading.take(block)
    reading.finish(text, source)
    materials = read_materials(source, limits, reading.statements.libraries, reading.statements.material_names())
    return obj_scene(source, reading.parts, reading.statements, materials)


class _Reading:
    """What has been read of a file so far."""

    def __init__(self, limits: FileLimits) -> None:
        self.parts = Parts()
        self.statements = Statements()
        self._limits = limits
        self._sizes = [0, 0, 0]  # rows of v, vt and vn
        self._highest = [0, 0, 0]  # index from 1 that a face has named
        self._triangles = 0
        self._faces = 0
        self._last = NOTHING
        self._crowded = 0

    def take(self, block: Block) -> None:
        """Read the lines of a block.

        Raises:
            MeshFileError: see `read_obj`.
        """
        for place, kind in enumerate(_KINDS):
            lines = block.gathered(kind)
            if lines is not None:
                values, counts = self._numbers(block, lines, place)
                self._keep_rows(place, values, counts)
        self._limits.check("vertices", self._sizes[0])
        lines = block.gathered(FACE)
        if lines is not None:
            self._take_faces(block, lines)
        others = np.flatnonzero(block.kinds == OTHER)
        if len(others):
            faces = np.cumsum(block.kinds == FACE)[others] + self._faces
            for line, face in zip(others.tolist(), faces.tolist(), strict=True):
                self.statements.take(block.line(line), face)
        self._faces += 0 if lines is None else len(lines.lines)
        self._last = int(block.kinds[-1])

    def _numbers(self, block: Block, lines: Gathered, place: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """The numbers of lines of one kind, and how many are in each."""
        try:
            values, places = decimals(lines.text)
        except NotANumber as error:
            raise _error(block, lines.line_at(error.place), "these are not all numbers") from None
        counts = lines.counts(places)
        few = np.flatnonzero(counts < _LEAST[place])
        if len(few):
            least = _LEAST[place]
            message = f"a {_NAMES[place]} has at least {least} number{'s' if least > 1 else ''}"
            raise _error(block, int(lines.lines[few[0]]), message)
        return values, counts

    def _keep_rows(self, place: int, values: NDArray[np.float64], counts: NDArray[np.int64]) -> None:
        if place == 0:
            positions, colors = _positions_and_colors(values, counts)
            self.parts.tables[0].append(positions)
            if colors is not None:
                self.parts.colors.append((self._sizes[0], colors))
            odd = (counts > _HOMOGENEOUS) & (counts < _COLORED) | (counts > _TRANSPARENT)
            self._crowded += int(np.count_nonzero(odd))
        else:
            rows = _rows(values, counts, _TEXCOORDS)
            flat = place == 1 and not rows[:, 2].any()
            self.parts.tables[place].append(np.ascontiguousarray(rows[:, :2]) if flat else rows)
        self._sizes[place] += len(counts)

    def _take_faces(self, block: Block, lines: Gathered) -> None:
        try:
            corners = read_corners(lines.text)
        except ZeroIndexError as error:
            raise _error(block, lines.line_at(error.place), "index 0; those of OBJ files begin at 1") from None
        except NotANumber as error:
            message = "a corner is v, v/vt, v//vn or v/vt/vn, of whole numbers"
            raise _error(block, lines.line_at(error.place), message) from None
        counts = lines.counts(corners.places)
        triangles = bool((counts == 3).all())
        self.parts.counts.append((len(counts), None if triangles else counts))
        self._triangles += len(counts) if triangles else int(np.maximum(counts - 2, 0).sum())
        self._limits.check("faces", self._triangles)
        for place, indices in enumerate(corners.indices):
            rows = None if indices is None else self._absolute(block, lines, counts, place, indices)
            self.parts.corners[place].append((len(corners.places), rows))

    def _absolute(
        self, block: Block, lines: Gathered, counts: NDArray[np.int64], place: int, indices: NDArray[np.int64]
    ) -> NDArray[np.int32]:
        """Rows from 0, -1 for none, of indices from 1, 0 for none, negative ones counted back from their line."""
        rows = indices - 1
        negative = np.flatnonzero(indices < 0)
        if len(negative):
            own = np.flatnonzero(block.kinds == _KINDS[place])
            before = self._sizes[place] - len(own) + np.searchsorted(own, lines.lines)
            rows[negative] = indices[negative] + np.repeat(before, counts)[negative]
            early = negative[rows[negative] < 0]
            if len(early):
                line = int(np.searchsorted(np.cumsum(counts), early[0], "right"))
                number, found = int(indices[early[0]]), int(before[line])
                raise _error(block, int(lines.lines[line]), _out_of_range(place, number, found, " before it"))
        highest = int(rows.max(initial=-1)) + 1
        if highest > _MOST_ROWS:
            corner = int(np.argmax(rows))
            line = int(np.searchsorted(np.cumsum(counts), corner, "right"))
            raise _error(block, int(lines.lines[line]), _out_of_range(place, highest, self._sizes[place], " so far"))
        self._highest[place] = max(self._highest[place], highest)
        return rows.astype(np.int32)

    def finish(self, text: bytes, source: Source) -> None:
        """Check what can be known only at the end, and report what a person should know.

        Raises:
            MeshFileError: there are no vertices, or a face names one that is not there.
        """
        if self._sizes[0] == 0:
            raise MeshFileError("there are no vertices in it; an OBJ file has lines such as: v 0 0 0")
        for place in range(3):
            if self._highest[place] > self._sizes[place]:
                raise _beyond(text, place, self._sizes[place])
        if not text.endswith(b"\n") and self._last in {*_KINDS, FACE}:
            source.note("the last line has no end: the file may be cut short")
        if self._crowded:
            source.note(f"vertices with 5, 8 or more numbers: {self._crowded}; of 5 the first 3 are read, of others 7")
        self.statements.report(source)


def _positions_and_colors(
    values: NDArray[np.float64], counts: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Positions (k, 3), and colours (k, 4) if any: NaN where there is none, or no alpha."""
    most = int(counts.max())
    if most == 3:
        return values.reshape(-1, 3), None
    rows = _rows(values, counts, min(most, _TRANSPARENT))
    positions = np.ascontiguousarray(rows[:, :3])
    homogeneous = np.flatnonzero(counts == _HOMOGENEOUS)
    if len(homogeneous):
        with np.errstate(all="ignore"):  # a point at infinity is refused where a face uses it
            positions[homogeneous] /= rows[homogeneous, 3:4]
    if most < _COLORED:
        return positions, None
    colors = np.full((len(counts), 4), np.nan)
    colors[:, : rows.shape[1] - 3] = rows[:, 3:]
    colors[counts < _COLORED] = np.nan
    colors[counts == _COLORED, 3] = np.nan
    return positions, colors


def _rows(values: NDArray[np.float64], counts: NDArray[np.int64], width: int) -> NDArray[np.float64]:
    """Lines of numbers, one after the other, as rows (k, width): longer ones are cut, shorter ones end in zeros."""
    if (counts == width).all():
        return values.reshape(-1, width)
    starts = np.cumsum(counts) - counts
    rows = np.zeros((len(counts), width))
    for place in range(width):
        long = np.flatnonzero(counts > place)
        rows[long, place] = values[starts[long] + place]
    return rows


def _beyond(text: bytes, place: int, size: int) -> MeshFileError:
    """The error for the first face that names a row past the last; such a face has been seen."""
    for block in blocks(text):
        lines = block.gathered(FACE)
        if lines is None:
            continue
        corners = read_corners(lines.text)
        indices = corners.indices[place]
        high = np.flatnonzero(indices > size) if indices is not None else np.zeros(0, np.int64)
        if len(high) and indices is not None:
            line = lines.line_at(int(corners.places[high[0]]))
            return _error(block, line, _out_of_range(place, int(indices[high[0]]), size, " in the file"))
    return MeshFileError(f"a face names a {_NAMES[place]} that is not there")


def _out_of_range(place: int, index: int, size: int, where: str) -> str:
    return f"index {index} is out of range; {_PLURALS[place]}{where}: {size}"


def _error(block: Block, line: int, message: str) -> MeshFileError:
    shown = block.line(line, _SHOWN).decode("utf-8", "replace").strip()
    return MeshFileError(f"line {block.line_number(line)}, {shown!r}: {message}")
