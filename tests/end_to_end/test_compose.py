"""What docker/compose.yml sets, tried on real processes: there is no container engine where the tests run.

The secrets are made by its program, the S3 server, the bucket and the database are made by its commands, a server gets
its environment, and nginx its configuration. Names of services become addresses of this machine, and paths within
containers become folders of the test.
"""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import asyncpg
import httpx
import pytest

from docker_files import image_environment, secret_maker, service
from nginx_proxy import behind_nginx, wait_for
from postgresql_server import program, running_postgresql
from s3_server import free_port, weed

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

OBJECT = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@contextmanager
def s3_of_compose(folder: Path, secrets: Path) -> Iterator[dict[str, int]]:
    """The S3 server by the command of compose, with its bucket; yields its ports."""
    ports = {name: free_port() for name in ("master", "volume", "filer", "s3")}
    metrics = free_port()
    places = {
        "-dir=/data": f"-dir={folder}",
        "-ip=s3": "-ip=127.0.0.1",
        "-ip.bind=0.0.0.0": "-ip.bind=127.0.0.1",
        "-s3.port=8333": f"-s3.port={ports['s3']}",
        "-metricsPort=9327": f"-metricsPort={metrics}",
        "-s3.config=/run/secrets/s3_identities": f"-s3.config={secrets / 's3_identities'}",
    }
    told = service("s3")
    program, *flags = told["entrypoint"]
    assert program == "weed"
    assert places.keys() <= set(told["command"])
    command = [weed(), *flags, *(places.get(word, word) for word in told["command"])]
    command += [f"-{name}.port={ports[name]}" for name in ("master", "volume", "filer")]
    with (folder / "log").open("wb") as log, subprocess.Popen(command, stdout=log, stderr=log, cwd=folder) as process:
        try:
            health = told["healthcheck"]["test"][-1].replace(":8333/", f":{ports['s3']}/")
            wait_for(health, process)
            make_bucket(ports["master"])
            make_bucket(ports["master"])  # once more, as at every start
            assert "SeaweedFS" in httpx.get(f"http://127.0.0.1:{metrics}/metrics").text
            yield ports
        finally:
            process.kill()


def make_bucket(master: int) -> None:
    told = service("bucket")
    script = told["command"][0].replace("s3:9333", f"127.0.0.1:{master}").replace("weed ", f"{weed()} ")
    done = subprocess.run([*told["entrypoint"], script], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@contextmanager
def serving(told: dict[str, str]) -> Iterator[str]:
    """The URL of a server that is told `told`."""
    command = [sys.executable, "-m", "meshtide_server", "--port", "0", "--announce"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MESHTIDE_", "AWS_"))}
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment | told) as process:
        try:
            assert process.stdout is not None
            yield json.loads(process.stdout.readline())["url"]
        finally:
            process.terminate()


async def make_database(url: str) -> None:
    """What PostgreSQL's image does with POSTGRES_DB."""
    connection = await asyncpg.connect(url)
    await connection.execute(f"CREATE DATABASE {service('database')['environment']['POSTGRES_DB']}")
    await connection.close()


def server_environment(tmp_path: Path, secrets: Path, s3_port: int, database_port: int) -> dict[str, str]:
    """What a server in a container is told, with the places of this machine."""
    told = {name: value for name, value in image_environment().items() if name.startswith("MESHTIDE_")}
    told |= service("meshtide")["environment"]
    address = (secrets / "database").read_text()
    (secrets / "database").write_text(address.replace("@database/", f"@127.0.0.1:{database_port}/"))
    for name, value in told.items():
        if value.startswith("/run/secrets/"):
            told[name] = str(secrets / value.removeprefix("/run/secrets/"))
    for name in ("meshes", "cache"):
        (tmp_path / name).mkdir()
    told["AWS_ENDPOINT_URL"] = told["AWS_ENDPOINT_URL"].replace("s3:8333", f"127.0.0.1:{s3_port}")
    told |= {"MESHTIDE_DIRECTORY": str(tmp_path / "meshes"), "MESHTIDE_CACHE": str(tmp_path / "cache")}
    return told | {"MESHTIDE_HOST": "127.0.0.1", "MESHTIDE_TRUSTED_PROXIES": "127.0.0.0/8"}


def test_what_compose_sets_makes_a_catalogue(tmp_path: Path) -> None:
    pytest.importorskip("obstore", reason="the extra s3 is not installed")
    secrets = tmp_path / "secrets"
    secret_maker().make(secrets)
    password = (secrets / "postgres_password").read_text().strip()
    (tmp_path / "s3").mkdir()
    (tmp_path / "nginx").mkdir()
    with ExitStack() as stack:
        arguments = service("database")["environment"]["POSTGRES_INITDB_ARGS"].split()
        database = stack.enter_context(running_postgresql(password, arguments))
        asyncio.run(make_database(database))
        ports = stack.enter_context(s3_of_compose(tmp_path / "s3", secrets))
        told = server_environment(tmp_path, secrets, ports["s3"], urlsplit(database).port or 0)
        assert not {"MESHTIDE_DATABASE", "AWS_SECRET_ACCESS_KEY"} & told.keys()  # secrets are in files only
        servers = [stack.enter_context(serving(told)) for _ in range(2)]
        for url in servers:
            wait_for(f"{url}/readyz")
        proxy = stack.enter_context(behind_nginx(servers, tmp_path / "nginx"))
        token = {"Authorization": f"Bearer {(secrets / 'write_tokens').read_text().strip()}"}
        assert httpx.put(f"{proxy}/meshes/a", params={"filename": "a.obj"}, content=OBJECT).status_code == 401
        answer = httpx.put(
            f"{proxy}/meshes/a", params={"filename": "a.obj", "tag": "clay"}, content=OBJECT, headers=token
        )
        assert answer.status_code == 202, answer.text
        await_job(proxy, answer.json()["id"])
        (listed,) = httpx.get(f"{proxy}/meshes", params={"tag": "clay"}).json()
        assert (listed["id"], listed["status"], listed["vertices"]) == ("a", "ready", 4)
        streams = {httpx.get(f"{url}/meshes/a.tide").content for url in servers}
        assert {len(stream) for stream in streams} == {listed["bytes"]}
        packed = httpx.get(f"{proxy}/meshes/a", headers={"Accept-Encoding": "gzip"})
        assert packed.headers["content-encoding"] == "gzip"
        held = {"If-None-Match": packed.headers["etag"], "Accept-Encoding": "gzip"}
        assert httpx.get(f"{proxy}/meshes/a", headers=held).status_code == 304
        plain = httpx.get(f"{proxy}/meshes/a.tide", headers={"Accept-Encoding": "gzip"})
        assert ("content-encoding" in plain.headers, plain.content in streams) == (False, True)
        for hidden in ("/metrics", "/readyz"):
            assert httpx.get(proxy + hidden).status_code == 404
        assert "meshtide_store_read_bytes_total" in httpx.get(f"{servers[0]}/metrics").text
        restored = restored_backup(tmp_path / "backup", told, database)
        with serving(restored) as url:
            assert httpx.get(f"{url}/meshes/a.tide").content in streams


def restored_backup(folder: Path, told: dict[str, str], database: str) -> dict[str, str]:
    """What a server is told that shows the backup, made and put back as docker/README.md says."""
    folder.mkdir()
    name = service("database")["environment"]["POSTGRES_DB"]
    source, target = (database.replace("/postgres", f"/{each}") for each in (name, "restored"))
    dump = [program("pg_dump"), "--format=custom", f"--file={folder / 'catalogue.dump'}", source]
    subprocess.run(dump, check=True, timeout=60)
    copy = [sys.executable, "-m", "meshtide_client.main", "copy-store", told["MESHTIDE_STORE"], str(folder / "store")]
    subprocess.run(copy, check=True, timeout=60, env=os.environ | told)
    subprocess.run([program("createdb"), f"--maintenance-db={database}", "restored"], check=True, timeout=60)
    restore = [program("pg_restore"), "--clean", "--if-exists", f"--dbname={target}", str(folder / "catalogue.dump")]
    subprocess.run(restore, check=True, timeout=60)
    environment = {each: value for each, value in told.items() if each != "MESHTIDE_DATABASE_FILE"}
    return environment | {"MESHTIDE_STORE": str(folder / "store"), "MESHTIDE_DATABASE": target}


def await_job(url: str, job: str) -> None:
    deadline = time.monotonic() + 90
    while (state := httpx.get(f"{url}/jobs/{job}").json())["state"] != "done":
        assert state["state"] != "failed", state
        assert time.monotonic() < deadline
        time.sleep(0.1)
