"""Parts of the reference decoder that streams of the tests seldom reach, against the kernels."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshtide_codec.compact import quantizers, ring_kernels
from meshtide_codec.compact.cell_table_kernels import ABSENT, build_cell_table, find_cell
from meshtide_codec.connectivity import new_models, score_deep_kernels, score_kernels, shape_kernels
from meshtide_codec.entropy import codec, mixing_kernels, model_kernels, range_coder_kernels
from meshtide_codec.errors import MapConnError, PacketError
from meshtide_codec.mesh import canonical_faces
from meshtide_codec.reference import (
    class_tables,
    faces_candidates,
    faces_coarse,
    faces_deep,
    faces_properties,
    faces_scores,
    faces_shapes,
    mixing,
)
from meshtide_codec.reference.connectivity import decode_faces as reference_faces
from meshtide_codec.reference.faces_states import DeepFaceStates
from meshtide_codec.reference.mirror import CellTable
from meshtide_codec.reference.models import Contexts
from meshtide_codec.reference.octree import NOBODY, rings_of
from meshtide_codec.reference.range_decoder import RangeDecoder
from payloads import decode_faces, encode_faces

if TYPE_CHECKING:
    from types import ModuleType

    from numpy.typing import NDArray

    from meshtide_codec.connectivity.choice_kernels import Models


def test_tables_are_the_same() -> None:
    assert mixing_kernels.STRETCH.tolist() == mixing.STRETCH
    assert mixing_kernels.SQUASH.tolist() == mixing.SQUASH
    assert score_kernels.WEIGHTS.tolist() == faces_scores.WEIGHTS
    assert score_deep_kernels.WEIGHTS.tolist() == faces_deep.WEIGHTS
    assert score_deep_kernels.RATES.tolist() == faces_deep.RATES
    assert shape_kernels.ANGLE_CLASSES.tolist() == faces_shapes.ANGLE_CLASSES
    assert shape_kernels.LENGTH_CLASSES.tolist() == faces_shapes.LENGTH_CLASSES
    steps = [index / quantizers.STEPS for index in range(quantizers.LOGARITHM_ENTRIES)]
    assert [class_tables.error_class(step) for step in steps] == quantizers.half_octave_classes(24, 12).tolist()
    for count, twice_knee in ((4, 2), (10, 3), (16, 2)):
        classes = class_tables.SaturatingClasses(count, twice_knee)
        assert [classes(step) for step in steps[:512]] == quantizers.saturating_classes(count, twice_knee).tolist()


@pytest.mark.parametrize(
    "file",
    [
        "compact/geometry_states.npz",
        "compact/deep_states.npz",
        "connectivity/tables/deep.npz",
        "connectivity/tables/with_positions.npz",
        "connectivity/tables/without_positions.npz",
    ],
)
def test_the_document_describes_the_tables_that_are_shipped(file: str) -> None:
    document = (Path(__file__).parents[2] / "docs" / "format.md").read_text()
    with (resources.files("meshtide_codec") / file).open("rb") as opened, np.load(opened) as arrays:
        described = {name: array for name, array in arrays.items() if array.dtype.kind in "iu"}
    for name, array in described.items():
        checksum = zlib.crc32(array.astype(array.dtype.newbyteorder("<")).tobytes())
        assert f"| `{file}` | `{name}` | {len(array)} | {array.dtype} | {checksum:08x} |" in document


def test_integers() -> None:
    values = [0, 1, 2, 3, 77, 1 << 20, (1 << 31) - 1, -1, -5, -(1 << 31) + 1]

    def write(coder: range_coder_kernels.Coder, buffer: range_coder_kernels.Buffer) -> None:
        contexts = model_kernels.new_contexts(model_kernels.SIGNED_CONTEXTS)
        for value in values * 30:
            model_kernels.code_signed(coder, buffer, contexts, 0, value)
        range_coder_kernels.code_raw_bits(coder, buffer, 13, 4567)

    decoder = RangeDecoder(codec.encoded(write))
    contexts = Contexts.fresh(model_kernels.SIGNED_CONTEXTS)
    assert [contexts.signed(decoder, 0) for _ in range(30 * len(values))] == values * 30
    assert decoder.raw_bits(13) == 4567
    decoder.finish()


def test_an_integer_that_never_ends_is_refused() -> None:
    with pytest.raises(PacketError, match="longer than any encoder writes"):
        Contexts.fresh(model_kernels.SIGNED_CONTEXTS).signed(RangeDecoder(b""), 0)


def test_rings_of_tangled_faces() -> None:
    generator = np.random.default_rng(4)
    faces = canonical_faces(generator.integers(0, 30, (600, 3)).astype(np.int32))
    starts, members, closed = ring_kernels.order_rings(faces, 30)
    across = ring_kernels.find_across((starts, members, closed))
    rings = rings_of([(a, b, c) for a, b, c in faces.tolist()], 30)
    assert [member for ring in rings for member in ring.members] == members.tolist()
    assert [ring.closed for ring in rings] == closed.astype(bool).tolist()
    assert [place for ring in rings for place in ring.across] == across.tolist()
    assert max(len(ring.members) for ring in rings) > ring_kernels.RING_LIMIT
    assert any(place != NOBODY for ring in rings for place in ring.across)


def test_crowded_cell_tables_leave_out_the_same_cells() -> None:
    """Cells whose x and y scatter alike crowd the same places."""
    step = np.arange(1, 400)
    cells = np.stack([step * 4096, step * 0, step * 0], axis=1).astype(np.int32)
    table = build_cell_table(cells, np.ones(len(cells), np.uint8))
    expected = [find_cell(table, *cell) for cell in cells.tolist()]
    entries = [((x, y, z), place) for place, (x, y, z) in enumerate(cells.tolist())]
    reference = CellTable(entries)
    found = [reference.find(cell) for cell, _ in entries]
    assert [ABSENT if place is None else place for place in found] == expected
    assert ABSENT in expected


@dataclass(frozen=True)
class CodedFaces:
    """Faces of a level, coded."""

    faces: NDArray[np.int32]
    parents: NDArray[np.int32]
    positions: NDArray[np.int32] | None
    deeply: bool

    @cached_property
    def coarse_faces(self) -> NDArray[np.int32]:
        return canonical_faces(self.parents[self.faces])

    @cached_property
    def payload(self) -> bytes:
        coarse = self.coarse_faces, int(self.parents[-1]) + 1
        return encode_faces(self.faces, self.parents, *coarse, self.positions, self._models())

    def decoded(self) -> NDArray[np.int32]:
        coarse = self.coarse_faces, int(self.parents[-1]) + 1
        return decode_faces(self.payload, self.parents, *coarse, len(self.faces), self.positions, self._models())

    def decoded_by_the_reference(self) -> NDArray[np.int32]:
        found = reference_faces(
            RangeDecoder(self.payload),
            self.parents.tolist(),
            [(a, b, c) for a, b, c in self.coarse_faces.tolist()],
            int(self.parents[-1]) + 1,
            len(self.faces),
            None if self.positions is None else [(x, y, z) for x, y, z in self.positions.tolist()],
            DeepFaceStates() if self.deeply else None,
        )
        return np.array(found, np.int32)

    def _models(self) -> Models:
        return new_models(geometric=self.positions is not None, deep=self.deeply)


@pytest.mark.parametrize(("geometric", "deeply"), [(False, False), (True, False), (True, True)])
def test_faces_of_large_families(geometric: bool, deeply: bool) -> None:
    """Families beyond the lists' capacity, edges of many faces, and vertices of many half-edges.

    There are fewer faces where they are coded deeply: each gate measures 256 candidates there, in plain Python.
    """
    generator = np.random.default_rng(8)
    count = 700
    blades, pages, others = (12, 12, 2) if deeply else (100, 70, 20)
    fan = np.stack([np.zeros(blades), np.arange(1, blades + 1), np.arange(2, blades + 2)], axis=1)
    book = np.stack([np.full(pages, 5), np.full(pages, 600), np.arange(610, 610 + pages)], axis=1)
    loose = generator.integers(0, count, (others, 3))
    faces = canonical_faces(np.concatenate([fan, book, loose]).astype(np.int32))
    parents = np.sort(np.concatenate([[0, 1, 2], generator.integers(0, 3, count - 3)])).astype(np.int32)
    positions = generator.integers(0, 999, (count, 3)).astype(np.int32) if geometric else None
    coded = CodedFaces(faces, parents, positions, deeply)
    assert np.array_equal(coded.decoded(), faces)
    assert np.array_equal(coded.decoded_by_the_reference(), faces)


def coarse_book(*, deeply: bool) -> CodedFaces:
    """A coarse edge with 160 faces, both of whose ends split in two."""
    step = np.arange(160)
    faces = np.stack([step % 2, 2 + step // 2 % 2, 4 + step], axis=1)
    faces[::3] = faces[::3, [1, 0, 2]]
    across = np.array([[0, 1, 4 + page] for page in (159, 154, 149, 144)])
    faces = canonical_faces(np.concatenate([faces, across]).astype(np.int32))
    parents = np.concatenate([[0, 0, 1, 1], 2 + step]).astype(np.int32)
    positions = np.random.default_rng(3).integers(0, 99, (164, 3)).astype(np.int32)
    return CodedFaces(faces, parents, positions, deeply)


@pytest.mark.parametrize("deeply", [False, True])
def test_faces_over_an_edge_of_many_coarse_faces(deeply: bool) -> None:
    coded = coarse_book(deeply=deeply)
    assert np.array_equal(coded.decoded(), coded.faces)
    assert np.array_equal(coded.decoded_by_the_reference(), coded.faces)


@pytest.mark.parametrize(
    ("module", "limit"),
    [
        (faces_coarse, "EDGE_LIMIT"),
        (faces_candidates, "NEIGHBOUR_LIMIT"),
        (faces_properties, "FAMILY_SCAN_LIMIT"),
        (faces_properties, "SPHERE_LIMIT"),
    ],
)
def test_limits_of_what_is_looked_at_are_part_of_the_format(
    module: ModuleType, limit: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    coded = coarse_book(deeply=True)
    monkeypatch.setattr(module, limit, getattr(module, limit) - 1)
    with pytest.raises(MapConnError):
        coded.decoded_by_the_reference()
