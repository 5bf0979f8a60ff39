"""The statements of an OBJ file that set something for the faces after them, and those that are not read."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec.attributes import NONE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.mesh_files.source import Source

_KEPT = {b"g": "group", b"o": "object", b"s": "smoothing", b"usemtl": "material"}
_LIBRARY = b"mtllib"
_CURVES = b"curv curv2 surf vp cstype deg bmat step parm trim hole scrv sp end con".split()
_LEFT_OUT = {b"l": "lines", b"p": "points"} | dict.fromkeys(_CURVES, "statements of curves and surfaces")
_OTHERS = "statements of other kinds"
_COMMENT = re.compile(rb"(^|(?<=[ \t]))#(?!\d)")


class Statements:
    """What stands between the faces of a file.

    `libraries` are the material files that it names, each once, in their order.
    """

    def __init__(self) -> None:
        self._libraries: dict[bytes, None] = {}
        self._spans: dict[str, list[tuple[int, bytes]]] = {kept: [] for kept in _KEPT.values()}
        self._left_out: Counter[str] = Counter()
        self._other = ""

    def take(self, line: bytes, face: int) -> None:
        """Read a line, its indent taken off, that stands before the face of that number."""
        words = line.split(None, 1)
        word = words[0]
        kept = _KEPT.get(word)
        if kept is not None:
            spans = self._spans[kept]
            name = without_comment(words[1]) if len(words) > 1 else b""
            if spans and spans[-1][0] == face:
                spans[-1] = (face, name)
            elif not spans or spans[-1][1] != name:
                spans.append((face, name))
        elif word == _LIBRARY and len(words) > 1:
            self._libraries[without_comment(words[1])] = None
        else:
            self._left_out[_LEFT_OUT.get(word, _OTHERS)] += 1
            if word not in _LEFT_OUT and not self._other:
                self._other = shown_name(word[:40])

    @property
    def libraries(self) -> list[bytes]:
        """The material files that are named, each once."""
        return [name for name in self._libraries if name]

    def labels(self, kept: str, faces: int) -> tuple[list[bytes], NDArray[np.int64]]:
        """The names of one kind that faces have, and the name of each face (faces,), NONE where it has none.

        Args:
            kept: group, object, smoothing or material.
            faces: how many there are.
        """
        spans = [(face, name) for face, name in self._spans[kept] if face < faces]
        names: dict[bytes, int] = {}
        rows = [names.setdefault(name, len(names)) if name else NONE for _, name in spans]
        bounds = np.array([0, *(face for face, _ in spans), faces])
        return list(names), np.repeat(np.array([NONE, *rows]), np.diff(bounds))

    def material_names(self) -> list[bytes]:
        """The materials that are named before a face or behind the last one, each once."""
        return list(dict.fromkeys(name for _, name in self._spans["material"] if name))

    def first_object(self) -> str:
        """The name of the first object, or nothing."""
        return shown_name(next((name for _, name in self._spans["object"]), b""))

    def report(self, source: Source) -> None:
        """Report, in one line, what was not read."""
        parts = [f"{count} {what}" for what, count in self._left_out.items() if what != _OTHERS]
        if self._left_out[_OTHERS]:
            parts.append(f"{self._left_out[_OTHERS]} {_OTHERS} (the first is {self._other!r})")
        if parts:
            source.note(f"not read: {', '.join(parts)}")


def without_comment(text: bytes) -> bytes:
    r"""A name without the blanks around it and a comment behind it; of 3D programs' names some have a number sign.

    >>> without_comment(b" Material #25\t# the floor")
    b'Material #25'
    """
    return _COMMENT.split(text, maxsplit=1)[0].strip()


def shown_name(name: bytes) -> str:
    """A name as text; bytes that are not UTF-8 are replaced."""
    return name.decode("utf-8", "replace")
