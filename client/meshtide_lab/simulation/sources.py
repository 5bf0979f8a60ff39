"""Where a sweep's meshes come from: files, the built-in samples, `.tide` streams, and meshes on servers."""

from __future__ import annotations

import hashlib
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from meshtide_client.connection.secrecy import shown_address
from meshtide_client.connection.tide_address import parse_address
from meshtide_client.download.fetch import fetch
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.samples import load_sample, sample_names

if TYPE_CHECKING:
    from meshtide_codec.mesh import Mesh

STREAM_SUFFIX = ".tide"


@dataclass(frozen=True, slots=True)
class SweptMesh:
    """One mesh of a sweep.

    Args:
        name: as the tables call it.
        place: path, sample name, or URL without what may be secret in it.
        digest: SHA-256 of its contents, so that a sweep does not go on with another mesh.
        stream: the stream's bytes, if it is one already.
    """

    name: str
    place: str
    digest: str
    stream: bytes | None = None

    def mesh(self) -> Mesh:
        """The mesh itself.

        Raises:
            MeshError, OSError: it cannot be read.
        """
        if self.place in sample_names():
            return load_sample(self.place)
        return load_mesh(Path(self.place))


def open_mesh(place: str) -> SweptMesh:
    """Look at a mesh without decoding it; a stream on a server is fetched.

    Raises:
        OSError: the file cannot be read.
        MeshtideError: the server did not give the stream.
    """
    if place in sample_names():
        return SweptMesh(place, place, hashlib.sha256(load_sample(place).vertices.tobytes()).hexdigest())
    if "://" in place:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"stream{STREAM_SUFFIX}"
            fetch(place, stream_file=path)
            data = path.read_bytes()
        return SweptMesh(parse_address(place).file_stem, shown_address(place), hashlib.sha256(data).hexdigest(), data)
    data = Path(place).read_bytes()
    stream = data if place.endswith(STREAM_SUFFIX) else None
    return SweptMesh(Path(place).stem, place, hashlib.sha256(data).hexdigest(), stream)
