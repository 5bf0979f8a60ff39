"""Time of encoding and decoding in both profiles: python tests/bench/speed.py [--effort default --effort high].

Process time of this thread after one warming run, over several runs: minimum, median, maximum, in seconds; and
microseconds per vertex, which stay the same where the cost grows linearly.
"""

from __future__ import annotations

import argparse
import statistics
import time
from typing import TYPE_CHECKING, TypeVar

from large_meshes import wavy_torus

from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.filters import FilterSpec
from meshtide_codec.samples import load_sample

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_codec.mesh import Mesh

Result = TypeVar("Result")


def timed(work: Callable[[], Result], runs: int) -> tuple[Result, list[float]]:
    """The result of `work` and the thread's processor time of each run, sorted."""
    result = work()
    seconds = []
    for _ in range(runs):
        start = time.thread_time()
        result = work()
        seconds.append(time.thread_time() - start)
    return result, sorted(seconds)


def report(name: str, mesh: Mesh, options: ClassicOptions | CompactOptions, runs: int) -> None:
    """Print one mesh's line."""
    encoded, encoding = timed(lambda: encode(mesh, options), runs)
    data = encoded.to_bytes()
    _, decoding = timed(lambda: decode(data), runs)
    vertices = encoded.header.vertices
    for kind, seconds in (("encode", encoding), ("decode", decoding)):
        middle = statistics.median(seconds)
        print(
            f"{name:22} {vertices:8} vertices {kind} {seconds[0]:7.3f} {middle:7.3f} {seconds[-1]:7.3f} s"
            f" {1e6 * middle / vertices:6.2f} us/vertex"
        )


def main() -> None:
    """Time the bunny and the made meshes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=int, nargs="*", default=[10_000, 100_000, 1_000_000])
    parser.add_argument("--degree", type=int, default=3)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--effort", type=Effort, action="append", choices=list(Effort), help="may be repeated")
    arguments = parser.parse_args()
    spec = FilterSpec("polynomial", degree=arguments.degree)
    bunny = load_sample("stanford-bunny")
    report("bunny classic", bunny, ClassicOptions(filter=spec), arguments.runs)
    efforts = arguments.effort or [Effort.DEFAULT]
    for effort in efforts:
        report(f"bunny compact {effort}", bunny, CompactOptions(effort=effort), arguments.runs)
    for size in arguments.sizes:
        torus = wavy_torus(size)  # at 16 bits, since at 12 a million vertices would weld
        report("torus classic", torus, ClassicOptions(bits=16, filter=spec), arguments.runs)
        for effort in efforts:
            report(f"torus compact {effort}", torus, CompactOptions(bits=16, effort=effort), arguments.runs)


if __name__ == "__main__":
    main()
