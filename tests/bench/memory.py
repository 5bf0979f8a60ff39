"""Peak memory of encoding and decoding: python tests/bench/memory.py [--vertices 1000000] [--effort high].

Each is done in a process of its own (Linux), in which everything is loaded and the input stands in memory; then the
operating system is told to forget the highest resident size so far, and asked for it afterwards. What goes beyond the
interpreter, the core with its trained states, and the input is what the work takes; what it returns counts.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from meshtide_codec.command_options import PROFILES, profile_options
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import encode
from meshtide_codec.mesh import Mesh
from meshtide_codec.quantize import quantize

MEBIBYTE = 1 << 20
BITS = 16  # at 12 a million vertices would weld


@dataclass(frozen=True)
class Work:
    """What one process took.

    Args:
        beyond: bytes at the peak beyond interpreter, core and input.
        seconds: of processor time.
        size: bytes of the stream.
    """

    beyond: int
    seconds: float
    size: int


def resident(name: str) -> int:
    """Bytes that the operating system tells of this process: VmRSS now, VmHWM at most."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name)) << 10


def measure(what: str, folder: Path, vertices: int, profile: str, effort: str | None) -> Work:
    """Encode into, or decode from, the stream of a folder; what it takes here, and whether it is exact."""
    from large_meshes import wavy_torus

    stream, options = folder / "torus.tide", profile_options(profile, BITS, {"effort": effort}, {})
    triangle = Mesh.checked([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    decode(encode(triangle, options).to_bytes())  # loads what there is to load
    mesh = wavy_torus(vertices) if what == "encode" else None
    data = b"" if mesh is not None else stream.read_bytes()
    Path("/proc/self/clear_refs").write_text("5")  # VmHWM starts anew
    before, start = resident("VmRSS"), time.process_time()
    if mesh is not None:
        encoded = encode(mesh, options)
        work = Work(resident("VmHWM") - before, time.process_time() - start, len(encoded.to_bytes()))
        stream.write_bytes(encoded.to_bytes())
        return work
    decoded = decode(data)
    work = Work(resident("VmHWM") - before, time.process_time() - start, len(data))
    expected = quantize(wavy_torus(vertices), BITS).mesh()
    if not (np.array_equal(decoded.vertices, expected.vertices) and np.array_equal(decoded.faces, expected.faces)):
        raise AssertionError("the decoded mesh is another one")
    return work


def both(vertices: int, profile: str = "compact", effort: str | None = None) -> tuple[Work, Work]:
    """What encoding and decoding a made mesh takes, each in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        works = []
        for what in ("encode", "decode"):
            command = [sys.executable, __file__, "--only", what, folder, "--vertices", str(vertices)]
            command += ["--profile", profile, *(["--effort", effort] if effort else [])]
            output = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout.split()
            works.append(Work(int(output[0]), float(output[1]), int(output[2])))
        return works[0], works[1]


def main() -> None:
    """Encode, decode, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", type=int, default=1_000_000)
    parser.add_argument("--profile", choices=PROFILES, default="compact")
    parser.add_argument("--effort", help="of profile compact: default or high")
    parser.add_argument("--only", nargs=2, metavar=("WHAT", "FOLDER"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.only:
        what, folder = arguments.only
        work = measure(what, Path(folder), arguments.vertices, arguments.profile, arguments.effort)
        print(work.beyond, work.seconds, work.size)
        return
    for name, work in zip(
        ("encode", "decode"), both(arguments.vertices, arguments.profile, arguments.effort), strict=True
    ):
        beyond = work.beyond / MEBIBYTE
        print(
            f"{name} {arguments.vertices} vertices: {beyond:.0f} MiB beyond interpreter, core and input "
            f"({work.beyond / arguments.vertices:.0f} bytes a vertex), {work.seconds:.1f} s; {work.size} bytes, exact"
        )


if __name__ == "__main__":
    main()
