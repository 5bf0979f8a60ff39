"""`meshtide ingest` without a server: into a folder and SQLite, and into a bucket and PostgreSQL."""

from __future__ import annotations

import json
import shutil
import signal
import sqlite3
import time
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from bulk_ingests import BITS, PROFILE, expected_stream, kept, kept_in, small_meshes
from meshtide_codec.command_line import ExitCode
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid
from postgresql_server import running_postgresql
from s3_server import BUCKET, running_s3_server
from upload_server import taking_uploads

if TYPE_CHECKING:
    from pathlib import Path

HOW = ("--bits", str(BITS), "--profile", PROFILE)


def ready_meshes(database: Path) -> int:
    """How many meshes a SQLite catalogue shows, which may not be there yet."""
    try:
        with sqlite3.connect(f"file:{database}?mode=ro", uri=True) as connection:
            return int(connection.execute("SELECT count(*) FROM mesh WHERE state = 'ready'").fetchone()[0])
    except sqlite3.OperationalError:
        return 0


def test_a_folder_is_ingested_interrupted_gone_on_with_and_served(tmp_path: Path, meshtide: Any) -> None:
    files = small_meshes(tmp_path / "scans", 30)
    expected = {file.stem: expected_stream(file) for file in files}
    target = tmp_path / "kept"
    command = ("ingest", tmp_path / "scans", "--data", target, "--workers", "2", *HOW, "--json")
    with meshtide.start(*command) as process:
        deadline = time.monotonic() + 60
        while ready_meshes(target / "catalogue.db") < 3 and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        try:
            output, errors = process.communicate(timeout=60)
        finally:
            process.kill()
    assert (process.returncode, output) == (ExitCode.INTERRUPTED, ""), errors
    assert errors.strip().splitlines()[-1] == "meshtide: interrupted"
    before = kept_in(target)
    assert 3 <= len(before.meshes) < len(files)
    assert before.streams == {mesh_id: expected[mesh_id] for mesh_id in before.meshes}
    assert list((target / "store" / ".parts").iterdir()) == []

    (tmp_path / "scans" / "deep").mkdir()
    save_mesh(grid(4), tmp_path / "scans" / "deep" / "patch-000.ply")
    shutil.copy(files[0], tmp_path / "scans" / "deep" / "renamed.ply")
    (tmp_path / "scans" / "bad.obj").write_text("no mesh")
    ran = meshtide(*command)
    answer = json.loads(ran.stdout)
    assert ran.returncode == ExitCode.FAILURE
    done = len(files) - len(before.meshes) + 1
    assert (answer["done"], answer["kept"], answer["failed"]) == (done, len(before.meshes) + 1, 1)
    after = kept_in(target)
    states = {row["file"].removeprefix(f"{tmp_path}/scans/"): (row["mesh"], row["state"]) for row in answer["files"]}
    twins = {states["patch-000.ply"][0], states["deep/renamed.ply"][0]}
    assert len(twins) == 1
    assert states["deep/patch-000.ply"][0] not in twins
    assert states["bad.obj"] == (None, "failed")
    assert len(after.meshes) == len(files) + 1
    deep = expected_stream(tmp_path / "scans" / "deep" / "patch-000.ply")
    assert sorted(after.streams.values()) == sorted([*expected.values(), deep])
    with taking_uploads(MESHTIDE_DATA=str(target)) as (url, _):
        deadline = time.monotonic() + 20
        while len(rows := httpx.get(f"{url}/meshes").json()) < len(after.meshes):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        assert {row["status"] for row in rows} == {"ready"}
        assert httpx.get(f"{url}/meshes/patch-007.tide").content == expected["patch-007"]


def test_a_bucket_and_postgresql_take_what_a_folder_takes(
    tmp_path: Path, meshtide: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("obstore")
    files = small_meshes(tmp_path / "scans", 6)
    (tmp_path / "seaweedfs").mkdir()
    with running_s3_server(tmp_path / "seaweedfs") as endpoint, running_postgresql() as database:
        monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_REGION"):
            monkeypatch.setenv(name, "us-east-1")
        store = f"s3://{BUCKET}/published"
        command = ("ingest", tmp_path / "scans", "--store", store, *HOW)
        ran = meshtide(*command, "--database", database)
        assert (ran.returncode, ran.stdout) == (0, "6 ingested, 0 there before, 0 failed\n"), ran.stderr
        found = kept(store, database)
        assert found.streams == {file.stem: expected_stream(file) for file in files}
        assert found.keys == found.expected_keys
        save_mesh(grid(4), files[0])
        monkeypatch.setenv("MESHTIDE_DATABASE", database.replace("meshtide@", "meshtide:any-password@"))
        ran = meshtide(*command, "--replace", "--json")
        answer = json.loads(ran.stdout)
        assert (answer["store"], answer["done"], answer["kept"]) == (store, 6, 0), ran.stderr
        found = kept(store, database)
        assert found.streams == {file.stem: expected_stream(file) for file in files}
        assert "any-password" not in ran.stdout + ran.stderr


def test_it_has_to_be_told_where_to(tmp_path: Path, meshtide: Any) -> None:
    small_meshes(tmp_path / "scans", 1)
    for options in ((), ("--server", "http://127.0.0.1:9", "--workers", "2")):
        ran = meshtide("ingest", tmp_path / "scans", *options)
        assert ran.returncode == ExitCode.USAGE
        assert "say where to: --server, or --data, or --store and --database" in ran.stderr
    ran = meshtide(
        "ingest",
        tmp_path / "scans",
        "--data",
        tmp_path / "kept",
        "--distributed",
        "tcp://127.0.0.1:9",
        "--timeout",
        "0.5",
    )
    assert ran.returncode == ExitCode.NETWORK
    assert "there is no Dask scheduler at tcp://127.0.0.1:9" in ran.stderr
