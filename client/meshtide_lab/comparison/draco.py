"""Draco, the codec that most meshes on the web are compressed with: one mesh, one file, whole or nothing.

Always at its highest compression level, with as many bits per coordinate as meshtide is given: its quantization step
is the largest side of the bounding box divided by 2^bits - 1, as meshtide's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshError
from meshtide_codec.extras import extra

if TYPE_CHECKING:
    from numpy.typing import NDArray

LIBRARY = "DracoPy"
COMPRESSION_LEVEL = 10


def draco_encoded(vertices: NDArray[np.float64], faces: NDArray[np.integer], bits: int) -> bytes:
    """The Draco file of a mesh (n, 3), (m, 3), or of a point cloud if there are no faces.

    Raises:
        MeshError: Draco cannot take the mesh.
        MissingLibraryError: DracoPy is not installed.
    """
    library = extra(LIBRARY)
    indices = np.asarray(faces, np.uint32) if len(faces) else None
    try:
        data = library.encode(vertices, indices, quantization_bits=bits, compression_level=COMPRESSION_LEVEL)
    except Exception as error:  # the library has errors of its own beside Python's
        raise MeshError(f"Draco cannot encode the mesh: {_words(error)}") from error
    return bytes(data)


def draco_decoded(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (n, 3) and faces (m, 3) of a Draco file.

    Raises:
        MeshError: Draco cannot read it.
        MissingLibraryError: DracoPy is not installed.
    """
    library = extra(LIBRARY)
    try:
        decoded = library.decode(data)
    except Exception as error:  # see above
        raise MeshError(f"Draco cannot decode the mesh: {_words(error)}") from error
    faces = np.asarray(getattr(decoded, "faces", []), np.int64).reshape(-1, 3)
    return np.asarray(decoded.points, np.float64).reshape(-1, 3), faces


def _words(error: Exception) -> str:
    return str(error) or type(error).__name__
