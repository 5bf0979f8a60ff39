"""What decoders and readers take from a stranger: every count, length and allocation is held against these."""

from __future__ import annotations

from dataclasses import dataclass, fields

from meshtide_codec.errors import LimitError, MeshFileError, OptionError

DECODER_BYTES_PER_VERTEX = 640
DECODER_BYTES_PER_FACE = 256
"""Upper estimates of a decoder's working memory (arrays of the finest level, its coarser levels and the coders'
own tables), used to refuse a header before anything is allocated; measured by tests/bench/memory.py."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Largest claims of a stream that a decoder accepts.

    The claims per byte keep a few bytes from taking gigabytes. Real scans have less than one vertex a byte; the most
    that is known of a mesh of a million vertices is 1200, a flat square of 1024 x 1024 at effort high.

    Args:
        vertices: vertices of one level.
        faces: faces of one level.
        levels: levels of a stream.
        packets: packets of a stream.
        header_bytes: length of a stream header.
        packet_bytes: length of one packet.
        memory: bytes that decoding may take by estimate.
        vertices_per_byte: vertices of a level beyond 65536, for each byte of the header and of the packets
            that say what vertices and faces there are, down to that level.
        faces_per_byte: the same of faces, beyond 131072.

    >>> Limits(vertices=1000).check_mesh(2000, 0)
    Traceback (most recent call last):
    ...
    meshtide_codec.errors.LimitError: the stream claims 2000 vertices; this decoder accepts 1000 (Limits.vertices)
    """

    vertices: int = 1 << 26
    faces: int = 1 << 27
    levels: int = 64
    packets: int = 1 << 16
    header_bytes: int = 1 << 24
    packet_bytes: int = 1 << 30
    memory: int = 1 << 34
    vertices_per_byte: int = 1 << 12
    faces_per_byte: int = 1 << 13

    def __post_init__(self) -> None:
        for field in fields(self):
            if getattr(self, field.name) < 1:
                raise OptionError(f"Limits.{field.name} must be at least 1, not {getattr(self, field.name)}")

    def check_mesh(self, vertices: int, faces: int, *, level: int | None = None) -> None:
        """Raise LimitError when a level of that size, or the memory to decode it, is over the limits."""
        for name, claimed in (("vertices", vertices), ("faces", faces)):
            if claimed > getattr(self, name):
                raise LimitError(
                    f"the stream claims {claimed} {name}; this decoder accepts {getattr(self, name)} (Limits.{name})",
                    level=level,
                )
        memory = vertices * DECODER_BYTES_PER_VERTEX + faces * DECODER_BYTES_PER_FACE
        if memory > self.memory:
            raise LimitError(
                f"decoding would take about {memory} bytes; this decoder accepts {self.memory} (Limits.memory)",
                level=level,
            )


def wanted_limits(max_vertices: int | None, max_faces: int | None) -> Limits:
    """The limits of a person who asks for larger or smaller ones; what is asked for may come in any number of bytes.

    Args:
        max_vertices: of a level.
        max_faces: of a level; four times as many as vertices if only those are given.

    >>> wanted_limits(1 << 23, None).faces
    33554432
    """
    asked: dict[str, int] = {}
    if max_vertices is not None:
        asked |= {"vertices": max_vertices, "vertices_per_byte": max_vertices}
        max_faces = 4 * max_vertices if max_faces is None else max_faces
    if max_faces is not None:
        asked |= {"faces": max_faces, "faces_per_byte": max_faces}
    return Limits(**asked)


@dataclass(frozen=True, slots=True)
class FileLimits:
    """Largest claims of a mesh file that a reader accepts.

    Args:
        vertices: vertices that reading it makes, those of a part that is shown several times counted each time.
        faces: triangles, in the same way.
        file_bytes: length of the file, of each file that it names, and of what an archive holds.
        json_bytes: length of a glTF file's JSON; a megabyte describes thousands of parts.
        remedy: what to change where more is wanted; ``{name}`` and ``{setting}`` stand for the name of the
            limit, in lower and in upper case.

    >>> FileLimits(vertices=100, faces=200).check_counts(50, 300)
    Traceback (most recent call last):
    ...
    meshtide_codec.errors.MeshFileError: the file claims 300 faces; 200 are the most that is read (FileLimits.faces)
    """

    vertices: int = 1 << 26
    faces: int = 1 << 27
    file_bytes: int = 1 << 32
    json_bytes: int = 1 << 26
    remedy: str = "FileLimits.{name}"

    def check_counts(self, vertices: int, faces: int) -> None:
        """Hold what a file claims against the limits, before any of it is made.

        Raises:
            MeshFileError: it is more.
        """
        self.check("vertices", vertices)
        self.check("faces", faces)

    def check(self, name: str, claimed: int) -> None:
        """Hold one number against the limit of that name.

        Raises:
            MeshFileError: it is more.
        """
        most: int = getattr(self, name)
        if claimed > most:
            what = name if name in {"vertices", "faces"} else "bytes"
            setting = {"file_bytes": "upload"}.get(name, name).upper()
            remedy = self.remedy.format(name=name, setting=setting)
            raise MeshFileError(f"the file claims {claimed} {what}; {most} are the most that is read ({remedy})")
