"""A chosen grid: borders of tiles agree to the bit, steps have the length asked for, what does not fit is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import encode
from meshtide_codec.errors import MeshError, OptionError
from meshtide_codec.grid import Grid
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import quantize
from meshtide_codec.stream.container import read_container
from meshtide_codec.testing import grid, tetrahedron


@pytest.mark.parametrize("options", [CompactOptions(bits=11), ClassicOptions(bits=11)], ids=["compact", "classic"])
def test_tiles_of_one_grid_have_the_same_border_to_the_bit(options: CompactOptions | ClassicOptions) -> None:
    whole = grid(13)
    moved = Mesh(whole.vertices * 0.1 + [1000.3, -7.7, 3.1], whole.faces)
    chosen = Grid(origin=(1000.1, -8.0, 2.7), extent=2.1)
    left = (moved.vertices[moved.faces][:, :, 0] <= moved.vertices[6 * 13, 0]).all(axis=1)
    streams = [encode(moved.with_faces(part).referenced(), options, grid=chosen).to_bytes() for part in (left, ~left)]
    rows = [set(map(bytes, decode(stream).vertices)) for stream in streams]
    assert len(rows[0] & rows[1]) == 13
    headers = [read_container(stream)[0] for stream in streams]
    assert all(header.origin == (1000.1, -8.0, 2.7) and header.extent == 2.1 for header in headers)


@given(st.floats(1e-3, 1e3), st.floats(1.1, 1e5), st.tuples(*3 * [st.floats(-1e3, 1e3)]))
@settings(max_examples=60, deadline=None)
def test_steps_have_the_length_that_is_asked_for(step: float, steps: float, origin: tuple[float, float, float]) -> None:
    span = step * max(steps, 7.5)
    mesh = Mesh.checked(np.array(origin) + span * np.array([[0, 0, 0], [1, 0, 0], [0.3, 0.9, 0.1]]), [[0, 1, 2]])
    placed = Grid(step=step).placed(mesh, bits=12)
    assert placed.extent is not None
    assert placed.extent / ((1 << placed.bits) - 1) == pytest.approx(step, rel=3e-16)
    assert placed.bits == 4 or step * ((1 << (placed.bits - 1)) - 1) < span * (1 + 1e-9)
    quantized = quantize(mesh, *placed)
    assert np.abs(quantized.mesh().vertices[quantized.permutation] - mesh.vertices).max() <= step * 0.5000001 + 1e-12


def test_a_step_decides_about_b_and_tiles_with_the_same_one_agree() -> None:
    encoded = encode(grid(20), grid=Grid(step=0.01))
    assert encoded.header.bits == 11
    assert encoded.header.extent == 0.01 * 2047
    with_extent = Grid(origin=(-1.0, -1.0, -3.0), extent=100.0, step=0.01)
    assert {with_extent.placed(mesh, 12)[2] for mesh in (grid(20), tetrahedron())} == {163.83}


@pytest.mark.parametrize(("step", "bits"), [(1e-7, 20), (4.0, 4)])
def test_a_step_that_takes_too_many_or_too_few_bits_is_refused_with_one_that_would_do(step: float, bits: int) -> None:
    with pytest.raises(OptionError, match=r"a step of [0-9.e+-]+ would do") as caught:
        encode(grid(20), grid=Grid(step=step))
    proposed = float(str(caught.value).split("a step of ")[1].split()[0])
    assert Grid(step=proposed).placed(grid(20), 12).bits == bits


@pytest.mark.parametrize("chosen", [Grid(origin=(0.5, 0.0, 0.0)), Grid(origin=(0.0, 0.0, 0.0), extent=0.75)])
def test_a_vertex_outside_is_named_with_its_place(chosen: Grid) -> None:
    with pytest.raises(MeshError, match=r"vertex [01] at \([01], 0, 0\) lies outside of the grid, which reaches from"):
        encode(tetrahedron(), grid=chosen)


def test_a_vertex_outside_by_rounding_only_is_on_the_border() -> None:
    mesh = Mesh.checked([[0, 0, 0], [math.nextafter(1.0, 2.0), 0, 0], [0, -1e-12, 0.5]], [[0, 1, 2]])
    quantized = quantize(mesh, 8, np.zeros(3), 1.0)
    assert quantized.positions.min() == 0
    assert quantized.positions.max() == 255


@pytest.mark.parametrize(
    "arguments",
    [{"origin": (0.0, math.nan, 0.0)}, {"extent": 0.0}, {"extent": math.inf}, {"step": -1.0}, {"step": math.nan}],
    ids=str,
)
def test_numbers_that_describe_no_grid_are_refused(arguments: dict[str, float]) -> None:
    with pytest.raises(OptionError, match="the grid's"):
        Grid(**arguments)  # type: ignore[arg-type]
