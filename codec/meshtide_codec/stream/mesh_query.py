"""Which meshes are asked for: the one list of what a query may say, for servers, their catalogues and clients.

Each field knows what it is called in an address and what it means; the HTTP interface and its description, the search
in a catalogue and what a client sends are made from that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from datetime import datetime

Parameter = tuple[str, str]
"""A name and a value in the query of an address."""
Bounds = tuple[float, float, float, float, float, float]
"""A box: the smallest x, y, z, then the largest."""
LARGEST_NUMBER = (1 << 63) - 1
MOST_LEVELS = (1 << 31) - 1
"""What catalogues hold of numbers and of levels."""
LONGEST_TEXT = 200
"""Characters of a text that is looked for."""
MOST_TAGS = 20


@dataclass(frozen=True, slots=True)
class Asked:
    """What is known of a field of a query.

    Args:
        meaning: for people.
        name: in an address; that of the field if it is empty.
        example: a value as it is in an address.
        largest: that a number may be.
    """

    meaning: str
    name: str = ""
    example: object = None
    largest: int = LARGEST_NUMBER


def _asked(meaning: str, name: str = "", example: object = None, largest: int = LARGEST_NUMBER) -> dict[str, Asked]:
    return {"asked": Asked(meaning, name, example, largest)}


@dataclass(frozen=True, slots=True)
class MeshQuery:
    """What is asked for; what is left out does not matter.

    Args:
        text: words that are all in a mesh's id, name or tags, in any case.
        tags: that it has all of.
        licence: words that are in the text of its terms, in any case; a folder's meshes have none.
        status: "ready", "encoding" or "failed".
        smallest: bytes of its stream, at least.
        largest: bytes of its stream, at most.
        fewest_vertices: at least.
        most_vertices: at most.
        fewest_levels: that its stream can show, at least.
        most_levels: the same, at most.
        created_after: when it was first published, which a folder's meshes never were; without a time zone, in UTC.
        created_before: the same.
        box: that its own touches.
        after: only ids that come after this one.

    >>> MeshQuery(text="bust", tags=("clay", "scan"), fewest_levels=3).parameters()
    [('q', 'bust'), ('tag', 'clay'), ('tag', 'scan'), ('fewest_levels', '3')]
    """

    text: str = field(default="", metadata=_asked("Words that are all in the id, the name or the tags.", "q", "bunny"))
    tags: tuple[str, ...] = field(default=(), metadata=_asked("Tags that it has all of.", "tag", ["scan"]))
    licence: str = field(default="", metadata=_asked("Words that are all in the text of its terms.", example="CC BY"))
    status: str | None = field(default=None, metadata=_asked("Whether it can be fetched."))
    smallest: int | None = field(default=None, metadata=_asked("Bytes of its stream, at least."))
    largest: int | None = field(default=None, metadata=_asked("Bytes of its stream, at most."))
    fewest_vertices: int | None = field(default=None, metadata=_asked("Vertices of its finest level, at least."))
    most_vertices: int | None = field(default=None, metadata=_asked("Vertices of its finest level, at most."))
    fewest_levels: int | None = field(
        default=None, metadata=_asked("States it can show, at least.", largest=MOST_LEVELS)
    )
    most_levels: int | None = field(default=None, metadata=_asked("States it can show, at most.", largest=MOST_LEVELS))
    created_after: datetime | None = field(
        default=None, metadata=_asked("Published after this moment; without a time zone, in UTC.", example="2026-11-01")
    )
    created_before: datetime | None = field(
        default=None,
        metadata=_asked("Published before this moment; without a time zone, in UTC.", example="2026-12-01T12:00:00Z"),
    )
    box: Bounds | None = field(
        default=None,
        metadata=_asked("A box that its own touches: smallest x, y, z, largest x, y, z.", example="0,0,0,1,1,1"),
    )
    after: str = field(default="", metadata=_asked("Only ids after this one.", example="spot"))

    def parameters(self) -> list[Parameter]:
        """The same as the query of an address."""
        found: list[Parameter] = []
        for name, asked in ASKED.items():
            value = getattr(self, name)
            if name == "tags":
                found += [(asked.name, tag) for tag in value]
            elif name == "box" and value is not None:
                found.append((name, ",".join(repr(float(number)) for number in value)))
            elif isinstance(value, datetime):
                found.append((name, value.isoformat()))
            elif value not in {None, ""}:
                found.append((asked.name or name, str(value)))
        return found


ASKED: dict[str, Asked] = {each.name: each.metadata["asked"] for each in fields(MeshQuery)}
"""What is known of each field."""


def parse_box(text: str) -> Bounds:
    """A box from six numbers with commas between them: the smallest x, y, z, then the largest.

    Raises:
        ValueError: it is something else.

    >>> parse_box("0,0,0,1,2,3")
    (0.0, 0.0, 0.0, 1.0, 2.0, 3.0)
    """
    numbers = [float(part) for part in text.split(",")] if len(text) < 300 else []
    if len(numbers) != 6 or not all(map(math.isfinite, numbers)):
        raise ValueError("a box is six numbers, the smallest x, y, z and the largest: 0,0,0,1,1,1")
    x0, y0, z0, x1, y1, z1 = numbers
    return x0, y0, z0, x1, y1, z1
