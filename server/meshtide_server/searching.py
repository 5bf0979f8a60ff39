"""Which of the hosted meshes a client asks for: those of the folder and those of the catalogue alike, page by page."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from meshtide_server.catalogue import Box, MeshQuery, MeshState
from meshtide_server.hosted_mesh import HostedMesh, Status  # noqa: TC001 - dataclass fields

if TYPE_CHECKING:
    from collections.abc import Sequence
    from datetime import datetime


@dataclass(frozen=True, slots=True)
class Search:
    """What is asked for; what is left out does not matter.

    Args:
        text: words that all stand in a mesh's id, name or tags, in any case.
        tags: that it has all of.
        licence: words that stand in the text of its terms, in any case; the folder's meshes have none.
        status: in which it is.
        smallest: bytes of its stream, at least.
        largest: bytes of its stream, at most.
        fewest_vertices: at least.
        most_vertices: at most.
        fewest_levels: that its stream can show, at least.
        most_levels: the same, at most.
        box: that its own box touches.
        created_after: when it came into the catalogue; the folder's meshes never did.
        created_before: the same.
        after: only ids that come after this one.
    """

    text: str = ""
    tags: tuple[str, ...] = ()
    licence: str = ""
    status: Status | None = None
    smallest: int | None = None
    largest: int | None = None
    fewest_vertices: int | None = None
    most_vertices: int | None = None
    fewest_levels: int | None = None
    most_levels: int | None = None
    box: Box | None = None
    created_after: datetime | None = None
    created_before: datetime | None = None
    after: str = ""

    def chosen(self, meshes: Sequence[HostedMesh]) -> list[HostedMesh]:
        """Those of `meshes` that are asked for."""
        return [mesh for mesh in meshes if mesh.id > self.after and self._wants(mesh)]

    def query(self) -> MeshQuery:
        """The same as the catalogue understands it."""
        same = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "status"}
        states = () if self.status is None else (MeshState(self.status.value),)
        return MeshQuery(**same, states=states)

    def _wants(self, mesh: HostedMesh) -> bool:
        record, header = mesh.record, mesh.stream.header if mesh.stream else None
        tags = record.tags if record else ()
        words = "\n".join((mesh.id, mesh.source.name, *tags)).casefold()
        terms = record.licence.lower() if record else ""
        created = record.created if record else None
        return (
            all(word in words for word in self.text.casefold().split())
            and all(word in terms for word in self.licence.lower().split())
            and set(self.tags) <= set(tags)
            and self.status in {None, mesh.status}
            and _within(mesh.stream.size if mesh.stream else None, self.smallest, self.largest)
            and _within(header.vertices if header else None, self.fewest_vertices, self.most_vertices)
            and _within(len(header.levels) if header else None, self.fewest_levels, self.most_levels)
            and (self.created_after is None or (created is not None and created > self.created_after))
            and (self.created_before is None or (created is not None and created < self.created_before))
            and (self.box is None or _touch(box_of(mesh), self.box))
        )


def box_of(mesh: HostedMesh) -> Box | None:
    """The box that holds a mesh: the catalogue's, else that of its quantization grid; None while there is no stream."""
    if mesh.record is not None and mesh.record.box is not None:
        return mesh.record.box
    return grid_box(mesh.stream.header.origin, mesh.stream.header.extent) if mesh.stream else None


def grid_box(origin: tuple[float, float, float], extent: float) -> Box:
    """The box of a quantization grid.

    >>> grid_box((0.0, 1.0, 2.0), 3.0)
    Box(minimum=(0.0, 1.0, 2.0), maximum=(3.0, 4.0, 5.0))
    """
    x, y, z = origin
    return Box((x, y, z), (x + extent, y + extent, z + extent))


def parse_box(text: str) -> Box:
    """A box from six numbers with commas between them: the smallest x, y, z, then the largest.

    Raises:
        ValueError: it is something else.

    >>> parse_box("0,0,0,1,2,3").maximum
    (1.0, 2.0, 3.0)
    """
    numbers = [float(part) for part in text.split(",")] if len(text) < 300 else []
    if len(numbers) != 6 or not all(map(math.isfinite, numbers)):
        raise ValueError("a box is six numbers, the smallest x, y, z and the largest: 0,0,0,1,1,1")
    x0, y0, z0, x1, y1, z1 = numbers
    return Box((x0, y0, z0), (x1, y1, z1))


def _within(value: int | None, least: int | None, most: int | None) -> bool:
    if value is None:
        return least is None and most is None
    return (least is None or value >= least) and (most is None or value <= most)


def _touch(box: Box | None, other: Box) -> bool:
    return box is not None and all(
        box.minimum[axis] <= other.maximum[axis] and box.maximum[axis] >= other.minimum[axis] for axis in range(3)
    )
