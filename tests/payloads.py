"""Single Maps, Diffs and faces as payloads of their own: in a stream they share payloads with each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.compact.diff_coder import read_diff, write_diff
from meshtide_codec.compact.map_coder import read_map, write_map
from meshtide_codec.connectivity import read_faces, write_faces
from meshtide_codec.entropy.codec import PayloadReader, PayloadWriter

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshtide_codec.compact.diff_coder import SliceState
    from meshtide_codec.compact.level import Level
    from meshtide_codec.compact.mirror import Mirror
    from meshtide_codec.compact.models import Models
    from meshtide_codec.compact.octree import Octree
    from meshtide_codec.compact.slices import Slices
    from meshtide_codec.connectivity.choice_kernels import Models as FaceModels


def encode_map(coarse: Level, fine: Level, bits: int, models: Models, mirror: Mirror | None = None) -> bytes:
    writer = PayloadWriter()
    write_map(writer, coarse, fine, bits, models, mirror)
    return writer.payload()


def decode_map(
    payload: bytes, coarse: Level, bits: int, models: Models, vertex_count: int, mirror: Mirror | None = None
) -> Level:
    return read_map(PayloadReader(payload), coarse, bits, models, vertex_count, mirror)


def encode_diff(
    octree: Octree, depth: int, state: SliceState, slices: Slices, slice_index: int, mirror: Mirror | None = None
) -> bytes:
    writer = PayloadWriter()
    write_diff(writer, octree, depth, state, slices, slice_index, mirror)
    return writer.payload()


def decode_diff(
    payload: bytes, level: Level, state: SliceState, slices: Slices, slice_index: int, mirror: Mirror | None = None
) -> None:
    read_diff(PayloadReader(payload), level, state, slices, slice_index, mirror)


def encode_faces(
    fine_faces: NDArray[np.int32],
    parents: NDArray[np.int32],
    coarse_faces: NDArray[np.int32],
    coarse_count: int,
    positions: NDArray[np.int32] | None = None,
    models: FaceModels | None = None,
) -> bytes:
    writer = PayloadWriter()
    write_faces(writer, fine_faces, parents, coarse_faces, coarse_count, positions, models)
    return writer.payload()


def decode_faces(
    payload: bytes,
    parents: NDArray[np.int32],
    coarse_faces: NDArray[np.int32],
    coarse_count: int,
    face_count: int,
    positions: NDArray[np.int32] | None = None,
    models: FaceModels | None = None,
) -> NDArray[np.int32]:
    return read_faces(PayloadReader(payload), parents, coarse_faces, coarse_count, face_count, positions, models)
