"""A catalogue of many meshes: python tests/bench/load/large_catalogue.py [--meshes 100000] [--postgresql].

A catalogue is generated, a server started on it, and asked for pages as a visitor would: the first, one from the
middle, searches that find much, little and nothing. Each is asked for several times; the row tells the slowest. Then
all pages are walked through, and the server's memory is compared with that of a server of an empty catalogue. With
--postgresql, the catalogue is in a PostgreSQL server that is started for it, else in a SQLite file.
"""

from __future__ import annotations

import argparse
import asyncio
import hashlib
import sys
import tempfile
import time
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path
from random import Random
from typing import Any

import httpx
from hosting import Row, meshtide_server
from sqlalchemy import insert, text

from meshtide_server.catalogue import Box, Catalogue, MeshRecord, Status
from meshtide_server.catalogue.meshes import _values, micros
from meshtide_server.catalogue.tables import mesh_table, tag_table

PAGE_SECONDS = 0.25
"""For what an index finds."""
SEARCH_SECONDS = 1.0
"""For what every mesh has to be looked at."""
MUST_MEBIBYTES = 32.0
TURNS = 7
BATCH = 2000
THINGS = ("vase", "bust", "tooth", "engine", "shoe", "skull", "bracket", "amphora", "rock", "valve")
TAGS = ("scan", "cad", "clay", "marble", "bone", "steel", "museum", "printed")
LICENCES = ("CC BY 4.0", "CC BY-SA 4.0", "CC0 1.0", "All rights reserved; ask the museum before you publish a picture")


def records(count: int) -> list[MeshRecord]:
    """Meshes that differ as those of a museum's catalogue do."""
    random = Random(1)
    start = datetime(2020, 1, 1, tzinfo=UTC)
    found = []
    for number in range(count):
        thing = random.choice(THINGS)
        x, y, z = (random.uniform(-10, 10) for _ in range(3))
        vertices = int(10 ** random.uniform(2, 7))
        found.append(
            MeshRecord(
                id=f"{thing}-{number:06d}",
                name=f"{thing.capitalize()} {number}.ply",
                tags=tuple(sorted(random.sample(TAGS, 3))),
                licence=random.choice(LICENCES),
                state=Status.READY if number % 100 else Status.FAILED,
                source=hashlib.sha256(str(number).encode()).hexdigest(),
                size=2 * vertices,
                vertices=vertices,
                faces=2 * vertices,
                levels=random.randint(3, 12),
                box=Box((x, y, z), (x + 1, y + 1, z + 1)),
                created=start + timedelta(minutes=number),
            )
        )
    return found


async def generate(url: str, count: int) -> None:
    """Fill the catalogue at `url`, many rows at a time."""
    catalogue = await Catalogue.open(url)
    meshes = records(count)
    for begin in range(0, count, BATCH):
        batch = meshes[begin : begin + BATCH]
        async with catalogue._database.writing() as connection:
            rows = [{**_values(mesh), "id": mesh.id, "created": micros(mesh.created)} for mesh in batch]
            await connection.execute(insert(mesh_table), rows)
            tags = [{"mesh_id": mesh.id, "tag": tag} for mesh in batch for tag in mesh.tags]
            await connection.execute(insert(tag_table), tags)
    async with catalogue._database.writing() as connection:
        await connection.execute(text("ANALYZE"))
    await catalogue.close()


def questions(count: int) -> dict[str, tuple[dict[str, Any], float]]:
    """What a visitor may ask for, and how long the answer may take."""
    hour = {"created_after": "2020-02-01T00:00:00Z", "created_before": "2020-02-01T01:00:00Z"}
    return {
        "first page": ({}, PAGE_SECONDS),
        "middle page": ({"after": "rock-050000"}, PAGE_SECONDS),
        "failed ones": ({"status": "failed"}, PAGE_SECONDS),
        "the largest": ({"fewest_vertices": 9_990_000}, SEARCH_SECONDS),
        "published in one hour": (hour, SEARCH_SECONDS),
        "a tag": ({"tag": "clay"}, SEARCH_SECONDS),
        "three tags": ({"tag": ["bone", "clay", "steel"]}, SEARCH_SECONDS),
        "a frequent word": ({"q": "vase"}, SEARCH_SECONDS),
        "one mesh by a word": ({"q": f"{count - 1}.ply"}, SEARCH_SECONDS),
        "a word that nothing has": ({"q": "xyzzy"}, SEARCH_SECONDS),
        "a licence that nothing has": ({"licence": "GPL"}, SEARCH_SECONDS),
        "in a small box": ({"box": "1,1,1,1.01,1.01,1.01"}, SEARCH_SECONDS),
    }


def measure(url: str, database: str, count: int) -> tuple[list[Row], float, float]:
    """Ask; returns rows, and the server's memory in MiB before and after all pages were walked through."""
    rows = []
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="meshtide-load-"))
        environment = {"MESHTIDE_DATABASE": url, "MESHTIDE_STORE": str(Path(folder) / "store")}
        started = time.perf_counter()
        server = stack.enter_context(meshtide_server("--rescan-seconds", 0, environment=environment))
        seconds = time.perf_counter() - started
        before = server.resident_bytes / 2**20
        client = stack.enter_context(httpx.Client(base_url=server.url, timeout=60))
        for what, (question, must) in questions(count).items():
            slowest, found = 0.0, 0
            for _ in range(TURNS):
                begun = time.perf_counter()
                answer = client.get("/meshes", params=question).raise_for_status()
                slowest = max(slowest, time.perf_counter() - begun)
                found = len(answer.json())
            details = {"meshes on the page": found, "turns": TURNS, "catalogue": database}
            rows.append(
                Row(
                    f"{what} of {count}",
                    1e3 * slowest,
                    "ms",
                    f"<= {1e3 * must:g} ms",
                    slowest <= must,
                    details,
                )
            )
        begun = time.perf_counter()
        tags = len(client.get("/tags").raise_for_status().json())
        told = time.perf_counter() - begun
        rows.append(
            Row(
                f"tags of {count}",
                1e3 * told,
                "ms",
                f"<= {1e3 * SEARCH_SECONDS:g} ms",
                told <= SEARCH_SECONDS,
                {"tags": tags, "catalogue": database},
            )
        )
        begun = time.perf_counter()
        walked, pages = walk(client)
        walking = time.perf_counter() - begun
        after = server.resident_bytes / 2**20
        rows.append(
            Row(
                f"all pages of {count}",
                walking,
                "s",
                f"{count} meshes",
                walked == count,
                {"pages": pages, "meshes": walked, "catalogue": database, "seconds to start": seconds},
            )
        )
    return rows, before, after


def walk(client: httpx.Client) -> tuple[int, int]:
    """Follow the pages to the end; returns how many meshes and pages there were."""
    meshes = pages = 0
    address = "/meshes?limit=1000"
    while True:
        answer = client.get(address).raise_for_status()
        meshes, pages = meshes + len(answer.json()), pages + 1
        if "next" not in answer.links:
            return meshes, pages
        address = answer.links["next"]["url"]


def main() -> int:
    """Read the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", type=int, default=100_000)
    parser.add_argument("--postgresql", action="store_true")
    arguments = parser.parse_args()
    with ExitStack() as stack:
        if arguments.postgresql:
            sys.path.insert(0, str(Path(__file__).parents[2]))
            from postgresql_server import running_postgresql

            url, database = stack.enter_context(running_postgresql()), "PostgreSQL"
        else:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="meshtide-load-"))
            url, database = f"sqlite:///{folder}/catalogue.db", "SQLite"
        _, empty, _ = measure(url, database, 0)
        asyncio.run(generate(url, arguments.meshes))
        rows, before, after = measure(url, database, arguments.meshes)
        more = after - empty
        rows.append(
            Row(
                f"memory that {arguments.meshes} meshes take",
                more,
                "MiB",
                f"<= {MUST_MEBIBYTES:g} MiB",
                more <= MUST_MEBIBYTES,
                {"empty catalogue": empty, "after the start": before, "after all pages": after, "catalogue": database},
            )
        )
        return max([row.show() for row in rows])


if __name__ == "__main__":
    sys.exit(main())
