"""A buffer view that EXT_meshopt_compression or KHR_meshopt_compression holds: checked, decoded, filtered.

Format: Khronos, "EXT_meshopt_compression" and "KHR_meshopt_compression".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf import meshopt_filters as filters
from meshtide_codec.mesh_files.gltf.document import extension, integer, shown
from meshtide_codec.mesh_files.gltf.extensions import MESHOPT
from meshtide_codec.mesh_files.gltf.meshopt_attributes import decode_attributes
from meshtide_codec.mesh_files.gltf.meshopt_indices import decode_indices, decode_triangles

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]

_FILTERS: Mapping[str, tuple[Callable[[Bytes], Bytes] | None, frozenset[int]]] = {
    "NONE": (None, frozenset(range(257))),
    "OCTAHEDRAL": (filters.octahedral, frozenset({4, 8})),
    "QUATERNION": (filters.quaternion, frozenset({8})),
    "EXPONENTIAL": (filters.exponential, frozenset(range(4, 257, 4))),
    "COLOR": (filters.color, frozenset({4, 8})),
}
"""Each filter, and the lengths of rows that it takes."""


@dataclass(frozen=True, slots=True)
class PackedView:
    """How a buffer view is compressed.

    Args:
        name: of the extension.
        buffer: which holds the stream.
        offset: of the stream in it.
        length: of the stream, bytes.
        stride: bytes of an element.
        count: of elements.
        mode: ATTRIBUTES, TRIANGLES or INDICES.
        filter: NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL or COLOR.
    """

    name: str
    buffer: int
    offset: int
    length: int
    stride: int
    count: int
    mode: str
    filter: str

    def decoded(self, data: Bytes) -> Bytes:
        """The bytes (count * stride,) of the view.

        Raises:
            MeshFileError: the stream is damaged; the message names the extension.
        """
        try:
            if self.mode == "ATTRIBUTES":
                rows = decode_attributes(data, self.count, self.stride)
                filtered = _FILTERS[self.filter][0]
                return (rows if filtered is None else filtered(rows)).reshape(-1)
            decode = decode_triangles if self.mode == "TRIANGLES" else decode_indices
            return decode(data, self.count).astype(f"<u{self.stride}").view(np.uint8)
        except MeshFileError as error:
            raise MeshFileError(f"a stream of {self.name} is damaged: {error}") from error


def packed(view: Mapping[str, Any], where: str) -> PackedView | None:
    """How a buffer view is compressed, or None if it is not.

    Raises:
        MeshFileError: what it says of the compression contradicts itself.
    """
    for name in MESHOPT:
        row = extension(view, name, where)
        if row is None:
            continue
        place = f"{name} of {where}"
        mode, filtered = row.get("mode"), row.get("filter", "NONE")
        if not isinstance(mode, str) or mode not in {"ATTRIBUTES", "TRIANGLES", "INDICES"}:
            raise MeshFileError(f"{place} is of an unknown mode: {shown(mode)}")
        if not isinstance(filtered, str) or filtered not in _FILTERS:
            raise MeshFileError(f"{place} has an unknown filter: {shown(filtered)}")
        keys = ("buffer", "byteOffset", "byteLength", "byteStride", "count")
        buffer, offset, length, stride, count = (
            integer(row, key, place, 0 if key == "byteOffset" else None) for key in keys
        )
        found = PackedView(name, buffer, offset, length, stride, count, mode, filtered)
        _check(found, place)
        return found
    return None


def _check(found: PackedView, place: str) -> None:
    if found.mode == "ATTRIBUTES":
        fits = found.stride % 4 == 0 and 4 <= found.stride <= 256 and found.stride in _FILTERS[found.filter][1]
    else:
        fits = found.stride in {2, 4} and found.filter == "NONE"
    if not fits:
        raise MeshFileError(f"{place}: {found.mode} with filter {found.filter} have no stride of {found.stride} bytes")
    if found.mode == "TRIANGLES" and found.count % 3:
        raise MeshFileError(f"{place}: {found.count} indices are not whole triangles")


def is_fallback(buffer: Mapping[str, Any], where: str) -> bool:
    """Whether a buffer stands only for readers that cannot decode."""
    return any((extension(buffer, name, where) or {}).get("fallback") is True for name in MESHOPT)
