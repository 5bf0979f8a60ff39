"""Exactness of meshes through files and through server and client: python tests/bench/round_trips.py FOLDER.

Each triangle mesh is encoded in the compact profile, at each effort asked for, and with each filter of the classic one
(degree 0 is the zeroth order filter), at each B. The file is decoded; and it is put into a folder that a real server
process hosts, and fetched over a websocket. Both times the finest level must equal the quantized, welded input. Prints
a table of bits per vertex and ends with exit code 1 if anything differs. Random soups of triangles and large made
meshes go the same way, in the compact profile alone. All that meshtide promises to be exact:

    python tests/bench/round_trips.py FOLDER --bits 10 --bits 12 --bits 14 --effort default --effort high \\
        --degrees --soups 200 --large 1000000
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from large_meshes import fractal_terrain, wavy_torus
from soups import random_soup

from meshtide_client.commands.server_process import running_server
from meshtide_client.download.fetch import fetch
from meshtide_client.remote.listing import list_meshes
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.effort import Effort
from meshtide_codec.encoder import encode
from meshtide_codec.filters import FilterSpec
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import is_mesh_path, load_mesh
from meshtide_codec.profile import Profile
from meshtide_codec.rates import stream_report

READY_SECONDS = 600.0
"""How long a server may take to look at all streams of its folder."""
HEAD = f"{'stream':36} {'vertices':>8} {'faces':>8} {'Map&Conn':>9} {'Diff':>7} {'file':>7}  exact: file, fetched"


@dataclass(frozen=True, slots=True)
class Variant:
    """A way of encoding, and its name."""

    name: str
    options: Profile


@dataclass(frozen=True, slots=True)
class Source:
    """A mesh, made or read when it is its turn, and how it is to be encoded."""

    name: str
    load: Callable[[], Mesh]
    variants: Sequence[Variant]


@dataclass(frozen=True, slots=True)
class Stream:
    """An encoded mesh: what is told of it, what its finest level must be, and whether its file decodes to that."""

    source: str
    variant: str
    report: dict[str, Any]
    expected: str
    file_exact: bool


def digest(mesh: Mesh) -> str:
    """SHA-256 of vertices and faces, bit by bit."""
    made = hashlib.sha256(np.ascontiguousarray(mesh.vertices, dtype="<f8").tobytes())
    made.update(np.ascontiguousarray(mesh.faces, dtype="<i8").tobytes())
    return made.hexdigest()


def compact_variants(bits: Sequence[int], efforts: Sequence[Effort]) -> list[Variant]:
    """The compact profile at each B and effort."""
    return [
        Variant(f"compact-{effort}-b{each}", CompactOptions(bits=each, effort=effort))
        for each in bits
        for effort in efforts
    ]


def classic_variants(bits: Sequence[int], degrees: Sequence[int]) -> list[Variant]:
    """The classic profile at each B, with the filter of each degree."""
    return [
        Variant(f"degree-{degree}-b{each}", ClassicOptions(bits=each, filter=filter_of_degree(degree)))
        for each in bits
        for degree in degrees
    ]


def filter_of_degree(degree: int) -> FilterSpec:
    """The zeroth order filter, or the least squares filter of that degree."""
    return FilterSpec("polynomial", degree=degree) if degree else FilterSpec("zeroth")


def encoded_into(folder: Path, source: Source) -> Iterator[tuple[Path, Stream]]:
    """The mesh in all its variants, each in a file of `folder`."""
    mesh = source.load()
    for variant in source.variants:
        encoded = encode(mesh, variant.options)
        expected = digest(encoded.quantized.mesh())
        path = folder / f"stream-{sum(1 for _ in folder.iterdir())}.tide"
        path.write_bytes(encoded.to_bytes())
        report = stream_report(encoded.header, len(encoded.header.to_bytes()))
        exact = digest(decode(path.read_bytes())) == expected
        yield path, Stream(source.name, variant.name, report, expected, exact)


def round_trips(sources: Sequence[Source]) -> Iterator[tuple[Stream, bool]]:
    """Every stream of the sources, and whether what a server sends of it is exact."""
    with tempfile.TemporaryDirectory() as place:
        hosted = Path(place)
        streams = {path.stem: stream for source in sources for path, stream in encoded_into(hosted, source)}
        with running_server([place, "--rescan-seconds", "0"]) as url:
            wait_until_ready(url, len(streams))
            for name, stream in streams.items():
                yield stream, digest(fetch(f"{url}/meshes/{name}").mesh) == stream.expected


def wait_until_ready(url: str, count: int) -> None:
    """Nothing, once the server shows so many meshes.

    Raises:
        TimeoutError: it does not for too long.
    """
    deadline = time.monotonic() + READY_SECONDS
    while sum(mesh.status == "ready" for mesh in list_meshes(url)) < count:
        if time.monotonic() > deadline:
            raise TimeoutError(f"the server shows less than {count} meshes after {READY_SECONDS:g} s")
        time.sleep(0.1)


class Table:
    """Prints a line for each stream, and counts those that differ."""

    def __init__(self) -> None:
        self.streams = 0
        self.different = 0
        print(HEAD)

    def add(self, stream: Stream, *, fetched_exact: bool) -> None:
        """Print the line of one stream."""
        rates = stream.report["bits_per_vertex_by_kind"]
        self._line(
            f"{stream.source}-{stream.variant}",
            (stream.report["vertices"], stream.report["faces"]),
            (rates.get("Map&Conn", 0.0), rates.get("Diff", 0.0), stream.report["bits_per_vertex"]),
            (stream.file_exact, fetched_exact),
        )

    def add_together(self, name: str, streams: Sequence[tuple[Stream, bool]]) -> None:
        """Print a line for each variant of many small meshes: sums, and rates over all of them."""
        for variant in dict.fromkeys(stream.variant for stream, _ in streams):
            own = [(stream, fetched) for stream, fetched in streams if stream.variant == variant]
            reports = [stream.report for stream, _ in own]
            vertices = sum(report["vertices"] for report in reports)
            sizes = [
                sum(report["bytes_by_kind"].get("Map&Conn", 0) for report in reports),
                sum(report["bytes_by_kind"].get("Diff", 0) for report in reports),
                sum(report["bytes"] for report in reports),
            ]
            self._line(
                f"{len(own)} {name}-{variant}",
                (vertices, sum(report["faces"] for report in reports)),
                [8 * size / vertices for size in sizes],
                (all(stream.file_exact for stream, _ in own), all(fetched for _, fetched in own)),
                count=len(own),
                different=sum(not (stream.file_exact and fetched) for stream, fetched in own),
            )

    def _line(
        self,
        name: str,
        counts: Sequence[int],
        rates: Sequence[float],
        exact: tuple[bool, bool],
        *,
        count: int = 1,
        different: int | None = None,
    ) -> None:
        self.streams += count
        self.different += (not all(exact)) if different is None else different
        words = ", ".join("yes" if each else "NO" for each in exact)
        figures = f"{rates[0]:9.2f} {rates[1]:7.2f} {rates[2]:7.2f}"
        print(f"{name:36} {counts[0]:8} {counts[1]:8} {figures}  {words}", flush=True)


def arguments_given() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path, nargs="*", help="mesh files and folders of them")
    parser.add_argument("--bits", type=int, action="append", help="B; may be repeated; default: 12")
    parser.add_argument("--effort", type=Effort, action="append", choices=list(Effort), help="may be repeated")
    parser.add_argument(
        "--degrees", type=int, nargs="*", default=[0, 1, 3], help="of classic filters; none: no classic"
    )
    parser.add_argument("--soups", type=int, default=0, help="so many random soups")
    parser.add_argument("--large", type=int, action="append", default=[], help="made meshes of so many vertices")
    return parser.parse_args()


def main() -> int:
    """Encode, decode, serve, fetch, compare, print."""
    arguments = arguments_given()
    bits = arguments.bits or [12]
    compact = compact_variants(bits, arguments.effort or [Effort.DEFAULT])
    files = [
        file
        for path in arguments.meshes
        for file in (sorted(path.iterdir()) if path.is_dir() else [path])
        if is_mesh_path(file)
    ]
    both = [*compact, *classic_variants(bits, arguments.degrees)]
    sources = [Source(file.stem.lower(), partial(load_mesh, file), both) for file in files]
    for size in arguments.large:
        sources.append(Source(f"torus-{size}", partial(wavy_torus, size), compact))
        sources.append(Source(f"terrain-{size}", partial(fractal_terrain, size), compact))
    table = Table()
    for source in sources:
        for stream, fetched in round_trips([source]):
            table.add(stream, fetched_exact=fetched)
    soups = [Source("soups", partial(random_soup, seed), compact) for seed in range(arguments.soups)]
    if soups:
        table.add_together("soups", list(round_trips(soups)))
    print(f"{table.streams} streams through files and over the websocket, {table.different} different")
    return 1 if table.different else 0


if __name__ == "__main__":
    sys.exit(main())
