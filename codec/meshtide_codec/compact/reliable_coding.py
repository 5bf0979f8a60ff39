"""Payloads of the reliable packets of a compact stream: Base and Map&Conn, to bytes and back.

========  ======================================================================================================
packet    payload
========  ======================================================================================================
Base      for each depth from 1 to the base depth two parts, Map and faces, the face counts in front of them
Map&Conn  two parts, Map and faces
========  ======================================================================================================

Once all cells are leaves there are no Maps any more and the faces stay the same. The faces of a depth are coded
given those of the depth before, the Map, and the centres of the cells. Nothing here depends on a Diff.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.level import root_level
from meshtide_codec.compact.map_coder import decode_map, encode_map
from meshtide_codec.compact.models import new_map_models
from meshtide_codec.connectivity import decode_faces, encode_faces
from meshtide_codec.errors import BaseError, MapConnError
from meshtide_codec.stream.parts import join_parts, read_number, split_parts, write_number
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from meshtide_codec.compact.level import Level
    from meshtide_codec.compact.mirror import Mirror
    from meshtide_codec.compact.models import Models
    from meshtide_codec.compact.octree import Octree
    from meshtide_codec.limits import Limits

NO_FACES = np.zeros((0, 3), np.int32)


class ReliableCoder:
    """Writes or reads the reliable packets of one stream, coarse to fine; its models learn from each of them.

    Args:
        bits: depth of the finest level.
        vertices: vertices of the finest level.
        mirror: the plane of symmetry, if one is used.
    """

    def __init__(self, bits: int, vertices: int, mirror: Mirror | None) -> None:
        self._bits = bits
        self._vertices = vertices
        self._mirror = mirror
        self._models: Models = new_map_models()

    def encode_base(self, octree: Octree, base_depth: int) -> bytes:
        """The payload that holds all levels down to `base_depth`."""
        numbers, parts = b"", []
        for depth in range(1, base_depth + 1):
            coarse, fine = octree.levels[depth - 1], octree.levels[depth]
            if not coarse.all_leaves:
                numbers += write_number(len(_faces(fine)))
                parts += [encode_map(coarse, fine, self._bits, self._models, self._mirror), _encode_faces(coarse, fine)]
        return numbers + join_parts(parts) if parts else b""

    def decode_base(self, payload: bytes, base_depth: int, limits: Limits) -> list[Level]:
        """The levels of depths 0 to `base_depth`.

        Raises:
            BaseError, MapConnError: the payload is damaged.
            LimitError: a level over the limits.
        """
        levels = [root_level(self._vertices)]
        try:
            face_counts = []
            position = 0
            for _ in range(0 if levels[0].all_leaves else base_depth):
                count, position = read_number(payload, position)
                limits.check_mesh(0, count)
                face_counts.append(count)
            parts = split_parts(payload[position:], 2 * len(face_counts)) if face_counts else [payload]
        except BadValueError as error:
            raise BaseError(f"{error}; the stream is damaged", offset=0) from error
        if not face_counts and payload:
            raise BaseError("a mesh of one vertex has an empty Base packet; the stream is damaged", offset=0)
        for depth in range(1, base_depth + 1):
            if levels[-1].all_leaves and depth <= len(face_counts):
                raise BaseError("the coarsest level lies deeper than the last Map; the stream is damaged")
            if levels[-1].all_leaves:
                levels.append(levels[-1].deepened())
            else:
                map_payload, face_payload = parts[2 * depth - 2 : 2 * depth]
                levels.append(self._decode(map_payload, face_payload, levels[-1], face_counts[depth - 1]))
        return levels

    def encode_map_conn(self, coarse: Level, fine: Level) -> bytes:
        """The payload that leads from one level to the next."""
        return join_parts(
            [encode_map(coarse, fine, self._bits, self._models, self._mirror), _encode_faces(coarse, fine)]
        )

    def decode_map_conn(self, payload: bytes, coarse: Level, face_count: int) -> Level:
        """The level at the next depth.

        Raises:
            MapConnError: the payload is damaged.
        """
        try:
            map_payload, face_payload = split_parts(payload, 2)
        except BadValueError as error:
            raise MapConnError(f"{error}; the stream is damaged", offset=0) from error
        return self._decode(map_payload, face_payload, coarse, face_count)

    def _decode(self, map_payload: bytes, face_payload: bytes, coarse: Level, face_count: int) -> Level:
        fine = decode_map(map_payload, coarse, self._bits, self._models, self._vertices, self._mirror)
        return fine.with_faces(
            decode_faces(face_payload, fine.parents, _faces(coarse), coarse.vertex_count, face_count, fine.centres)
        )


def _encode_faces(coarse: Level, fine: Level) -> bytes:
    return encode_faces(_faces(fine), fine.parents, _faces(coarse), coarse.vertex_count, fine.centres)


def _faces(level: Level) -> np.ndarray:
    return NO_FACES if level.faces is None else level.faces
