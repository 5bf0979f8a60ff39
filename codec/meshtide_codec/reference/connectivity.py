"""The faces of a level, given the coarser level that it collapses to (docs/format.md, section 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.errors import MapConnError
from meshtide_codec.reference.faces_coarse import CoarseMesh
from meshtide_codec.reference.faces_extra import ExtraFaces
from meshtide_codec.reference.faces_gates import Gates
from meshtide_codec.reference.faces_growth import Growth
from meshtide_codec.reference.faces_spelt import SpeltFaces
from meshtide_codec.reference.faces_states import FaceStates

if TYPE_CHECKING:
    from meshtide_codec.reference.octree import Cell, Face
    from meshtide_codec.reference.range_decoder import RangeDecoder


def decode_faces(
    decoder: RangeDecoder,
    parents: list[int],
    coarse_faces: list[Face],
    coarse_count: int,
    face_count: int,
    positions: list[Cell] | None,
    states: FaceStates | None = None,
) -> list[Face]:
    """The faces, each with its smallest corner first, in lexicographic order.

    Args:
        decoder: where the faces begin.
        parents: coarse vertex of each fine vertex, never falling.
        coarse_faces: faces of the coarse level.
        coarse_count: its number of vertices.
        face_count: number of fine faces, announced.
        positions: centres of the fine vertices' cells in half cells; None in profile classic.
        states: what earlier levels have left, where faces are coded deeply.

    Raises:
        MapConnError, PacketError: the faces are damaged.
    """
    if face_count == 0:
        return []
    coarse = CoarseMesh(parents, coarse_faces, coarse_count)
    growth = Growth(coarse, face_count, positions, states or FaceStates(geometric=positions is not None), decoder)
    _traverse(growth)
    faces = sorted(_rotated(face) for face in growth.fine.faces)
    if len(faces) != face_count or len(set(faces)) != face_count:
        raise MapConnError("faces repeat, or are not as many as announced; the stream is damaged")
    return faces


def _traverse(growth: Growth) -> None:
    """Gates first; when none is left an extra face, a seed or a leftover, which may make gates again."""
    gates, extra, spelt = Gates(growth), ExtraFaces(growth), SpeltFaces(growth)
    gates.decode()
    while not growth.complete:
        added = (
            (not growth.clean and extra.decode_one())
            or spelt.decode_seed()
            or (not growth.clean and spelt.decode_leftover())
        )
        if not added:
            raise MapConnError("faces are missing at the end of the traversal; the stream is damaged")
        gates.decode()


def _rotated(face: Face) -> Face:
    a, b, c = face
    return min((a, b, c), (b, c, a), (c, a, b))
