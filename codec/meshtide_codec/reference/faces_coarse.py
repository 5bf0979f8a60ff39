"""What the coarser level tells of the faces of the finer one (docs/format.md, section 9.1)."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshtide_codec.reference.octree import Face

EDGE_LIMIT = 64  # faces at one coarse edge that are looked at


class CoarseMesh:
    """Children, activity and edges of the coarse level.

    Args:
        parents: for each fine vertex its coarse vertex, never falling.
        faces: the coarse faces.
        count: number of coarse vertices.

    Attributes:
        children: for each coarse vertex the range of its children.
        split: whether it has several.
        active: whether it is split or shares a face with a split vertex.
        covered: for each coarse face whether a fine face above it is known.
        entries: for each coarse vertex (target, apex, face) of the faces around it that have an active corner, sorted.
    """

    def __init__(self, parents: list[int], faces: list[Face], count: int) -> None:
        self.parents = parents
        self.faces = faces
        starts = [bisect_left(parents, vertex) for vertex in range(count + 1)]
        self.children = [range(starts[vertex], starts[vertex + 1]) for vertex in range(count)]
        self.split = [len(children) > 1 for children in self.children]
        self.covered = [not any(self.split[corner] for corner in face) for face in faces]
        self.active = list(self.split)
        for face, covered in zip(faces, self.covered, strict=True):
            if not covered:
                for corner in face:
                    self.active[corner] = True
        self.entries: list[list[tuple[int, int, int]]] = [[] for _ in range(count)]
        for number, (a, b, c) in enumerate(faces):
            if self.active[a] or self.active[b] or self.active[c]:
                self.entries[a].append((b, c, number))
                self.entries[b].append((c, a, number))
                self.entries[c].append((a, b, number))
        for entries in self.entries:
            entries.sort()

    def at_edge(self, start: int, end: int) -> list[tuple[int, int]]:
        """(apex, face) of the coarse faces at the directed edge, at most EDGE_LIMIT of them."""
        found = [(apex, face) for target, apex, face in self.entries[start] if target == end]
        return found[:EDGE_LIMIT]

    def cover(self, a: int, b: int, c: int) -> None:
        """Note that a fine face with these corners accounts for the coarse face below it, if there is one."""
        a, b, c = self.parents[a], self.parents[b], self.parents[c]
        for target, apex, face in self.entries[a]:
            if (target, apex) == (b, c):
                self.covered[face] = True
