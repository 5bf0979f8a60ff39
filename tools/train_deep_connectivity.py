"""Train the tables that faces are coded deeply with, on meshes given on the command line.

    python tools/train_deep_connectivity.py MESH [MESH ...]

The states are what the coder has learnt after it has coded the levels of all meshes, in several random rotations each,
and of as many assemblies (see `train_connectivity.py`), twice, in random order. In the second round nothing counts as
known for sure, so that what the first round has seen by chance is forgotten. With --test MESH... the sizes of other
meshes' faces are printed, beside those of effort default. The same meshes give the same tables.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).parent))

from train_connectivity import Case, assembly, cases

from meshtide_codec.connectivity import codec, tables
from meshtide_codec.connectivity.models import untrained_deep_models
from meshtide_codec.entropy.codec import PayloadWriter

if TYPE_CHECKING:
    from meshtide_codec.connectivity.choice_kernels import Models

ROTATIONS = 8
ROUNDS = 2
SECOND_ROUND_COUNT = 32


def rotated(mesh: trimesh.Trimesh, random: np.random.Generator) -> trimesh.Trimesh:
    """A mesh in another attitude."""
    turned = mesh.copy()
    turned.apply_transform(trimesh.transformations.random_rotation_matrix(random.random(3)))
    return turned


def training_cases(meshes: list[trimesh.Trimesh], rotations: int) -> list[list[Case]]:
    """The levels of each mesh in each attitude, the first as it is, and of the assemblies; finest level first."""
    random = np.random.default_rng(5)
    result = []
    for mesh in meshes:
        attitudes = [mesh] + [rotated(mesh, random) for _ in range(rotations - 1)]
        result += [cases(attitude, geometric=True) for attitude in attitudes]
    return result + [cases(assembly(seed), geometric=True) for seed in range(rotations)]


def size_of_faces(models: Models, levels: list[Case]) -> int:
    """Bytes of all faces of a mesh, coarse to fine; the models learn from them."""
    return sum(_size(case, models) for case in reversed(levels))


def _size(case: Case, models: Models | None = None) -> int:
    """Bytes of the faces of a level."""
    writer = PayloadWriter()
    codec.write_faces(writer, *case, models)
    return len(writer.payload())


def trained(meshes: list[list[Case]]) -> Models:
    """Models that have coded all meshes."""
    models = untrained_deep_models(tables.new_models(geometric=True))
    random = np.random.default_rng(1)
    for _ in range(ROUNDS):
        models.table.counts[:] = np.minimum(models.table.counts, SECOND_ROUND_COUNT)
        total = sum(size_of_faces(models, meshes[index]) for index in random.permutation(len(meshes)))
        print(f"{total} bytes")
    return models


def default_size(levels: list[Case]) -> int:
    """Bytes of all faces of a mesh at effort default."""
    return sum(_size(case) for case in levels)


def save(models: Models, names: list[str]) -> None:
    """Write the tables where the codec reads them."""
    contexts, weights, final_weights, corrections = models.questions.mixer
    contexts = contexts[: len(contexts) // 2]  # the fast ones begin as the slow ones do
    np.savez_compressed(
        tables.deep_table_path(),
        scores=models.table.scores,
        score_counts=models.table.counts.astype(np.uint8),
        probabilities=(contexts >> 8).astype(np.uint16),
        counts=np.minimum(contexts & 255, tables.DEEP_PRIOR_LIMIT).astype(np.uint8),
        weights=weights,
        final_weights=final_weights,
        corrections=corrections,
        meshes=np.array(names),
    )


def loaded(path: Path) -> trimesh.Trimesh:
    """A mesh file as it is."""
    return trimesh.load(path, process=False, force="mesh")


def main() -> None:
    """Train, save, and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path)
    parser.add_argument("--test", nargs="*", type=Path, default=[])
    parser.add_argument("--rotations", type=int, default=ROTATIONS)
    arguments = parser.parse_args()
    paths: list[Path] = arguments.meshes
    models = trained(training_cases([loaded(path) for path in paths], arguments.rotations))
    save(models, [path.name for path in paths] + [f"assembly {seed}" for seed in range(arguments.rotations)])
    tables._trained_deeply.cache_clear()  # noqa: SLF001 - the file has just been written anew
    print(f"{tables.deep_table_path()}: {tables.deep_table_path().stat().st_size} bytes")
    for path in arguments.test:
        levels = cases(loaded(path), geometric=True)
        default = default_size(levels)
        high = size_of_faces(tables.new_models(geometric=True, deep=True), levels)
        print(f"  {path.name:28} {default:6} {high:6} bytes  {high / default:.4f}")


if __name__ == "__main__":
    main()
