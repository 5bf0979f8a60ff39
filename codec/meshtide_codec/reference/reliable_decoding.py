"""Base and Map&Conn of profile compact: Maps and faces, coarse to fine (docs/format.md, section 8.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_codec.reference.connectivity import decode_faces
from meshtide_codec.reference.faces_states import DeepFaceStates
from meshtide_codec.reference.map_decoding import RATE, decode_map
from meshtide_codec.reference.map_deep_decisions import INPUTS
from meshtide_codec.reference.models import SIGNED_CONTEXTS, Contexts
from meshtide_codec.reference.octree import Level, deepened, root
from meshtide_codec.reference.range_decoder import RangeDecoder
from meshtide_codec.reference.trained_states import deep_neurons, geometry_neurons

if TYPE_CHECKING:
    from meshtide_codec.reference.mirror import Mirror


class ReliableDecoder:
    """Base and Map&Conn, coarse to fine; states are carried along: those of the Maps, and of faces coded deeply."""

    def __init__(self, bits: int, mirror: Mirror | None, *, deep_maps: bool = False, deep_faces: bool = False) -> None:
        self._bits = bits
        self._mirror = mirror
        self._neurons = deep_neurons("map", INPUTS, RATE) if deep_maps else geometry_neurons("map")
        self._face_states = DeepFaceStates() if deep_faces else None

    def base(self, payload: bytes, base_depth: int, vertices: int) -> list[Level]:
        """The levels of the depths 0 to `base_depth`."""
        with RangeDecoder(payload) as decoder:
            return self.base_from(decoder, base_depth, vertices)

    def base_from(self, decoder: RangeDecoder, base_depth: int, vertices: int) -> list[Level]:
        """The same where a payload goes on after it."""
        levels = [root(vertices)]
        counts = Contexts.fresh(SIGNED_CONTEXTS)
        while levels[-1].depth < base_depth:
            if vertices == 1:
                levels.append(deepened(levels[-1]))
                continue
            fine = self._map(decoder, levels[-1])
            face_count = 2 * len(fine) + counts.signed(decoder, 0)
            levels.append(self._with_faces(fine, decoder, levels[-1], face_count))
        return levels

    def map_conn(self, payload: bytes, coarse: Level, face_count: int) -> Level:
        """The level of the next depth."""
        with RangeDecoder(payload) as decoder:
            return self._with_faces(self._map(decoder, coarse), decoder, coarse, face_count)

    def _map(self, decoder: RangeDecoder, coarse: Level) -> Level:
        images = self._mirror.images(coarse) if self._mirror else None
        return decode_map(decoder, coarse, self._bits, self._neurons, images)

    def _with_faces(self, fine: Level, decoder: RangeDecoder, coarse: Level, face_count: int) -> Level:
        centres = [fine.centre(vertex) for vertex in range(len(fine))]
        arguments = fine.parents, coarse.faces, len(coarse), face_count, centres
        fine.set_faces(decode_faces(decoder, *arguments, self._face_states))
        return fine
