"""Made-up uploads: valid meshes of every format, the same with damage, and bytes that are not a mesh at all."""

from __future__ import annotations

import random
import sys
import tempfile
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parents[1]))

from damage import damaged, other_bytes

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.errors import MeshtideError, StreamError
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.stream.container import read_container, write_container
from meshtide_codec.testing import grid, shapes, soup

IDS = tuple(f"upload-{number}" for number in range(12))
"""Ids under which meshes are put, replaced, read and deleted."""
_FORMATS = (".ply", ".obj", ".off", ".stl", ".glb")
_SUFFIXES = (*_FORMATS, ".tide", ".gltf", ".3mf", ".txt", "", ".PLY", ".tar.gz")
_QUERIES: dict[str, tuple[Any, ...]] = {
    "bits": (1, 4, 8, 12, 16, 24, 30, 31, -1, "x"),
    "profile": ("compact", "classic", "other"),
    "effort": ("default", "high", "other"),
    "tag": ("scan", ["a", "b", "a"], ["x"] * 60, "\x00", "x" * 200, ""),
    "licence": ("CC0", "\x00", "ü" * 300, "<script>"),
    "other": ("ignored",),
}
_NAMES = ("scan", "a b", "../../etc/passwd", "ü", "x" * 190, "x" * 300, ".", "..", "\x00", "a\nb", "%2e%2e", "con")


@dataclass(frozen=True)
class Upload:
    """One request that uploads something.

    Args:
        method: POST or PUT.
        path: of the request.
        query: its parameters.
        body: what is sent.
        intact: whether it is a mesh as it should be, under a name and with parameters as they should be.
    """

    method: str
    path: str
    query: dict[str, Any]
    body: bytes
    intact: bool


class Uploads:
    """Makes uploads.

    Args:
        pick: where all chance comes from.
    """

    def __init__(self, pick: random.Random) -> None:
        self._pick = pick
        streams = _streams()
        self._files = [*_mesh_files(), *((".tide", stream) for stream in streams)]
        self._options = [read_container(stream)[0].options for stream in streams]

    def next(self) -> Upload:
        """One more."""
        pick = self._pick
        suffix, body = pick.choice(self._files)
        kind = pick.random()
        intact = kind < 0.25
        if kind > 0.9:
            body = pick.randbytes(pick.choice((0, 1, 84, 3000)))
        elif not intact:
            claims = suffix == ".tide" and pick.random() < 0.7
            body = self._other_claims(body) if claims else damaged(pick, suffix, body)
        name = "scan"
        query: dict[str, Any] = {"bits": pick.choice((6, 8, 10))}
        if pick.random() < 0.15:
            intact = False
            name, suffix = pick.choice(_NAMES), pick.choice(_SUFFIXES)
            query = {key: pick.choice(_QUERIES[key]) for key in pick.sample(sorted(_QUERIES), pick.randrange(4))}
        query["filename"] = name + suffix
        if pick.random() < 0.5:
            return Upload("POST", "/meshes", query, body, intact)
        return Upload("PUT", f"/meshes/{pick.choice(IDS)}", query, body, intact)

    def _other_claims(self, body: bytes) -> bytes:
        """A stream whose checksums are right, and whose header or packets are not."""
        pick = self._pick
        try:
            header, packets = read_container(body)
        except StreamError:
            return other_bytes(pick, body)
        payloads = [bytearray(packet.payload) for packet in packets]
        levels = list(header.levels)
        place = pick.randrange(len(levels))
        number = pick.choice((0, 1, 2, 1000, 1 << 20, 1 << 26))
        match pick.randrange(6):
            case 0:
                levels[place] = replace(levels[place], vertices=number)
            case 1:
                levels[place] = replace(levels[place], faces=number)
            case 2:
                header = replace(header, origin=(1.7e308, -1.7e308, 0.0), extent=pick.choice((0.0, 1e-320, 1.7e308)))
            case 3:
                header = replace(header, options=pick.choice(self._options))
            case 4:
                header = replace(header, bits=pick.randrange(4, 21))
            case _:
                payload = pick.choice(payloads)
                for _ in range(pick.choice((1, 3, 50)) if payload else 0):
                    payload[pick.randrange(len(payload))] = pick.randrange(256)
        table = [
            replace(row, checksum=zlib.crc32(payload)) for row, payload in zip(header.packets, payloads, strict=True)
        ]
        header = replace(header, levels=tuple(levels), packets=tuple(table))
        try:
            return write_container(header, [bytes(payload) for payload in payloads])
        except (MeshtideError, ValueError, OverflowError):
            return other_bytes(pick, body)


def _mesh_files() -> list[tuple[str, bytes]]:
    """Small meshes of all kinds in all formats: suffix and content of each file."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for mesh in (*(make() for make in shapes().values()), grid(5), soup(20, 30, seed=1)):
            if not len(mesh.faces):  # points alone are not a mesh
                continue
            for suffix in _FORMATS:
                path = Path(folder) / f"mesh{suffix}"
                save_mesh(mesh, path)
                found.append((suffix, path.read_bytes()))
            rows = "\n".join(" ".join(map(str, row)) for row in mesh.vertices.tolist())
            faces = "\n".join("3 " + " ".join(map(str, row)) for row in mesh.faces.tolist())
            head = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
            head += "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
            found.append((".ply", f"{head.format(len(mesh.vertices), len(mesh.faces))}{rows}\n{faces}\n".encode()))
    return found


def _streams() -> list[bytes]:
    """Files of both profiles and both efforts."""
    profiles = (CompactOptions(bits=8), CompactOptions(bits=8, effort=Effort.HIGH), ClassicOptions(bits=8))
    return [encode(mesh, profile).to_bytes() for mesh in (grid(6), grid(12)) for profile in profiles]
