"""This checkout beside an earlier one: python tests/bench/load/before_and_now.py --before FOLDER --python PROGRAM.

FOLDER is a checkout whose core has been built, PROGRAM the Python of an environment with what that checkout needs:

    git worktree add FOLDER COMMIT && python -m venv ENV && ENV/bin/pip install -e FOLDER

Three loads, each for a few seconds in every round, the two checkouts in turns, so that whatever else the machine does
meets both: packets over bare HTTP, asked for by wrk; the same through nginx with docker/nginx.conf, out of its cache;
whole streams over websockets. Ratios are taken within a round. The table holds their medians, and the exit code is 1
if one misses its bound. Each checkout hosts the bunny as its own codec encodes it; rates are requests a second over
HTTP, where packets are asked for in turn, and streams a second over websockets.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import httpx
import uvloop
from hosting import MESH, Process, UnavailableError, allow_descriptors, meshtide_server
from websocket_client import hello, open_clients
from websocket_throughput import PATH, measure

sys.path.insert(0, str(Path(__file__).parents[2]))

from nginx_proxy import behind_nginx

FINISHED = 1000
"""The close code of a stream that has all been sent."""
BOUNDS = {"bare HTTP": 1 / 3, "through nginx with its cache": 0.9, "websocket streams": 0.95}
"""What must be left of the earlier checkout's rate; through nginx, of its bare HTTP."""
_ROOT = Path(__file__).parents[3]
_ENCODE = """
import sys
from meshtide_codec.encoder import encode
from meshtide_codec.samples import load_sample
open(sys.argv[1], "wb").write(encode(load_sample("stanford-bunny")).to_bytes())
"""
_ASK = """
local requests = {{}}
for path in string.gmatch("{paths}", "%S+") do
    requests[#requests + 1] = "GET " .. path .. " HTTP/1.1\\r\\nHost: {host}\\r\\n\\r\\n"
end
local turn = 0
function request()
    turn = turn % #requests + 1
    return requests[turn]
end
"""
"""What wrk asks for."""


@dataclass(frozen=True)
class Side:
    """A checkout that is measured, and its server."""

    server: Process
    paths: tuple[str, ...]
    digest: bytes


def hosted(root: Path, python: str, folder: Path, stack: ExitStack) -> Side:
    """Have the checkout at `root` encode the bunny into `folder` and host it."""
    environment = {"PYTHONPATH": os.pathsep.join(str(root / part) for part in ("codec", "server", "client"))}
    file = folder / f"{MESH}.tide"
    subprocess.run([python, "-c", _ENCODE, str(file)], env={**os.environ, **environment}, check=True)
    server = stack.enter_context(meshtide_server(folder, "--rescan-seconds", 0, environment=environment, python=python))
    packets = httpx.get(f"{server.url}/meshes/{MESH}").raise_for_status().json()["packets"]
    paths = tuple(f"/packets/{row['sha256']}" for row in packets)
    return Side(server, paths, uvloop.run(digest_of_frames(server)))


async def digest_of_frames(server: Process) -> bytes:
    """SHA-256 of what one stream sends; every other one has to send the same."""
    (client,) = await open_clients(server.host, server.port, PATH, 1, hello(MESH))
    code = await client.ended
    if code != FINISHED:
        raise ConnectionError(f"the stream ended with code {code}")
    client.abort()
    return client.digest


def requests_a_second(url: str, paths: tuple[str, ...], seconds: int, connections: int) -> float:
    """Have wrk ask for all of `paths` in turn."""
    with tempfile.NamedTemporaryFile("w", suffix=".lua") as script:
        script.write(_ASK.format(paths=" ".join(paths), host=url.removeprefix("http://")))
        script.flush()
        command = ["wrk", "-t1", f"-c{connections}", f"-d{seconds}s", "-s", script.name, url]
        told = subprocess.run(command, capture_output=True, text=True, check=True, timeout=seconds + 60).stdout
    found = re.search(r"Requests/sec:\s+([0-9.]+)", told)
    if found is None or "Non-2xx" in told or "Socket errors" in told:
        raise UnavailableError(f"wrk tells of errors:\n{told}")
    return float(found[1])


def streams_a_second(side: Side, seconds: float, clients: int) -> float:
    """Have clients take the whole stream over and over."""
    return uvloop.run(measure(side.server, side.digest, clients, seconds))[1]


def one_round(before: Side, now: Side, proxy: str, arguments: argparse.Namespace) -> dict[str, tuple[float, float]]:
    """Rates of the earlier checkout and of this one, by what is measured."""

    def http(url: str, side: Side) -> float:
        return requests_a_second(url, side.paths, arguments.seconds, arguments.connections)

    bare_before = http(before.server.url, before)
    bare_now = http(now.server.url, now)
    cached = http(proxy, now)
    streams_before = streams_a_second(before, arguments.seconds, arguments.clients)
    streams_now = streams_a_second(now, arguments.seconds, arguments.clients)
    pairs = ((bare_before, bare_now), (bare_before, cached), (streams_before, streams_now))
    return dict(zip(BOUNDS, pairs, strict=True))


def show(rounds: list[dict[str, tuple[float, float]]]) -> int:
    """Print the table; returns the exit code."""
    missed = 0
    print("| what | before, /s | now, /s | now / before | in single rounds | must | holds |")
    print("|---|---|---|---|---|---|---|")
    for what, bound in BOUNDS.items():
        pairs = [each[what] for each in rounds]
        ratios = sorted(now / before for before, now in pairs)
        rates = " | ".join(f"{median(rates):.0f}" for rates in zip(*pairs, strict=True))
        held = median(ratios) >= bound
        missed += not held
        spread = f"{ratios[0]:.0%} to {ratios[-1]:.0%}"
        print(f"| {what} | {rates} | {median(ratios):.0%} | {spread} | >= {bound:.0%} | {'yes' if held else 'NO'} |")
    return 1 if missed else 0


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", type=Path, required=True, help="a checkout")
    parser.add_argument("--python", required=True, help="that runs it")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=int, default=3, help="of each load in each round")
    parser.add_argument("--connections", type=int, default=32, help="that wrk keeps open")
    parser.add_argument("--clients", type=int, default=20, help="that stream at once")
    arguments = parser.parse_args()
    for program in ("wrk", "nginx"):
        if shutil.which(program, path=f"{os.environ['PATH']}:/usr/sbin") is None:
            raise UnavailableError(f"{program} is not installed; apt-get install wrk nginx-light")
    allow_descriptors(4 * (arguments.clients + arguments.connections) + 200)
    with ExitStack() as stack:
        folders = [
            Path(stack.enter_context(tempfile.TemporaryDirectory(prefix=f"meshtide-{name}-")))
            for name in ("before", "now", "nginx")
        ]
        before = hosted(arguments.before.resolve(), arguments.python, folders[0], stack)
        now = hosted(_ROOT, sys.executable, folders[1], stack)
        proxy = stack.enter_context(behind_nginx([now.server.url], folders[2]))
        for path in now.paths:  # from now on they are in its cache
            httpx.get(proxy + path).raise_for_status()
        return show([one_round(before, now, proxy, arguments) for _ in range(arguments.rounds)])


if __name__ == "__main__":
    try:
        sys.exit(main())
    except UnavailableError as error:
        sys.exit(f"not measured: {error}")
