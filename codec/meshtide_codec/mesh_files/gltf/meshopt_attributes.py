"""Attributes as EXT_meshopt_compression and KHR_meshopt_compression store them: bytes of deltas in groups of 16.

Format: Khronos, "KHR_meshopt_compression", appendix A, mode 0 (version 0 is that of EXT_meshopt_compression). The
stream must be walked once, as the length of a group depends on how many of its deltas are escaped; that walk is a table
look-up for each group. All values are then taken out at once. Cost: linear in the elements.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.errors import MeshFileError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]

_GROUP = 16
_HEADERS = (0xA0, 0xA1)
_BLOCK_BYTES = 8192
_BLOCK_ELEMENTS = 256
_TAIL = (32, 24)
_ZERO, _LITERAL = 0, 8
_BITS = ((_ZERO, 2, 4, _LITERAL), (_ZERO, 1, 2, 4), (1, 2, 4, _LITERAL))
"""Bits of each delta by the two header bits of a group: in version 0, in control modes 0 and 1 of version 1."""
_ALL_ZERO, _ALL_LITERAL = 2, 3


def decode_attributes(data: Bytes, count: int, stride: int) -> Bytes:
    """Rows (count, stride) of bytes.

    Args:
        data: the stream.
        count: elements in it.
        stride: bytes of an element, a multiple of 4, at most 256.

    Raises:
        MeshFileError: the stream is of another kind, damaged, or cut short.
    """
    if len(data) == 0 or data[0] not in _HEADERS:
        raise MeshFileError("its first byte does not say attributes")
    version = _HEADERS.index(data[0])
    channels = stride // 4 if version else 0
    tail = max(stride + channels, _TAIL[version])
    block = min(_BLOCK_BYTES // stride // _GROUP * _GROUP, _BLOCK_ELEMENTS)
    blocks = -(-count // block)
    smallest = blocks * (stride // 4 if version else stride)
    if len(data) < 1 + smallest + tail:
        raise MeshFileError(f"{count} elements take at least {1 + smallest + tail} bytes, but there are {len(data)}")
    body = data[1 : len(data) - tail]
    baseline = data[len(data) - channels - stride : len(data) - channels]
    modes = data[len(data) - channels :] if channels else np.zeros(stride // 4, np.uint8)
    if ((modes & 15) > 2).any() or (((modes & 15) < 2) & (modes >> 4 > 0)).any():
        raise MeshFileError("a channel is of an unknown mode")
    walk = _Walk(body, stride, version)
    for start in range(0, count, block):
        walk.block(min(block, count - start))
    walk.check_end()
    return _summed(_elements(walk.values(), count, block, stride), baseline, modes)


class _Walk:
    """Goes through the groups of a stream and notes where each one begins, and how its deltas are stored."""

    def __init__(self, body: Bytes, stride: int, version: int) -> None:
        self.body = body
        self.stride = stride
        self.version = version
        self.place = 0
        self.starts: list[int] = []
        self.widths: list[int] = []
        self.codes = body.tobytes()
        self.sizes = {1: _sizes(body, 1), 2: _sizes(body, 2), 4: _sizes(body, 4)}

    def block(self, elements: int) -> None:
        """One block of so many elements: their groups for each byte of an element."""
        groups = -(-elements // _GROUP)
        control = self._taken(self.stride // 4) if self.version else b""
        for byte in range(self.stride):
            mode = control[byte // 4] >> byte % 4 * 2 & 3 if self.version else -1
            if mode == _ALL_ZERO:
                self._plain(groups, _ZERO, 0)
            elif mode == _ALL_LITERAL:
                self._plain(groups, _LITERAL, elements)
            else:
                self._mixed(groups, _BITS[mode + 1])

    def _taken(self, size: int) -> bytes:
        taken = self.codes[self.place : self.place + size]
        if len(taken) < size:
            raise MeshFileError("it is cut short")
        self.place += size
        return taken

    def _plain(self, groups: int, width: int, size: int) -> None:
        self.starts += [self.place + _GROUP * i for i in range(groups)]
        self.widths += [width] * groups
        self.place += size  # a last group that is not full takes only the bytes that it has
        if self.place > len(self.codes):
            raise MeshFileError("it is cut short")

    def _mixed(self, groups: int, bits: tuple[int, ...]) -> None:
        head = self._taken(-(-groups // 4))
        place, size = self.place, len(self.codes)
        for group in range(groups):
            width = bits[head[group >> 2] >> (group & 3) * 2 & 3]
            self.starts.append(place)
            self.widths.append(width)
            if width == _LITERAL:
                place += _GROUP
            elif width != _ZERO:
                if place >= size:
                    raise MeshFileError("it is cut short")
                place += self.sizes[width][place]
        if place > size:
            raise MeshFileError("it is cut short")
        self.place = place

    def check_end(self) -> None:
        """After the last block comes nothing but padding to the smallest tail."""
        if self.codes[self.place :]:
            raise MeshFileError(f"{len(self.codes) - self.place} bytes follow the last element")

    def values(self) -> Bytes:
        """The deltas (groups, 16) as they are stored, in the order of the groups."""
        starts, widths = np.array(self.starts, np.int64), np.array(self.widths, np.uint8)
        values = np.zeros((len(starts), _GROUP), np.uint8)
        for width in (1, 2, 4, _LITERAL):
            chosen = np.flatnonzero(widths == width)
            for part in np.array_split(chosen, max(1, len(chosen) >> 16)):  # bounded working memory
                if len(part):
                    values[part] = self._group_values(starts[part], width)
        return values

    def _group_values(self, starts: NDArray[np.int64], width: int) -> Bytes:
        if width == _LITERAL:
            literal: Bytes = self.body[np.minimum(starts[:, None] + np.arange(_GROUP), len(self.body) - 1)]
            return literal
        packed = self.body[starts[:, None] + np.arange(2 * width)]
        taken = _unpacked(packed, width)
        escaped = taken == (1 << width) - 1
        group, element = np.nonzero(escaped)
        before = np.cumsum(escaped, axis=1)[group, element] - 1
        taken[group, element] = self.body[starts[group] + 2 * width + before]
        return taken


def _sizes(body: Bytes, width: int) -> bytes:
    """How long a group of that width is that begins at each byte: packed deltas, and a byte for each escaped one."""
    table = (_unpacked(np.arange(256, dtype=np.uint8)[:, None], width) == (1 << width) - 1).sum(axis=1)
    sums = np.concatenate([[0], np.cumsum(table[body])])
    packed = 2 * width
    ends = np.minimum(np.arange(len(body)) + packed, len(body))
    sizes: Bytes = (packed + sums[ends] - sums[:-1]).astype(np.uint8)
    return sizes.tobytes()


def _unpacked(packed: Bytes, width: int) -> Bytes:
    """Values (n, k * 8 / width) of bytes (n, k): the highest bits of a byte come first, but single bits last."""
    shifts = np.arange(0, 8, width) if width == 1 else np.arange(8 - width, -1, -width)
    spread = packed[:, :, None] >> shifts.astype(np.uint8) & np.uint8((1 << width) - 1)
    return spread.reshape(len(packed), -1)


def _elements(values: Bytes, count: int, block: int, stride: int) -> Bytes:
    """Deltas by element (count, stride): those of a block stand byte by byte, each byte's in groups."""
    whole = count // block * block
    groups = whole // _GROUP * stride
    parts = [values[:groups].reshape(-1, stride, block).transpose(0, 2, 1).reshape(whole, stride)]
    if count > whole:
        parts.append(values[groups:].reshape(stride, -1).T[: count - whole])
    return np.ascontiguousarray(np.concatenate(parts))


def _summed(deltas: Bytes, baseline: Bytes, modes: Bytes) -> Bytes:
    """Elements of their deltas: each channel of four bytes by its mode, from the baseline on."""
    result = np.empty_like(deltas)
    for channel, mode in enumerate(modes.tolist()):
        place = slice(4 * channel, 4 * channel + 4)
        dtype = ("<u1", "<u2", "<u4")[mode & 15]
        stored = np.ascontiguousarray(deltas[:, place]).view(dtype)
        start = np.ascontiguousarray(baseline[place]).view(dtype)
        one = stored.dtype.type(1)
        if mode & 15 == 2:
            turn = mode >> 4
            turned = stored >> np.uint32(turn) | stored << np.uint32((32 - turn) & 31) if turn else stored
            values = np.bitwise_xor.accumulate(turned, axis=0) ^ start
        else:
            signed = np.where(stored & one, ~(stored >> one), stored >> one)
            values = np.cumsum(signed, axis=0, dtype=stored.dtype) + start
        result[:, place] = np.ascontiguousarray(values).view(np.uint8).reshape(-1, 4)
    return result
