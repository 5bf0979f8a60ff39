"""Payloads of the classic profile's packets: Base, Map&Conn, Param and Diff.

============  ==================================================================================================
packet        payload
============  ==================================================================================================
Base          range-coded: Morton codes of the coarsest cells by their gaps, then its faces
Map&Conn      range-coded: children of each vertex of the coarser level, then the faces given the coarser ones
Param         float32, little-endian: the coefficients of x, then y, then z
Diff          range-coded integers in steps of the level's own grid: true cell minus the cell of the prediction
============  ==================================================================================================
"""

from __future__ import annotations

from ctypes import byref
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec import core

if TYPE_CHECKING:
    from numpy.typing import NDArray


class LevelEncoder:
    """Writes the payloads of one stream: the Base first, then a Map&Conn for each finer level; Diffs at any time."""

    def __init__(self) -> None:
        self._encoder = core.Handle("mt_classic_encoder_free")
        core.call("mt_classic_encoder_new", core.states(2), byref(self._encoder.pointer))

    def base(self, cells: NDArray[np.int32], faces: NDArray[np.int32], bits: int) -> bytes:
        """The coarsest level: cells (n, 3) below 2^bits in Morton order, canonical faces (m, 3)."""
        return self._payload("base", _flat(cells), len(cells), bits, _flat(faces), len(faces))

    def map_conn(self, parents: NDArray[np.int32], faces: NDArray[np.int32]) -> bytes:
        """How the vertices of the level before split, by the parents (n,), and the canonical faces (m, 3)."""
        return self._payload("map_conn", _flat(parents), len(parents), _flat(faces), len(faces))

    def diff(self, differences: NDArray[np.int64]) -> bytes:
        """Diffs (n, 3) in steps of their level, of magnitude below 2^31."""
        return self._payload("diff", _flat(differences.astype(np.int32)), len(differences))

    def _payload(self, kind: str, *arguments: object) -> bytes:
        payload = core.Bytes()
        core.call(f"mt_classic_encoder_{kind}", self._encoder, *arguments, byref(payload))
        return payload.copied()


def decode_diff(payload: bytes, vertex_count: int, level: int = 0) -> NDArray[np.int32]:
    """The Diffs (n, 3) of a payload that `LevelEncoder.diff` wrote, for the level that errors name.

    Raises:
        DiffError: anything else.

    >>> payload = LevelEncoder().diff(np.array([[0, -1, 2]]))
    >>> decode_diff(payload, 1).tolist()
    [[0, -1, 2]]
    """
    differences = np.empty((vertex_count, 3), np.int32)
    core.call("mt_classic_decode_diff", level, payload, len(payload), vertex_count, differences)
    return differences


def encode_param(coefficients: NDArray[np.float32]) -> bytes:
    """Filter coefficients (3, count)."""
    return coefficients.astype("<f4").tobytes()


def _flat(values: NDArray[np.int32]) -> NDArray[np.int32]:
    return np.ascontiguousarray(values, np.int32)
