"""Peak memory of decoding: python tests/bench/memory.py [--vertices 1000000] [--effort high].

A stream is encoded here and decoded in a process of its own, whose peak resident size is read from the operating
system (Linux); what an interpreter takes that has only loaded the decoder and its kernels is printed beside it.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from meshtide_codec.command_options import PROFILES, profile_options

DECODE = """
import sys
from pathlib import Path
from meshtide_codec.decoder import decode
from meshtide_codec.warm_up import warm_up
def peak():
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
warm_up()
loaded = peak()
mesh = decode(Path(sys.argv[1]).read_bytes())
print(loaded, peak(), mesh.vertices.nbytes + mesh.faces.nbytes)
"""
MEBIBYTE = 1 << 20
KIBIBYTE = 1 << 10  # what the operating system counts in


def main() -> None:
    """Encode, decode elsewhere, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--vertices", type=int, default=1_000_000)
    parser.add_argument("--profile", choices=PROFILES, default="compact")
    parser.add_argument("--effort", help="of profile compact: default or high")
    arguments = parser.parse_args()
    from large_meshes import wavy_torus

    from meshtide_codec.encoder import encode

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "torus.tide"
        options = profile_options(arguments.profile, 16, {"effort": arguments.effort}, {})
        path.write_bytes(encode(wavy_torus(arguments.vertices), options).to_bytes())
        output = subprocess.run(
            [sys.executable, "-c", DECODE, str(path)], stdout=subprocess.PIPE, text=True, check=True
        )
    loaded, peak, arrays = map(int, output.stdout.split())
    print(
        f"decoded arrays {arrays / MEBIBYTE:.0f} MiB; interpreter with kernels {loaded * KIBIBYTE / MEBIBYTE:.0f} MiB"
    )
    print(f"peak {peak * KIBIBYTE / MEBIBYTE:.0f} MiB = {peak * KIBIBYTE / arrays:.1f} x the arrays")
    encoder = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(f"peak of the encoding process {encoder * KIBIBYTE / MEBIBYTE:.0f} MiB")


if __name__ == "__main__":
    main()
