"""Streams of meshopt compression for tests: an encoder that is as plain as can be, and streams of another one.

The fixed streams and what stands behind them were made by meshoptimizer 1.3, so that the decoder does not lean on the
reading of the specification that the encoder here has.
"""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_BITS = {-1: (0, 2, 4, 8), 0: (0, 1, 2, 4), 1: (1, 2, 4, 8)}


def encoded_attributes(rows: NDArray[np.uint8], version: int, modes: Sequence[int] | None) -> bytes:
    """A stream of rows (n, stride), in version 1 with these modes of its channels, each byte as short as can be."""
    count, stride = rows.shape
    modes = [0] * (stride // 4) if modes is None else modes
    baseline = rows[0] if count else np.zeros(stride, np.uint8)
    before = np.concatenate([baseline[None], rows[:-1]]) if count else rows
    deltas = np.concatenate([_deltas(rows, before, channel, mode) for channel, mode in enumerate(modes)], axis=1)
    block = min(8192 // stride & ~15, 256)
    body = b"".join(_block(deltas[start : start + block], version) for start in range(0, count, block))
    tail = baseline.tobytes() + (bytes(modes) if version else b"")
    smallest = 24 if version else 32
    return bytes([0xA0 + version]) + body + bytes(max(0, smallest - len(tail))) + tail


def _deltas(rows: NDArray[np.uint8], before: NDArray[np.uint8], channel: int, mode: int) -> NDArray[np.uint8]:
    dtype = ("<u1", "<u2", "<u4")[mode & 15]
    place = slice(4 * channel, 4 * channel + 4)
    now, then = (np.ascontiguousarray(one[:, place]).view(dtype).astype(np.int64) for one in (rows, before))
    bits = 8 * np.dtype(dtype).itemsize
    if mode & 15 == 2:
        turn, word = mode >> 4, now ^ then
        stored = (word << turn | word >> (32 - turn)) & 0xFFFFFFFF
    else:
        signed = (now - then + (1 << (bits - 1))) % (1 << bits) - (1 << (bits - 1))
        stored = np.where(signed < 0, -2 * signed - 1, 2 * signed)
    return np.ascontiguousarray(stored.astype(dtype)).view(np.uint8).reshape(len(rows), 4)


def _block(deltas: NDArray[np.uint8], version: int) -> bytes:
    control, body = [], b""
    for column in deltas.T:
        choices = {-1: _groups(column, -1)} if version == 0 else {0: _groups(column, 0), 1: _groups(column, 1)}
        if version:
            choices[3] = column.tobytes()
        if version and not column.any():
            choices[2] = b""
        best = min((mode for mode, data in choices.items() if data is not None), key=lambda mode: len(choices[mode]))
        control.append(best)
        body += choices[best]
    packed = [sum(control[i + j] << 2 * j for j in range(4)) for i in range(0, len(control), 4)] if version else []
    return bytes(packed) + body


def _groups(column: NDArray[np.uint8], mode: int) -> bytes:
    padded = np.pad(column, (0, -len(column) % 16)).reshape(-1, 16)
    heads, body = [], b""
    for group in padded:
        options = {}
        for head, width in enumerate(_BITS[mode]):
            if width == 0 and not group.any():
                options[head] = b""
            elif width == 8:
                options[head] = group.tobytes()
            elif width:
                options[head] = _packed(group, width)
        best = min(options, key=lambda head: len(options[head]))
        heads.append(best)
        body += options[best]
    heads += [0] * (-len(heads) % 4)
    return bytes(sum(heads[i + j] << 2 * j for j in range(4)) for i in range(0, len(heads), 4)) + body


def _packed(group: NDArray[np.uint8], width: int) -> bytes:
    most, each = (1 << width) - 1, 8 // width
    small = [min(int(value), most) for value in group]
    packed = []
    for start in range(0, 16, each):
        part = small[start : start + each]
        part = part if width == 1 else part[::-1]
        packed.append(sum(value << width * place for place, value in enumerate(part)))
    return bytes(packed) + bytes(int(value) for value in group if value >= most)


def number(value: int) -> bytes:
    """A number below 2^32, seven bits to a byte."""
    data = b""
    while value > 0x7F:
        data += bytes([value & 0x7F | 0x80])
        value >>= 7
    return data + bytes([value])


def zigzag(delta: int) -> int:
    """A difference, modulo 2^32, as a number that is small where it is near zero."""
    signed = (delta + (1 << 31)) % (1 << 32) - (1 << 31)
    return -2 * signed - 1 if signed < 0 else 2 * signed


def encoded_indices(indices: Sequence[int], baselines: Sequence[int]) -> bytes:
    """A stream of indices, each as a difference to the last one of its baseline."""
    last, body = [0, 0], b""
    for index, baseline in zip(indices, baselines, strict=True):
        body += number(zigzag(index - last[baseline]) << 1 | baseline)
        last[baseline] = index
    return b"\xd1" + body + bytes(4)


def encoded_triangles(triangles: Sequence[Sequence[int]]) -> bytes:
    """A stream of triangles of which each says all of its corners."""
    last, data = 0, b""
    for triangle in triangles:
        data += b"\xff"
        for index in triangle:
            data += number(zigzag(index - last))
            last = index
    return b"\xe1" + b"\xff" * len(triangles) + data + bytes(16)


_STREAMS = {
    "version 0": (
        "oAcAAgYKDhIWGh4iJiouMjY6/wAAAD5CRkoEgAAAAAcASkpKSkpKSkpKSkpKSkpK/wAAAEpKSkoBAAIACAoFVVVVVVVVVVVV"
        "AAAAAAAAAAUAPA8D+foMC+3AAAAA7gUAPA8DJiVOTXTAAAAAcwAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAADoAwAA"
    ),
    "version 1, bytes and words": (
        "obtZAAIGCg4SFhoeIiYqLjI2Oj5CRkoASkpKSkpKSkpKSkpKSkpKSkpKSgIFVVVVVVVVVQ8ABQUFBQBgjPn6DAvtAQDuAGCM"
        "JiVOTXQBAHMAAAAAAAAAAAAAAAAAAAAAAADoAwAAAQA="
    ),
    "version 1, turned words": "oWoCATFxMfExcTEPDwAfAQMBAAAAAAAAAAAAAAAAAAAAAAAAALl5N55C",
    "version 1, floats": (
        "oX9/WgDckOMqThyHNFgf5owX9E25dTZESeVpqQD57dCHYlpBXjmw0JcE/WJJk16LDNC88QAB/H52QjQwKiQeCgYCAQcVJzVB"
        "UcPTEwACAILAAAH/AD7+dBNkvgxCzCjI2dJM9AziLUtzT+06AAsdHQi/9eRiQ/QWF0JvcIcCkcNj/IYOAPwF4cqKiE5GQjoW"
        "DAYHDylLWYG9iHIzBToCAAB8AR4AAAMAQgL/gID0AH9/////ABYA/38BwAB+gAAAAAAAAAAAAAAAAAAAAAAAAAAAAAEAAQ=="
    ),
}


def fixed_attributes(name: str) -> tuple[bytes, NDArray[np.uint8]]:
    """A stream and its rows."""
    if name == "version 1, floats":
        x = np.arange(24) * 0.1
        curve = (x * x * x - 5 * x).astype("<f4").reshape(24, 1)
        floats = np.concatenate([curve, curve * curve, np.round(curve)], axis=1)
        return base64.b64decode(_STREAMS[name]), floats.view(np.uint8)
    i = np.arange(20)
    if name == "version 1, turned words":
        return base64.b64decode(_STREAMS[name]), (i << 20 ^ 0x9E3779B9).astype("<u4")[:, None].view(np.uint8)
    columns = [i * i, i * 37, 1000 - i * 3, np.where(i % 5, 0, i * 999)]
    return base64.b64decode(_STREAMS[name]), np.stack(columns, axis=1).astype("<u2").view(np.uint8)


FIXED_TRIANGLES = (
    "4fAQABD/CP//sBT/EgEBiAtfxgGYxAgAdodWZ3iphmWJaJgBaQAA",
    [
        [0, 1, 2],
        [2, 1, 3],
        [2, 3, 4],
        [4, 3, 5],
        [9, 8, 7],
        [0, 9, 7],
        [1, 1, 1],
        [100, 5, 70000],
        [4, 5, 6],
        [6, 5, 7],
    ],
)
FIXED_INDICES = (
    "0QAEBJEDBAUEBQSpiBHs////D6eLEQAAAAA=",
    [0, 1, 2, 100, 3, 101, 4, 102, 5, 70000, 2**30, 6],
)
FIXED_FILTERS = [
    ("octahedral", 4, "AAB/QH9/f382t38ApmN/gVVVf0AAf38A", "AAB/QAAAgX9MmgAA0j2agUlJtkAAfwAA"),
    (
        "octahedral",
        8,
        "AAAAAP8HAED/B/8H/wf/f20Dbvv/BwAAWPo+Bv8HAYBVBVUF/wcAQAAA/wf/BwAA",
        "AAAAAP9/AEAAAAAAAYD/f8VMlZkAAAAA99FrPZKZAYDdSd1JB7YAQAAA/38AAAAA",
    ),
    (
        "quaternion",
        8,
        "DwUAAAAA/gcB+AAAAAD+BwAAAAA3+f0H4QIp/GYG/wenBVn6pwX8BwAAAAAAAP0H",
        "AAAAAHpyQjkAAAAAglp+pTOzZWYAAAAAliCK1GxIe1oPQPo/BsD6PwAA/38AAAAA",
    ),
    (
        "exponential",
        16,
        (
            "AAAA/AAAAPyAPgD8QB8A/AAAAPwAAAD8gMH//IA+APyAJQD8AM7//AAAAPwAAAD8gOn//AAeAPwAzv/8gMH//IA+APuAPgD7gMH/+4A+APsA"
            "AAD8gD4A/AAAAPwAAAD8"
        ),
        (
            "AAAAAAAAAAAAAHpEAAD6QwAAAAAAAAAAAAB6xAAAekQAABZEAABIxAAAAAAAAAAAAAC0wwAA8EMAAEjEAAB6xAAA+kMAAPpDAAD6wwAA+kMA"
            "AAAAAAB6RAAAAAAAAAAA"
        ),
    ),
    ("color", 4, "QIHAwECBwP+MTECAh8jz/4AAAMB/AH+A", "AQD/gAEA//+YzAAAXHrM/4CAgIAA/gAA"),
    (
        "color",
        8,
        "AAQB+AD8AAwABAH4APz/D8wIzAQABAAIewh7/DT//w8ACAAAAAAADP8HAAD/BwAI",
        "EAAAAP//CIAQAAAA/////4mZzMwAAAAAJVz3eszM//8IgAiACIAIgAAA7/8AAAAA",
    ),
]
"""Filter, bytes of a row, rows before and after."""
