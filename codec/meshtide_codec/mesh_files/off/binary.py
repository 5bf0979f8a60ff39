"""OFF in binary form: integers and floats of 32 bits, the most significant byte first.

Format: Geomview manual, "Binary format": the bytes follow the line that ends with BINARY; behind the corners of each
face stands how many values its colour has, then these, as floats. A vertex's colour has four values; three are tried
where the faces make no sense after four. Bytes behind the last face are reported.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.off.rows import OffRows, check_corners, check_triangles, pieces
from meshtide_codec.mesh_files.off.text import check_dimension

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.limits import FileLimits
    from meshtide_codec.mesh_files.off.rows import OffKeyword

_MOST_COLORS = 4


def read_binary_rows(data: memoryview, offset: int, keyword: OffKeyword, limits: FileLimits) -> OffRows:
    """The rows of a binary OFF file.

    Args:
        data: of the file.
        offset: of the first byte behind the keyword's line.
        keyword: of the file.
        limits: what it may claim.

    Raises:
        MeshFileError: it holds less than it declares, or claims too much.
    """
    held = (len(data) - offset) // 4
    numbers = np.frombuffer(data, ">i4", held, offset)
    head = 3 + keyword.dimension
    if held < head:
        raise MeshFileError("the binary OFF file is cut short: it ends within its counts")
    if keyword.dimension:
        check_dimension(int(numbers[0]))
    vertices, faces = (int(count) for count in numbers[head - 3 : head - 1])
    if vertices < 0 or faces < 0:
        raise MeshFileError(f"the binary OFF file declares {vertices} vertices and {faces} faces")
    limits.check_counts(vertices, faces)
    first_error: MeshFileError | None = None
    for colors in (4, 3) if keyword.color else (0,):
        width = keyword.width + colors
        start = head + vertices * width
        try:
            if start + 2 * faces > held:
                message = f"{vertices} vertices and {faces} faces are declared, {4 * (held - head)} bytes follow"
                raise MeshFileError(f"the binary OFF file is cut short: {message}")
            begins, counts = _faces(numbers[start:], faces)
            check_triangles(counts, limits)
            corners = numbers[pieces(start + begins + 1, counts)].astype(np.int64)
            check_corners(counts, corners, vertices, lambda _: "")
        except MeshFileError as error:
            first_error = first_error or error
            continue
        end = offset + 4 * start
        color_counts = numbers[start + begins + 1 + counts].astype(np.int64)
        values = numbers.view(">f4")
        table = values[head:start].reshape(vertices, width).astype(np.float64)
        color_values = values[pieces(start + begins + 2 + counts, color_counts)].astype(np.float64)
        end = offset + 4 * (start + (int(begins[-1] + 2 + counts[-1] + color_counts[-1]) if faces else 0))
        notes = (f"{len(data) - end} bytes follow the last face: left out",) if end < len(data) else ()
        return OffRows(table, colors, counts, corners, color_counts, color_values, notes)
    raise first_error or MeshFileError("the binary OFF file cannot be read")


def _faces(numbers: NDArray[np.int32], faces: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where the row of each face begins, and how many corners it has; those of one size are found at once."""
    if faces == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    count = _row(numbers, 0, 0)
    size = count + 2 + int(numbers[count + 1])
    if size * faces <= len(numbers):
        rows = numbers[: size * faces].reshape(faces, size)
        if (rows[:, [0, count + 1]] == rows[0, [0, count + 1]]).all():
            return np.arange(faces) * size, np.full(faces, count)
    begins, counts = np.zeros(faces, np.int64), np.zeros(faces, np.int64)
    begin = 0
    for face in range(faces):
        count = _row(numbers, begin, face)
        begins[face], counts[face] = begin, count
        begin += count + 2 + int(numbers[begin + count + 1])
    return begins, counts


def _row(numbers: NDArray[np.int32], begin: int, face: int) -> int:
    """How many corners the face has whose row begins there; the row is complete.

    Raises:
        MeshFileError: it is not.
    """
    left = len(numbers) - begin
    count = int(numbers[begin]) if left > 0 else 0
    if left < 2 or not 0 <= count <= left - 2:
        raise MeshFileError(f"the binary OFF file is cut short: face {face} is not complete")
    colors = int(numbers[begin + 1 + count])
    if not 0 <= colors <= _MOST_COLORS:
        raise MeshFileError(f"face {face} of the binary OFF file has a colour of {colors} values; 4 are the most")
    if count + 2 + colors > left:
        raise MeshFileError(f"the binary OFF file is cut short: face {face} is not complete")
    return count
