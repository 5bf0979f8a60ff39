"""Train the initial states of profile compact's Map and Diff coders on meshes given on the command line.

    python tools/train_geometry.py --output codec/meshtide_codec/compact/geometry_states.npz MESH...

Every mesh is coded several times: as it is and turned at random, at several depths, and coarsened to a few hundred
vertices, as previews are. Each run begins from the states so far; afterwards a context's probability is the mean over
the runs that met it, and its count says how much the runs agree (the moments of a beta distribution), within narrow
limits: meshes differ, and adapting at once is worth more than certainty. Weights are means too. A few rounds settle
both. With --test MESH... the bits per vertex of other meshes are printed before and after.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshtide_codec.compact.diff_coder import new_slice_state, write_diff
from meshtide_codec.compact.map_coder import write_map
from meshtide_codec.compact.mirror import find_mirror
from meshtide_codec.compact.models import Models, untrained_diff_models, untrained_map_models
from meshtide_codec.compact.octree import Octree, build_octree
from meshtide_codec.compact.slices import Slices
from meshtide_codec.entropy.codec import PayloadWriter
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.output_policy import output_file
from meshtide_codec.quantize import quantize

ROUNDS = 4
TURNS = 4  # codings of each mesh per round: as it is, then turned
BITS = (12, 10, 14)  # depth of the finest level, in turn
COARSE = ((3, 7), (4, 8), (5, 9))  # depth of the cells that a mesh is coarsened to, depth it is coded at
LARGEST_COUNT = 6
SMALLEST_COUNT = 1
EVEN = 1 << 15


@dataclasses.dataclass
class Gathered:
    """What the runs of one round have left: sums over runs, weighted by how often a context was met."""

    models: Models
    visits: npt.NDArray[np.float64] = dataclasses.field(init=False)
    sums: npt.NDArray[np.float64] = dataclasses.field(init=False)
    squares: npt.NDArray[np.float64] = dataclasses.field(init=False)
    runs: npt.NDArray[np.float64] = dataclasses.field(init=False)
    weight_sums: npt.NDArray[np.float64] = dataclasses.field(init=False)
    weight_runs: npt.NDArray[np.float64] = dataclasses.field(init=False)

    def __post_init__(self) -> None:
        contexts, weights = len(self.models.contexts), len(self.models.weights)
        self.visits, self.sums, self.squares, self.runs = np.zeros((4, contexts))
        self.weight_sums, self.weight_runs = np.zeros((2, weights))

    def start(self) -> Models:
        """States for a run: the current probabilities, with counts of zero so that counts tell visits."""
        return Models(self.models.contexts & ~255, self.models.weights.copy())

    def add(self, learnt: Models) -> None:
        """Take in the states that a run has left."""
        count = (learnt.contexts & 255).astype(np.float64)
        chance = (learnt.contexts >> 8) / 65536.0
        self.visits += count
        self.sums += count * chance
        self.squares += count * chance * chance
        self.runs += count > 0
        moved = learnt.weights != self.models.weights
        self.weight_sums += np.where(moved, learnt.weights, 0)
        self.weight_runs += moved

    def states(self) -> Models:
        """The trained states after a round; contexts and weights that no run met stay as they were."""
        met = self.visits > 0
        visits = np.where(met, self.visits, 1.0)
        # one made-up decision of even chances keeps rarely met contexts from certainty
        mean = np.where(met, (self.sums + 0.5) / (visits + 1.0), 0.5)
        spread = np.maximum(self.squares / visits - (self.sums / visits) ** 2, 1e-6)
        agreement = mean * (1.0 - mean) / spread - 1.0
        counts = np.minimum(agreement, self.visits / 4.0)
        counts = np.where(met, np.clip(counts, SMALLEST_COUNT, LARGEST_COUNT), 0.0).astype(np.int32)
        probabilities = np.clip(np.rint(mean * 65536.0), 64, 65472).astype(np.int32)
        weights = np.rint(self.weight_sums / np.maximum(self.weight_runs, 1.0)).astype(np.int32)
        weights = np.where(self.weight_runs > 0, weights, self.models.weights).astype(np.int32)
        return Models((probabilities << 8) | counts, weights)


def code(octree: Octree, map_models: Models, diff_models: Models) -> tuple[int, int]:
    """Code a whole mesh; the models learn from it. Returns the bytes of its Maps and of its Diffs."""
    mirror = find_mirror(octree.positions, octree.bits)
    slices = Slices(octree.bits)
    state = new_slice_state(octree.levels[0], slices, 0, diff_models)
    maps = diffs = 0
    for depth in range(1, octree.bits + 1):
        coarse, fine = octree.levels[depth - 1], octree.levels[depth]
        if not coarse.all_leaves:
            writer = PayloadWriter()
            write_map(writer, coarse, fine, octree.bits, map_models, mirror)
            maps += len(writer.payload())
        writer = PayloadWriter()
        write_diff(writer, octree, depth, state, slices, 0, mirror)
        diffs += len(writer.payload())
    diff_models.adopt(state.models)
    return maps, diffs


def octree_of(mesh: Mesh, bits: int) -> Octree:
    """The octree of a mesh at some depth."""
    quantized = quantize(mesh, bits)
    return build_octree(quantized.positions, quantized.faces, bits)


def coarsened(mesh: Mesh, depth: int) -> Mesh:
    """The mesh with all vertices in a cell of the octree's `depth` drawn together to their mean."""
    octree = octree_of(mesh, 12)
    level = octree.levels[depth]
    firsts = octree.first_vertices[depth]
    sizes = np.diff(np.r_[firsts, len(octree.positions)])[:, None]
    means = np.add.reduceat(octree.positions.astype(np.float64), firsts, axis=0) / sizes
    return Mesh.checked(means, [] if level.faces is None else level.faces)


def training_octrees(meshes: list[Mesh]) -> list[Octree]:
    """All that one round codes."""
    generator = np.random.default_rng(1)
    octrees = []
    for turn in range(TURNS):
        for mesh in meshes:
            shape = mesh if turn == 0 else turned(mesh, generator)
            octrees.append(octree_of(shape, BITS[turn % len(BITS)]))
            octrees.extend(octree_of(coarsened(shape, depth), bits) for depth, bits in COARSE)
    return octrees


def turned(mesh: Mesh, generator: np.random.Generator) -> Mesh:
    """The mesh, rotated at random."""
    rotation, _ = np.linalg.qr(generator.normal(size=(3, 3)))
    if np.linalg.det(rotation) < 0:
        rotation[:, 0] = -rotation[:, 0]
    return Mesh(mesh.vertices @ rotation, mesh.faces)


def report(title: str, meshes: dict[str, Mesh], map_models: Models, diff_models: Models) -> None:
    """Print the bits per vertex of meshes at 12 bits, and coarsened at 8, each coded from the given states."""
    print(title)
    cases = [(name, octree_of(mesh, 12)) for name, mesh in meshes.items()]
    cases += [(f"{name}, coarse", octree_of(coarsened(mesh, 4), 8)) for name, mesh in meshes.items()]
    for name, octree in cases:
        maps, diffs = code(octree, map_models.copy(), diff_models.copy())
        scale = 8.0 / len(octree.positions)
        size = f"{len(octree.positions):6} vertices"
        print(f"  {name:28} {size}  map {maps * scale:6.3f}  diff {diffs * scale:6.3f}  bits per vertex")


def main() -> None:
    """Train, save, and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--test", nargs="*", type=Path, default=[])
    parser.add_argument("--output", type=Path, required=True)
    arguments = parser.parse_args()
    output_file(arguments.output, [*arguments.meshes, *arguments.test], overwrite=True)
    meshes = [load_mesh(path) for path in arguments.meshes]
    tests = {path.name: load_mesh(path) for path in arguments.test}
    octrees = training_octrees(meshes)
    map_models, diff_models = untrained_map_models(), untrained_diff_models()
    report("untrained", tests, map_models, diff_models)
    for _ in range(ROUNDS):
        map_gathered, diff_gathered = Gathered(map_models), Gathered(diff_models)
        for octree in octrees:
            map_learning, diff_learning = map_gathered.start(), diff_gathered.start()
            code(octree, map_learning, diff_learning)
            map_gathered.add(map_learning)
            diff_gathered.add(diff_learning)
        map_models, diff_models = map_gathered.states(), diff_gathered.states()
    report("trained", tests, map_models, diff_models)
    np.savez_compressed(
        arguments.output,
        map_probabilities=(map_models.contexts >> 8).astype(np.uint16),
        map_counts=(map_models.contexts & 255).astype(np.uint8),
        map_weights=map_models.weights,
        diff_probabilities=(diff_models.contexts >> 8).astype(np.uint16),
        diff_counts=(diff_models.contexts & 255).astype(np.uint8),
        diff_weights=diff_models.weights,
    )
    print(f"{arguments.output}: {arguments.output.stat().st_size} bytes")


if __name__ == "__main__":
    main()
