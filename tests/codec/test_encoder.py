from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from meshes import grid
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.encoder import encode
from meshtide_codec.errors import OptionError
from meshtide_codec.stream.container import read_container
from meshtide_codec.stream.packets import PacketKind
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
            | dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), threads),
            stdout=subprocess.PIPE,
            text=True,
        )
        for seed, threads in (("1", "1"), ("2", "2"))
    ]
    found = [process.communicate()[0].split() for process in processes]
    assert [process.returncode for process in processes] == [0, 0]
    assert found[0] == found[1] == digests()
