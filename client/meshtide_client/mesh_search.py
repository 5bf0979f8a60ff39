"""Which of a server's meshes are wanted: what `list_meshes` asks a server for."""

from __future__ import annotations

from dataclasses import dataclass, fields
from datetime import datetime

Parameter = tuple[str, str]
_NAMES = {"text": "q", "tags": "tag"}


@dataclass(frozen=True, slots=True)
class MeshSearch:
    """What is asked for; what is left out does not matter.

    Args:
        text: words that all stand in a mesh's id, name or tags, in any case.
        tags: that it has all of.
        licence: words that stand in the text of its terms, in any case.
        status: "ready", "encoding" or "failed".
        smallest: bytes of its stream, at least.
        largest: bytes of its stream, at most.
        fewest_vertices: at least.
        most_vertices: at most.
        fewest_levels: that its stream can show, at least.
        most_levels: the same, at most.
        created_after: when it was first published; without a time zone, in UTC.
        created_before: the same.
        box: that its own touches: the smallest x, y, z, then the largest.
        after: only ids that come after this one.

    >>> MeshSearch(text="bust", tags=("clay", "scan"), fewest_levels=3).parameters()
    [('q', 'bust'), ('tag', 'clay'), ('tag', 'scan'), ('fewest_levels', '3')]
    """

    text: str = ""
    tags: tuple[str, ...] = ()
    licence: str = ""
    status: str | None = None
    smallest: int | None = None
    largest: int | None = None
    fewest_vertices: int | None = None
    most_vertices: int | None = None
    fewest_levels: int | None = None
    most_levels: int | None = None
    created_after: datetime | None = None
    created_before: datetime | None = None
    box: tuple[float, float, float, float, float, float] | None = None
    after: str = ""

    def parameters(self) -> list[Parameter]:
        """The same as a server's query."""
        found: list[Parameter] = []
        for field in fields(self):
            value = getattr(self, field.name)
            name = _NAMES.get(field.name, field.name)
            if field.name == "tags":
                found += [(name, tag) for tag in value]
            elif field.name == "box" and value is not None:
                found.append((name, ",".join(repr(float(number)) for number in value)))
            elif isinstance(value, datetime):
                found.append((name, value.isoformat()))
            elif value not in {None, ""}:
                found.append((name, str(value)))
        return found
