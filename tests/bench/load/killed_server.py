"""Kill -9 during uploads and encodes: python tests/bench/load/killed_server.py [--uploads 100]; about two minutes.

Uploads small meshes to a server, kills it in the middle, starts it again, uploads the rest, and waits until all jobs
have ended. Every upload that was acknowledged has to be there, and exact; every object in the store has to be whole.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import Event
from typing import Any

import httpx
import numpy as np
from hosting import Row

sys.path.insert(0, str(Path(__file__).parents[2]))

from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import encode
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid
from upload_server import TOKEN, taking_uploads

BITS = 8
SIZES = 20
DEADLINE_SECONDS = 240


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--uploads", type=int, default=100)
    count = parser.parse_args().uploads
    with tempfile.TemporaryDirectory(prefix="meshtide-load-") as name:
        folder = Path(name)
        acknowledged: dict[str, int] = {}
        half = Event()
        upload = partial(_upload, folder=folder, acknowledged=acknowledged, half=half, enough=count // 2)
        for size in range(5, 5 + SIZES):
            save_mesh(grid(size), folder / f"patch-{size}.ply")
        data = str(folder / "data")
        with taking_uploads(MESHTIDE_DATA=data) as (url, process), ThreadPoolExecutor(8) as pool:
            waiting = [pool.submit(upload, url, turn) for turn in range(count)]
            half.wait(DEADLINE_SECONDS)
            process.kill()
            process.wait()
            for future in waiting:
                future.result()
        before = dict(acknowledged)
        started = time.monotonic()
        with taking_uploads(MESHTIDE_DATA=data) as (url, _):
            for turn in range(count):
                if f"mesh-{turn}" not in before:
                    upload(url, turn)
            states = _final_states(url, acknowledged)
            seconds = time.monotonic() - started
            ready = {mesh: size for mesh, size in acknowledged.items() if states.get(mesh) == "ready"}
            exact = sum(_is_exact(url, mesh, size) for mesh, size in ready.items())
        streams = list((folder / "data" / "store" / "streams").glob("*"))
        whole = sum(hashlib.sha256(path.read_bytes()).hexdigest() == path.stem for path in streams)
    details = {"acknowledged before the kill": len(before), "exact": exact, "seconds after the restart": seconds}
    details |= {"objects": len(streams), "whole objects": whole}
    met = exact == len(acknowledged) == count and whole == len(streams) and 0 < len(before) < count
    row = Row("uploads through a kill -9", float(exact), f"of {count}", "all that were acknowledged", met, details)
    return row.show()


def _upload(url: str, turn: int, *, folder: Path, acknowledged: dict[str, int], half: Event, enough: int) -> None:
    size = 5 + turn % SIZES
    params: dict[str, Any] = {"filename": f"patch-{size}.ply", "bits": BITS}
    headers = {"Authorization": f"Bearer {TOKEN}"}
    data = (folder / f"patch-{size}.ply").read_bytes()
    try:
        answer = httpx.put(f"{url}/meshes/mesh-{turn}", params=params, content=data, headers=headers)
    except httpx.TransportError:
        return  # it was not acknowledged
    if answer.status_code == httpx.codes.ACCEPTED:
        acknowledged[f"mesh-{turn}"] = size
    if len(acknowledged) >= enough:
        half.set()


def _final_states(url: str, wanted: dict[str, int]) -> dict[str, str]:
    deadline = time.monotonic() + DEADLINE_SECONDS
    while True:
        states = {row["id"]: row["status"] for row in httpx.get(f"{url}/meshes", params={"limit": 1000}).json()}
        if all(states.get(mesh) == "ready" for mesh in wanted) or time.monotonic() > deadline:
            return states
        time.sleep(0.5)


def _is_exact(url: str, mesh: str, size: int) -> bool:
    decoded = decode(httpx.get(f"{url}/meshes/{mesh}.tide").content)
    expected = encode(grid(size), CompactOptions(bits=BITS)).quantized.mesh()
    return np.array_equal(decoded.vertices, expected.vertices) and np.array_equal(decoded.faces, expected.faces)


if __name__ == "__main__":
    sys.exit(main())
