"""Which of the meshes in memory are asked for: the same that a catalogue finds among its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from meshtide_server.catalogue import Box

if TYPE_CHECKING:
    from collections.abc import Iterable

    from meshtide_codec.stream.mesh_query import Bounds, MeshQuery
    from meshtide_server.hosting.mesh import HostedMesh


def chosen(query: MeshQuery, meshes: Iterable[HostedMesh]) -> list[HostedMesh]:
    """Those of `meshes` that are asked for."""
    return [mesh for mesh in meshes if mesh.id > query.after and _wants(query, mesh)]


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


def _wants(query: MeshQuery, mesh: HostedMesh) -> bool:
    record, header = mesh.record, mesh.stream.header if mesh.stream else None
    tags = record.tags if record else ()
    words = "\n".join((mesh.id, mesh.source.name, *tags)).casefold()
    terms = record.licence.lower() if record else ""
    created = record.created if record else None
    return (
        all(word in words for word in query.text.casefold().split())
        and all(word in terms for word in query.licence.lower().split())
        and set(query.tags) <= set(tags)
        and query.status in {None, mesh.status}
        and _within(mesh.stream.size if mesh.stream else None, query.smallest, query.largest)
        and _within(header.vertices if header else None, query.fewest_vertices, query.most_vertices)
        and _within(len(header.levels) if header else None, query.fewest_levels, query.most_levels)
        and (query.created_after is None or (created is not None and created > query.created_after))
        and (query.created_before is None or (created is not None and created < query.created_before))
        and (query.box is None or _touch(box_of(mesh), query.box))
    )


def _within(value: int | None, least: int | None, most: int | None) -> bool:
    if value is None:
        return least is None and most is None
    return (least is None or value >= least) and (most is None or value <= most)


def _touch(box: Box | None, other: Bounds) -> bool:
    return box is not None and all(
        box.minimum[axis] <= other[3 + axis] and box.maximum[axis] >= other[axis] for axis in range(3)
    )
