"""OBJ read line by line in plain Python: slow, and with nothing in common with the reader that it is held against."""

from __future__ import annotations

from dataclasses import dataclass, field

Corner = tuple[int, int | None, int | None]
"""The rows of a corner in the tables of positions, texture coordinates and normals, from 0."""


@dataclass
class PlainObj:
    """What the lines of a file say: numbers after v, vt and vn, and the corners of each face."""

    tables: dict[str, list[tuple[float, ...]]] = field(default_factory=lambda: {"v": [], "vt": [], "vn": []})
    faces: list[list[Corner]] = field(default_factory=list)

    @property
    def positions(self) -> list[tuple[float, ...]]:
        return [row[:3] for row in self.tables["v"]]

    def wedges(self) -> set[tuple[int, int | None]]:
        """The distinct pairs of position and texture coordinates."""
        return {(v, t) for face in self.faces for v, t, _ in face}


def read_plain_obj(data: bytes) -> PlainObj:
    text = data.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " ")
    found = PlainObj()
    for line in text.split("\n"):
        words = line.split("#")[0].split()
        if not words:
            continue
        if words[0] in found.tables:
            found.tables[words[0]].append(tuple(float(word) for word in words[1:]))
        elif words[0] in {"f", "fo"}:
            found.faces.append([_corner(word, found) for word in words[1:]])
    return found


def _corner(word: str, found: PlainObj) -> Corner:
    rows: list[int | None] = [None, None, None]
    for place, (key, index) in enumerate(zip(("v", "vt", "vn"), word.split("/"), strict=False)):
        if index:
            number = int(index)
            rows[place] = number - 1 if number > 0 else len(found.tables[key]) + number
    assert rows[0] is not None
    return (rows[0], rows[1], rows[2])


def turned(face: list[Corner]) -> list[Corner]:
    """The same face from its smallest corner on: where a polygon begins is not kept."""
    start = face.index(min(face, key=lambda corner: tuple(-1 if row is None else row for row in corner)))
    return face[start:] + face[:start]
