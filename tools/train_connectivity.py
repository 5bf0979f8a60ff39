"""Train the connectivity coder's tables on given meshes and write them where the codec reads them.

    python tools/train_connectivity.py MESH [MESH ...]

Scores are fitted to the choices that the encoder meets at the gates of all levels: maximum likelihood of the right
apex among the candidates, by stochastic gradient descent, in rounds, because the scores decide which gates wait. The
contexts are those that the encoder ends with after it has coded all training levels with the fitted scores. Beside the
meshes, assemblies of boxes and cylinders are trained on, which have the borders and crowded edges that scans lack.
The table without positions is trained on levels that skip octree depths, as profile classic does; the one with
positions on every depth. The same meshes give the same tables.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).parent))

from connectivity_training_kernels import FEATURES, PLAIN_FEATURES, descend, record_level

from meshtide_codec.compact.octree import build_octree
from meshtide_codec.connectivity import codec, tables
from meshtide_codec.connectivity.coarse_kernels import build_coarse_mesh
from meshtide_codec.connectivity.decision_kernels import CONTEXTS
from meshtide_codec.connectivity.models import default_models
from meshtide_codec.connectivity.score_kernels import LOGISTIC_UNIT, SCORES
from meshtide_codec.connectivity.traversal_kernels import find_witnesses
from meshtide_codec.connectivity.truth_kernels import build_truth
from meshtide_codec.entropy.codec import PayloadWriter
from meshtide_codec.entropy.model_kernels import new_contexts
from meshtide_codec.entropy.range_coder_kernels import new_encoder
from meshtide_codec.mesh import Mesh, canonical_faces
from meshtide_codec.quantize import quantize

if TYPE_CHECKING:
    from numpy.typing import NDArray

ROUNDS = 3
RATES = (0.3, 0.15, 0.07, 0.03)
BITS = 12
MOST_ROWS = 6_000_000
CLASSIC_RATIO = 1.5  # vertices of a level over those of the next one that profile classic keeps
ASSEMBLIES = 1
PARTS = 80
SCORE_LIMIT = 32767  # scores are stored in 16 bits


class Case(NamedTuple):
    """A level to train on, as `write_faces` takes it."""

    faces: NDArray[np.int32]
    parents: NDArray[np.int32]
    coarse_faces: NDArray[np.int32]
    coarse_count: int
    positions: NDArray[np.int32] | None


def assembly(seed: int) -> trimesh.Trimesh:
    """Boxes and cylinders on a grid, some of them open, touching and sharing corners as parts of machines do."""
    random = np.random.default_rng(seed)
    parts = []
    for _ in range(PARTS):
        size = random.integers(1, 12, 3) / 64
        if random.random() < 0.5:
            part = trimesh.creation.box(extents=size)
            if random.random() < 0.3:
                part = part.subdivide()
        else:
            part = trimesh.creation.cylinder(radius=size[0] / 2, height=size[1], sections=int(random.integers(6, 40)))
            part.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, np.eye(3)[random.integers(3)]))
        if random.random() < 0.4:
            normals = part.face_normals
            part.update_faces(normals[:, random.integers(3)] < 0.9)
        part.apply_translation(random.integers(0, 40, 3) / 64)
        parts.append(part)
    return trimesh.util.concatenate(parts)


def cases(mesh: trimesh.Trimesh, *, geometric: bool) -> list[Case]:
    """The levels of a mesh, finest first, each with the next one that is kept."""
    quantized = quantize(Mesh(np.asarray(mesh.vertices, float), np.asarray(mesh.faces)), BITS)
    levels = build_octree(quantized.positions, quantized.faces, BITS).levels
    ratio = 1.0 if geometric else CLASSIC_RATIO
    result = []
    kept = levels[-1]
    parents = np.arange(kept.vertex_count, dtype=np.int32)
    for fine, coarse in zip(levels[:0:-1], levels[-2::-1], strict=True):
        parents = fine.parents[parents]
        if kept.vertex_count <= ratio * coarse.vertex_count or len(kept.faces) == 0:
            continue
        coarse_faces = canonical_faces(parents[kept.faces])
        positions = kept.centres if geometric else None
        result.append(Case(kept.faces, parents, coarse_faces, coarse.vertex_count, positions))
        kept = coarse
        parents = np.arange(kept.vertex_count, dtype=np.int32)
    return result


def fitted_scores(levels: list[Case], *, geometric: bool) -> NDArray[np.int16]:
    """Scores that make the right choices of all levels most likely."""
    features = np.empty((MOST_ROWS, FEATURES), np.int32)
    right = np.empty(MOST_ROWS, np.int8)
    ends = np.empty(MOST_ROWS // 2, np.int64)
    scores = np.zeros(SCORES)
    used_features = FEATURES if geometric else PLAIN_FEATURES
    for _ in range(ROUNDS):
        rows = choices = 0
        models = default_models(new_contexts(CONTEXTS), stored(scores).astype(np.int32))
        for case in levels:
            coarse = build_coarse_mesh(case.parents, case.coarse_faces, case.coarse_count)
            truth = build_truth(case.faces, len(case.parents))
            witnesses = find_witnesses(case.faces, case.parents, coarse)
            level = codec.new_level(coarse, truth, case.parents, len(case.faces), case.positions)
            level = level._replace(encoding=True)
            room = (features[rows:], right[rows:], ends[choices:])
            added = record_level(new_encoder(), np.zeros(1, np.uint8), models, level, witnesses, *room)
            ends[choices : choices + added] += rows
            choices += added
            rows = int(ends[choices - 1]) if choices else 0
        gradients = np.zeros(SCORES)
        for rate in RATES:
            cost = descend(features, right, ends[:choices], used_features, scores, gradients, rate)
        print(f"{choices} choices of {rows} candidates: {cost:.4f} bits each")
    return stored(scores)


def stored(scores: NDArray[np.float64]) -> NDArray[np.int16]:
    """Scores in the units of the codec."""
    return np.clip(np.rint(scores * LOGISTIC_UNIT), -SCORE_LIMIT, SCORE_LIMIT).astype(np.int16)


def learnt_contexts(levels: list[Case], scores: NDArray[np.int16]) -> NDArray[np.int32]:
    """The contexts after coding all levels one after the other, small ones first."""
    models = default_models(new_contexts(CONTEXTS), scores.astype(np.int32))
    for case in sorted(levels, key=lambda case: len(case.faces)):
        models.scores[:] = scores
        codec.write_faces(PayloadWriter(), *case, models)
    return models.contexts


def main() -> None:
    """Train both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", type=Path)
    paths: list[Path] = parser.parse_args().meshes
    meshes = [trimesh.load(path, process=False, force="mesh") for path in paths]
    meshes += [assembly(seed) for seed in range(ASSEMBLIES)]
    names = [path.name for path in paths] + [f"assembly {seed}" for seed in range(ASSEMBLIES)]
    for geometric in (False, True):
        levels = [case for mesh in meshes for case in cases(mesh, geometric=geometric)]
        scores = fitted_scores(levels, geometric=geometric)
        contexts = learnt_contexts(levels, scores)
        np.savez_compressed(
            tables.table_path(geometric=geometric),
            scores=scores,
            probabilities=(contexts >> 8).astype(np.uint16),
            counts=(contexts & 255).astype(np.uint8),
            meshes=np.array(names),
        )


if __name__ == "__main__":
    main()
