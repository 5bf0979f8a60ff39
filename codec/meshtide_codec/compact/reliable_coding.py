"""Payloads of the reliable packets of a compact stream: Base and Map&Conn, to bytes and back.

========  ======================================================================================================
packet    payload, all of it range-coded in one go
========  ======================================================================================================
Base      for each depth from 1 to the base depth the Map, how many faces there are, and the faces
Map&Conn  Map and faces
========  ======================================================================================================

Once all cells are leaves there are no Maps any more and the faces stay the same. The faces of a depth are coded given
those of the depth before, the Map, and the centres of the cells. Nothing here depends on a Diff.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.compact.effort import DeepLayers
from meshtide_codec.compact.level import root_level
from meshtide_codec.compact.map_coder import read_map, write_map
from meshtide_codec.compact.models import new_deep_map_models, new_map_models
from meshtide_codec.connectivity import new_models, read_faces, write_faces
from meshtide_codec.connectivity.models import copied
from meshtide_codec.entropy.codec import PayloadReader, PayloadWriter
from meshtide_codec.entropy.model_kernels import SIGNED_CONTEXTS, code_signed, new_contexts
from meshtide_codec.errors import BaseError, MapConnError, StreamError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from meshtide_codec.compact.level import Level
    from meshtide_codec.compact.mirror import Mirror
    from meshtide_codec.compact.octree import Octree
    from meshtide_codec.entropy.model_kernels import Contexts
    from meshtide_codec.entropy.range_coder_kernels import Buffer, Coder
    from meshtide_codec.limits import Limits

NO_FACES = np.zeros((0, 3), np.int32)


class ReliableCoder:
    """Writes or reads the reliable packets of one stream, coarse to fine; its models learn from each of them.

    Other coders may go on with the payload of a Base: `write_base` and `read_base` neither begin nor end one.

    Args:
        bits: depth of the finest level.
        vertices: vertices of the finest level.
        mirror: the plane of symmetry, if one is used.
        deep: the layers that are coded deeply; what is learnt from such faces is kept from level to level.

    Attributes:
        map_bytes: how much of the payloads that were read so far was Maps.
    """

    def __init__(
        self,
        bits: int,
        vertices: int,
        mirror: Mirror | None,
        *,
        deep: DeepLayers = DeepLayers.NONE,
    ) -> None:
        self._bits = bits
        self._vertices = vertices
        self._mirror = mirror
        self.map_bytes = 0
        self._models = new_deep_map_models() if DeepLayers.MAPS in deep else new_map_models()
        self._face_models = new_models(geometric=True, deep=True) if DeepLayers.FACES in deep else None

    def encode_base(self, octree: Octree, base_depth: int) -> bytes:
        """The payload that holds all levels down to `base_depth`."""
        writer = PayloadWriter()
        self.write_base(writer, octree, base_depth)
        return writer.payload()

    def write_base(self, writer: PayloadWriter, octree: Octree, base_depth: int) -> None:
        """Like `encode_base`, into a payload that holds more."""
        counts = new_contexts(SIGNED_CONTEXTS)
        for depth in range(1, base_depth + 1):
            coarse, fine = octree.levels[depth - 1], octree.levels[depth]
            if not coarse.all_leaves:
                write_map(writer, coarse, fine, self._bits, self._models, self._mirror)
                _write_face_count(writer, counts, fine)
                self._write_faces(writer, coarse, fine)

    def decode_base(self, payload: bytes, base_depth: int, limits: Limits) -> list[Level]:
        """The levels of depths 0 to `base_depth`.

        Raises:
            BaseError, MapConnError: the payload is damaged.
            LimitError: a level over the limits.
        """
        with self._forgetting_damage():
            reader = PayloadReader(payload)
            levels = self.read_base(reader, base_depth, limits)
            if not reader.finished:
                raise BaseError("bytes follow the last face; the stream is damaged", offset=reader.offset)
            return levels

    def read_base(self, reader: PayloadReader, base_depth: int, limits: Limits) -> list[Level]:
        """Like `decode_base`, from a payload that may hold more.

        Raises:
            BaseError, MapConnError: the payload is damaged.
            LimitError: a level over the limits.
        """
        levels = [root_level(self._vertices)]
        counts = new_contexts(SIGNED_CONTEXTS)
        for depth in range(1, base_depth + 1):
            coarse = levels[-1]
            if coarse.all_leaves and depth > 1:
                raise BaseError("the coarsest level lies deeper than the last Map; the stream is damaged")
            if coarse.all_leaves:
                return [*levels, *_deepened(coarse, base_depth)]
            fine = self._read_map(reader, coarse)
            face_count = 2 * fine.vertex_count + int(code_signed(reader.coder, reader.buffer, counts, 0, 0))
            if face_count < 0:
                raise BaseError(f"{face_count} faces at depth {depth}; the stream is damaged", offset=reader.offset)
            limits.check_mesh(0, face_count)
            levels.append(self._read_faces(reader, coarse, fine, face_count))
        return levels

    def encode_map_conn(self, coarse: Level, fine: Level) -> bytes:
        """The payload that leads from one level to the next."""
        writer = PayloadWriter()
        write_map(writer, coarse, fine, self._bits, self._models, self._mirror)
        self._write_faces(writer, coarse, fine)
        return writer.payload()

    def decode_map_conn(self, payload: bytes, coarse: Level, face_count: int) -> Level:
        """The level at the next depth.

        Raises:
            MapConnError: the payload is damaged.
        """
        with self._forgetting_damage():
            reader = PayloadReader(payload)
            fine = self._read_map(reader, coarse)
            fine = self._read_faces(reader, coarse, fine, face_count)
            if not reader.finished:
                raise MapConnError("bytes follow the last face; the stream is damaged", offset=reader.offset)
            return fine

    @contextmanager
    def _forgetting_damage(self) -> Iterator[None]:
        """What the models learn from a payload that turns out to be damaged is forgotten: it may come again, whole."""
        models, face_models = self._models.copy(), None if self._face_models is None else copied(self._face_models)
        map_bytes = self.map_bytes
        try:
            yield
        except StreamError:
            self._models, self._face_models, self.map_bytes = models, face_models, map_bytes
            raise

    def _read_map(self, reader: PayloadReader, coarse: Level) -> Level:
        before = reader.offset
        fine = read_map(reader, coarse, self._bits, self._models, self._vertices, self._mirror)
        self.map_bytes += reader.offset - before
        return fine

    def _write_faces(self, writer: PayloadWriter, coarse: Level, fine: Level) -> None:
        count = coarse.vertex_count
        write_faces(writer, _faces(fine), fine.parents, _faces(coarse), count, fine.centres, self._face_models)

    def _read_faces(self, reader: PayloadReader, coarse: Level, fine: Level, face_count: int) -> Level:
        arguments = fine.parents, _faces(coarse), coarse.vertex_count, face_count, fine.centres
        return fine.with_faces(read_faces(reader, *arguments, self._face_models))


def _write_face_count(writer: PayloadWriter, counts: Contexts, level: Level) -> None:
    """How many faces more than two a vertex there are: most surfaces have nearly none."""
    surplus = len(_faces(level)) - 2 * level.vertex_count
    before = counts.copy()

    def write(coder: Coder, buffer: Buffer) -> None:
        counts[:] = before
        code_signed(coder, buffer, counts, 0, surplus)

    writer.write(write)


def _deepened(leaves: Level, depth: int) -> list[Level]:
    """The levels down to `depth` of a mesh of a single vertex."""
    levels = []
    for _ in range(depth):
        leaves = leaves.deepened()
        levels.append(leaves)
    return levels


def _faces(level: Level) -> np.ndarray:
    return NO_FACES if level.faces is None else level.faces
