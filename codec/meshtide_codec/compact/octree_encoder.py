"""The core's encoder of profile compact: payloads of an octree's layers, and what a decoder draws of its levels."""

from __future__ import annotations

from ctypes import byref, c_uint64
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec import core
from meshtide_codec.effort import Effort
from meshtide_codec.errors import MeshError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.compact.mirror import Mirror


class OctreeEncoder:
    """Codes the layers of one mesh, level by level.

    Args:
        positions: (n, 3) int32 in [0, 2^bits), pairwise different, in Morton order.
        faces: (m, 3) int32, three different corners each, none twice.
        bits: B, 4 to 20.
        effort: of the coders.
        mirror: the plane of symmetry, if one is used.
        slices: the first Morton code of each slice of the Diffs, ascending from 0.

    Attributes:
        cells: how many cells each depth from 0 to B has.
        faces: the same of faces.

    Raises:
        MeshError: positions or faces are not of that form.
    """

    def __init__(
        self,
        positions: NDArray[np.int32],
        faces: NDArray[np.int32],
        bits: int,
        *,
        effort: Effort = Effort.DEFAULT,
        mirror: Mirror | None = None,
        slices: tuple[int, ...] = (0,),
    ) -> None:
        self._bits = bits
        starts = np.array(slices, np.uint64)
        high = effort is Effort.HIGH
        options = core.EncoderOptions(
            bits=self._bits,
            effort=int(high),
            mirror_axis=-1 if mirror is None else mirror.axis,
            mirror_sum=0 if mirror is None else mirror.coordinate_sum,
            slices=starts.ctypes.data,
            slice_count=len(starts),
        )
        self._states = core.states(0, 1) if high else core.states(0)
        self._handle = core.Handle("mt_encoder_free")
        positions, faces = np.ascontiguousarray(positions, np.int32), np.ascontiguousarray(faces, np.int32)
        mesh = positions, len(positions), faces, len(faces)
        arguments = *mesh, byref(options), self._states, byref(self._handle.pointer)
        core.call("mt_encoder_new", *arguments, argument_error=MeshError)
        cells, face_counts = np.zeros(self._bits + 1, np.uint64), np.zeros(self._bits + 1, np.uint64)
        core.library().mt_encoder_sizes(self._handle, cells, face_counts)
        self.cells: list[int] = cells.tolist()
        self.faces: list[int] = face_counts.tolist()

    def base(self, depth: int) -> bytes:
        """The payload of the levels down to a depth."""
        return self._payload("mt_encoder_base", depth)

    def next_level(self) -> bytes:
        """The payload of the next level's Map and faces."""
        return self._payload("mt_encoder_next_level")

    def add_planes(self, part: int, depth: int) -> int:
        """Adds a slice's bit planes down to a depth to its next Diff; bytes of that by now."""
        size = c_uint64()
        core.call("mt_encoder_add_planes", self._handle, part, depth, byref(size))
        return size.value

    def take_planes(self, part: int) -> bytes:
        """The payload of that Diff."""
        return self._payload("mt_encoder_take_planes", part)

    def finish(self) -> None:
        """Nothing will be coded any more: what only coding needs is given back."""
        core.library().mt_encoder_finish(self._handle)

    def strengths(self, base_depth: int) -> tuple[int, ...]:
        """The best strength of the display filter for each depth from the base depth on."""
        chosen = np.zeros(self._bits + 1 - base_depth, np.uint8)
        core.call("mt_encoder_strengths", self._handle, base_depth, chosen)
        return tuple(chosen.tolist())

    def drawn(self, depth: int, known_depth: int, strength: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Positions (n, 3) in finest steps and faces (m, 3) of a depth, with the Diffs down to another one."""
        positions, faces = np.empty((self.cells[depth], 3)), np.empty((self.faces[depth], 3), np.int32)
        core.call("mt_encoder_show", self._handle, depth, known_depth, strength, positions, faces)
        return positions, faces

    def _payload(self, function: str, *arguments: int) -> bytes:
        lent = core.Bytes()
        core.call(function, self._handle, *arguments, byref(lent))
        return lent.copied()
