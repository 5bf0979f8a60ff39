"""Train the initial states of the deeply mixed coders of effort high on meshes given on the command line.

    python tools/train_deep.py --output codec/meshtide_codec/compact/deep_states.npz MESH...

Meshes are coded and contexts averaged as in `train_geometry.py`, whose turns and coarsened shapes are coded here too.
Weights, final weights and corrections are means over the runs that moved them, weighted by the vertices of each: a few
hundred vertices move them little, and nowhere in particular. With --test MESH... the sizes of other meshes are
printed, as ratios to those of effort default.
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import numpy.typing as npt
from train_geometry import Gathered, octree_of, training_octrees

from meshtide_codec.compact.diff_coder import new_slice_state, write_diff
from meshtide_codec.compact.map_coder import write_map
from meshtide_codec.compact.mirror import find_mirror
from meshtide_codec.compact.models import (
    DeepModels,
    Models,
    new_map_models,
    trained_diff_models,
    untrained_deep_diff_models,
    untrained_deep_map_models,
)
from meshtide_codec.compact.slices import Slices
from meshtide_codec.entropy.codec import PayloadWriter
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.output_policy import output_file

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_codec.compact.octree import Octree

SomeModels = TypeVar("SomeModels", bound=Models)
ROUNDS = 8


class GatheredDeeply:
    """What the runs of one round have left; see `train_geometry.Gathered` for the contexts."""

    def __init__(self, models: DeepModels) -> None:
        self.models = models
        self._contexts = Gathered(Models(models.contexts, models.weights))
        self._moving = [models.weights, models.final_weights, models.corrections]
        self._sums = [np.zeros(len(array)) for array in self._moving]
        self._shares = [np.zeros(len(array)) for array in self._moving]

    def start(self) -> DeepModels:
        """States for a run."""
        start = self._contexts.start()
        return DeepModels(start.contexts, *(array.copy() for array in self._moving))

    def add(self, learnt: DeepModels, vertices: int) -> None:
        """Take in the states that a run over so many vertices has left."""
        self._contexts.add(Models(learnt.contexts, learnt.weights))
        after = [learnt.weights, learnt.final_weights, learnt.corrections]
        for place, (old, new) in enumerate(zip(self._moving, after, strict=True)):
            moved = new != old
            self._sums[place] += np.where(moved, float(vertices) * new, 0.0)
            self._shares[place] += np.where(moved, float(vertices), 0.0)

    def states(self) -> DeepModels:
        """The trained states after a round; what no run moved stays as it was."""
        means: list[npt.NDArray[np.int32]] = []
        for total, share, old in zip(self._sums, self._shares, self._moving, strict=True):
            mean = np.rint(total / np.maximum(share, 1.0)).astype(np.int32)
            means.append(np.where(share > 0.0, mean, old).astype(np.int32))
        return DeepModels(self._contexts.states().contexts, *means)


def code_diffs(octree: Octree, models: SomeModels) -> tuple[int, SomeModels]:
    """Bytes of all Diffs of a mesh, and what the models have become."""
    mirror = find_mirror(octree.positions, octree.bits)
    slices = Slices(octree.bits)
    state = new_slice_state(octree.levels[0], slices, 0, models)
    size = 0
    for depth in range(1, octree.bits + 1):
        writer = PayloadWriter()
        write_diff(writer, octree, depth, state, slices, 0, mirror)
        size += len(writer.payload())
    return size, state.models  # type: ignore[return-value]


def code_maps(octree: Octree, models: SomeModels) -> tuple[int, SomeModels]:
    """Bytes of all Maps of a mesh, and what the models have become."""
    mirror = find_mirror(octree.positions, octree.bits)
    size = 0
    for coarse, fine in pairwise(octree.levels):
        if not coarse.all_leaves:
            writer = PayloadWriter()
            write_map(writer, coarse, fine, octree.bits, models, mirror)
            size += len(writer.payload())
    return size, models


def train(
    octrees: list[Octree], models: DeepModels, code: Callable[[Octree, DeepModels], tuple[int, DeepModels]]
) -> DeepModels:
    """The states that a coder should begin with, from untrained ones."""
    for _ in range(ROUNDS):
        gathered = GatheredDeeply(models)
        for octree in octrees:
            _, learnt = code(octree, gathered.start())
            gathered.add(learnt, len(octree.positions))
        models = gathered.states()
    return models


def packed(coder: str, models: DeepModels) -> dict[str, npt.NDArray[np.generic]]:
    """The arrays of the states file for one coder."""
    return {
        f"{coder}_probabilities": (models.contexts >> 8).astype(np.uint16),
        f"{coder}_counts": (models.contexts & 255).astype(np.uint8),
        f"{coder}_weights": models.weights,
        f"{coder}_final_weights": models.final_weights,
        f"{coder}_corrections": models.corrections,
    }


def main() -> None:
    """Train, save, and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--test", nargs="*", type=Path, default=[])
    parser.add_argument("--output", type=Path, required=True)
    arguments = parser.parse_args()
    output_file(arguments.output, [*arguments.meshes, *arguments.test], overwrite=True)
    octrees = training_octrees([load_mesh(path) for path in arguments.meshes])
    map_models = train(octrees, untrained_deep_map_models(), code_maps)
    diff_models = train(octrees, untrained_deep_diff_models(), code_diffs)
    for path in arguments.test:
        octree = octree_of(load_mesh(path), 12)
        maps = code_maps(octree, map_models.copy())[0] / code_maps(octree, new_map_models())[0]
        diffs = code_diffs(octree, diff_models.copy())[0] / code_diffs(octree, trained_diff_models())[0]
        print(f"  {path.name:28} {len(octree.positions):6} vertices  map {maps:.4f}  diff {diffs:.4f}")
    np.savez_compressed(arguments.output, **packed("map", map_models), **packed("diff", diff_models))
    print(f"{arguments.output}: {arguments.output.stat().st_size} bytes")


if __name__ == "__main__":
    main()
