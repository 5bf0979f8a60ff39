"""Exactness of every mesh in a folder: python tests/bench/round_trips.py FOLDER [--degrees 0 1 3].

Each triangle mesh is encoded in the compact profile and with each filter of the classic one (degree 0 is the zeroth
order filter), put into a folder that a real server process hosts, and fetched over a websocket; the finest level must
equal the quantized, welded input. Prints a table of bits per vertex and ends with exit code 1 if anything differs.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

from meshtide_client.fetching import fetch
from meshtide_client.server_process import running_server
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.files import is_mesh_path, load_mesh
from meshtide_codec.filters import FilterSpec
from meshtide_codec.rates import stream_report


def filter_of_degree(degree: int) -> FilterSpec:
    """The zeroth order filter, or the least squares filter of that degree."""
    return FilterSpec("polynomial", degree=degree) if degree else FilterSpec("zeroth")


def encode_folder(folder: Path, degrees: list[int], hosted: Path) -> dict[str, EncodedMesh]:
    """Encode each mesh of `folder` into `hosted`; returns the streams by the names of their files."""
    streams = {}
    for path in sorted(path for path in folder.iterdir() if is_mesh_path(path)):
        mesh = load_mesh(path)
        variants = {"compact": None} | {
            f"degree-{degree}": ClassicOptions(filter=filter_of_degree(degree)) for degree in degrees
        }
        for variant, options in variants.items():
            name = f"{path.stem.lower()}-{variant}"
            streams[name] = encode(mesh, options)
            (hosted / f"{name}.tide").write_bytes(streams[name].to_bytes())
    return streams


def main() -> int:
    """Encode, serve, fetch, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--degrees", type=int, nargs="*", default=[0, 1, 3])
    arguments = parser.parse_args()
    different = 0
    with tempfile.TemporaryDirectory() as hosted:
        streams = encode_folder(arguments.folder, arguments.degrees, Path(hosted))
        print(f"{'mesh and filter':32} {'vertices':>8} {'faces':>8} {'Map&Conn':>9} {'Diff':>7} {'file':>7}  exact")
        with running_server([hosted]) as url:
            for name, encoded in streams.items():
                fetched = fetch(f"{url}/meshes/{name}").mesh
                expected = encoded.quantized.mesh()
                same = np.array_equal(fetched.vertices, expected.vertices)
                same = same and np.array_equal(fetched.faces, expected.faces)
                different += not same
                report = stream_report(encoded.header, len(encoded.header.to_bytes()))
                rates = report["bits_per_vertex_by_kind"]
                print(
                    f"{name:32} {report['vertices']:8} {report['faces']:8} {rates.get('Map&Conn', 0.0):9.2f}"
                    f" {rates.get('Diff', 0.0):7.2f} {report['bits_per_vertex']:7.2f}  {'yes' if same else 'NO'}"
                )
    print(f"{len(streams)} streams over the websocket, {different} different")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
