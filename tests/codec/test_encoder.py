from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.errors import OptionError
from meshtide_codec.mesh import Mesh
from meshtide_codec.packets import PacketKind
from meshtide_codec.profile import Profile
from meshtide_codec.stream.container import read_container
from meshtide_codec.testing import grid
from streams import encoded_grid


def test_packets_stand_in_the_order_of_tables_1_and_2() -> None:
    encoded = encode(grid(16), ClassicOptions(bits=8, coarsest_vertices=12, variable_from=2))
    coarsest = encoded.header.levels[0].level
    assert coarsest >= 3
    expected = [(PacketKind.BASE, coarsest)]
    for level in range(coarsest - 1, -1, -1):
        expected += [(PacketKind.MAP_CONN, level), (PacketKind.PARAM, level)]
        if level != 1:
            expected.append((PacketKind.DIFF, level))
    assert [(packet.kind, packet.level) for packet in encoded.packets] == expected


def test_the_file_holds_the_packets() -> None:
    encoded = encoded_grid()
    header, packets = read_container(encoded.to_bytes())
    assert header == encoded.header
    assert list(packets) == list(encoded.packets)


@pytest.mark.parametrize("options", [None, ClassicOptions()])
def test_progress_goes_from_nothing_to_all(options: ClassicOptions | None) -> None:
    stages: list[tuple[str, float]] = []
    encode(grid(16), options, progress=lambda stage, fraction: stages.append((stage, fraction)))
    assert stages[0] == ("quantize", 0.0)
    assert stages[-1] == ("distances", 1.0)
    levels = [fraction for stage, fraction in stages if stage == "levels"]
    assert levels == sorted(levels)


def test_parameters_of_a_filter_take_four_bytes_each() -> None:
    encoded = encoded_grid(degree=2)
    sizes = {len(packet.payload) for packet in encoded.packets if packet.kind is PacketKind.PARAM}
    assert sizes == {4 * 3 * 3}


def test_levels_that_there_are_not() -> None:
    with pytest.raises(OptionError, match="predicted levels"):
        encode(grid(5), ClassicOptions(sent_levels=frozenset({9})))


ENCODE_ALL = (
    "import sys, hashlib; sys.path.insert(0, sys.argv[1])\nfrom test_encoder import digests\nprint(*digests())\n"
)


def digests() -> list[str]:
    """Of streams of both profiles, previews, slices and a plane of symmetry included."""
    options = [CompactOptions(bits=10), CompactOptions(bits=12, slices=3), ClassicOptions(bits=10)]
    return [hashlib.sha256(encode(grid(48), each).to_bytes()).hexdigest() for each in options]


@pytest.mark.parametrize("options", [CompactOptions(), ClassicOptions()], ids=["compact", "classic"])
def test_bytes_do_not_depend_on_the_number_of_threads(options: CompactOptions | ClassicOptions) -> None:
    mesh = grid(60)  # large enough for previews
    assert encode(mesh, options, threads=1).to_bytes() == encode(mesh, options, threads=3).to_bytes()
    with pytest.raises(OptionError, match="at least one thread, not 0"):
        encode(mesh, options, threads=0)


def test_encoding_is_the_same_again_and_in_threads_beside_each_other() -> None:
    once = digests()
    assert digests() == once
    with ThreadPoolExecutor(4) as pool:
        assert all(found == once for found in pool.map(lambda _: digests(), range(6)))


def test_encoding_is_the_same_in_other_processes_with_other_threads_and_hashes() -> None:
    tests = Path(__file__).parent
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", ENCODE_ALL, str(tests)],
            env=os.environ
            | {"PYTHONPATH": str(tests.parent), "PYTHONHASHSEED": seed}
            | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), threads),
            stdout=subprocess.PIPE,
            text=True,
        )
        for seed, threads in (("1", "1"), ("2", "2"))
    ]
    found = [process.communicate()[0].split() for process in processes]
    assert [process.returncode for process in processes] == [0, 0]
    assert found[0] == found[1] == digests()


PROFILES = [CompactOptions(bits=4), CompactOptions(4, effort=Effort.HIGH), ClassicOptions(bits=4)]


def check_exact(mesh: Mesh, options: Profile) -> None:
    encoded = encode(mesh, options)
    decoded, expected = decode(encoded.to_bytes()), encoded.quantized.mesh()
    assert np.array_equal(decoded.vertices, expected.vertices)
    assert np.array_equal(decoded.faces, expected.faces)


@pytest.mark.parametrize("options", PROFILES)
@pytest.mark.parametrize("bits", [4, 8, 12])
def test_a_gate_whose_only_candidate_is_not_its_apex(options: Profile, bits: int) -> None:
    along = np.array([0.0, 5.0, 8.0, 12.0, 15.0])
    mesh = Mesh.checked(np.stack([0 * along, 0 * along, along], axis=1), [[0, 2, 4], [0, 3, 2]])
    check_exact(mesh, replace(options, bits=bits))


@given(st.integers(0, 2**32 - 1), st.sampled_from(PROFILES))
@settings(max_examples=200, deadline=None)
def test_few_points_with_any_faces_among_them_survive(seed: int, options: Profile) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 14))
    faces = rng.integers(0, count, (int(rng.integers(0, 30)), 3))
    faces = np.concatenate([faces, faces[rng.random(len(faces)) < 0.3][:, ::-1], faces[:1, [1, 2, 0]]])
    faces = faces[(faces != faces[:, [1, 2, 0]]).all(axis=1)]
    check_exact(Mesh.checked(rng.integers(0, 16, (count, 3)).astype(float), faces), options)


@pytest.mark.parametrize("options", PROFILES)
def test_diffs_that_take_no_byte_are_sent(options: Profile) -> None:
    points = [
        [[1, 4, 0], [1, 5, 0], [0, 6, 0], [1, 6, 0], [2, 5, 0], [3, 4, 0], [7, 0, 0], [7, 1, 0], [7, 1, 5], [6, 2, 5]],
        [[6, 3, 5], [15, 2, 5], [15, 3, 5]],
    ]
    mesh = Mesh.checked(np.array(points[0] + points[1], float), np.zeros((0, 3), np.int64))
    check_exact(mesh, options)
    encoded = encode(mesh, options)
    if isinstance(options, CompactOptions):
        assert [len(packet.payload) for packet in encoded.packets if packet.kind is PacketKind.DIFF]
