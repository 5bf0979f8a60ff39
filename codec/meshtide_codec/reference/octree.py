"""Levels of the octree: cells, their order, rings of neighbours (docs/format.md, sections 8.2 and 8.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

Cell = tuple[int, int, int]
Face = tuple[int, int, int]

RING_LIMIT = 64
NOBODY = -1


@dataclass
class Ring:
    """The neighbours of a vertex in the order in which its triangles turn, and whether they are one closed turn.

    `across[i]` is the vertex across the triangle of the vertex with members i and i + 1, or NOBODY.
    """

    members: list[int] = field(default_factory=list)
    closed: bool = False
    across: list[int] = field(default_factory=list)

    def after(self, place: int) -> int:
        """The member that follows the one at `place`, or NOBODY."""
        if place + 1 < len(self.members):
            return self.members[place + 1]
        return self.members[0] if self.closed else NOBODY

    def before(self, place: int) -> int:
        """The member ahead of the one at `place`, or NOBODY."""
        if place > 0:
            return self.members[place - 1]
        return self.members[-1] if self.closed else NOBODY


@dataclass
class Level:
    """The cells of one depth in Morton order, and what is known of them.

    Attributes:
        depth: b; cells have side 2^-b of the cube.
        cells: each in the grid of its own depth.
        cell_depths: the depth of each cell, less than b for a leaf that arose earlier.
        leaves: whether the cell holds exactly one finest vertex.
        parents: index of each cell's parent at depth b - 1.
        faces: triangles in canonical order.
        rings: one for each vertex, once the faces are known.
    """

    depth: int
    cells: list[Cell]
    cell_depths: list[int]
    leaves: list[bool]
    parents: list[int]
    faces: list[Face] = field(default_factory=list)
    rings: list[Ring] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.cells)

    def centre(self, vertex: int) -> Cell:
        """Centre of a cell in half cells of this depth."""
        shift = self.depth - self.cell_depths[vertex]
        x, y, z = self.cells[vertex]
        return (2 * x + 1) << shift, (2 * y + 1) << shift, (2 * z + 1) << shift

    def code(self, vertex: int) -> int:
        """Morton code of the cell's lowest corner in the grid of this depth."""
        return morton_code(self.cells[vertex], self.cell_depths[vertex]) << 3 * (self.depth - self.cell_depths[vertex])

    def set_faces(self, faces: list[Face]) -> None:
        """Set the faces, and the rings that follow from them."""
        self.faces = faces
        self.rings = rings_of(faces, len(self))


def root(vertices: int) -> Level:
    """Depth 0, for a mesh of so many finest vertices."""
    level = Level(0, [(0, 0, 0)], [0], [vertices == 1], [0])
    level.set_faces([])
    return level


def deepened(level: Level) -> Level:
    """The next depth when all cells are leaves: nothing changes but the unit of length."""
    return Level(
        level.depth + 1,
        level.cells,
        level.cell_depths,
        level.leaves,
        list(range(len(level))),
        level.faces,
        level.rings,
    )


def morton_code(cell: Cell, bits: int) -> int:
    """The bits of x, y, z interleaved, x highest.

    >>> [morton_code(cell, 2) for cell in [(0, 0, 1), (0, 1, 0), (1, 0, 0), (3, 3, 3)]]
    [1, 2, 4, 63]
    """
    code = 0
    for place in range(bits - 1, -1, -1):
        for coordinate in cell:
            code = 2 * code + (coordinate >> place & 1)
    return code


def morton_cell(code: int, bits: int) -> Cell:
    """The cell that `morton_code` interleaved.

    >>> morton_cell(63, 2)
    (3, 3, 3)
    """
    x = y = z = 0
    for place in range(bits):
        digit = code >> 3 * place & 7
        x |= (digit >> 2) << place
        y |= (digit >> 1 & 1) << place
        z |= (digit & 1) << place
    return x, y, z


def rings_of(faces: list[Face], vertices: int) -> list[Ring]:
    """The rings of all vertices."""
    wedges: list[list[tuple[int, int]]] = [[] for _ in range(vertices)]
    for a, b, c in faces:
        wedges[a].append((b, c))
        wedges[b].append((c, a))
        wedges[c].append((a, b))
    rings = [_ring(around) for around in wedges]
    for vertex, ring in enumerate(rings):
        ring.across = [_across(rings, vertex, place) for place in range(len(ring.members))]
    return rings


def _ring(wedges: list[tuple[int, int]]) -> Ring:
    """Chain the wedges of a vertex head to tail."""
    if len(wedges) > RING_LIMIT:
        return Ring([start for start, _ in wedges])
    ring = Ring()
    while wedges:
        head, tail = wedges.pop(0)
        chain = [head]
        while tail != head:
            chain.append(tail)
            place = next((i for i, wedge in enumerate(wedges) if wedge[0] == tail), None)
            if place is None:
                break
            tail = _take(wedges, place)[1]
        if tail == head:
            ring.closed = not ring.members and not wedges
        else:
            chain = _chain_before(wedges, head) + chain
        ring.members += chain
    return ring


def _chain_before(wedges: list[tuple[int, int]], head: int) -> list[int]:
    """What leads to `head`, first to last."""
    chain: list[int] = []
    while True:
        place = next((i for i, wedge in enumerate(wedges) if wedge[1] == head), None)
        if place is None:
            return chain
        head = _take(wedges, place)[0]
        chain.insert(0, head)


def _take(wedges: list[tuple[int, int]], place: int) -> tuple[int, int]:
    """Take out a wedge; the first one moves to its place."""
    taken = wedges[place]
    wedges[place] = wedges[0]
    wedges.pop(0)
    return taken


def _across(rings: list[Ring], vertex: int, place: int) -> int:
    """The vertex across the edge of the members at `place` and after it, read from the ring of the first."""
    ring = rings[vertex]
    near, other = ring.members[place], ring.after(place)
    if len(ring.members) > RING_LIMIT or len(rings[near].members) > RING_LIMIT or other not in rings[near].members:
        return NOBODY
    there = rings[near].members.index(other)
    if rings[near].before(there) == vertex:
        return rings[near].after(there)
    if rings[near].after(there) == vertex:
        return rings[near].before(there)
    return NOBODY
