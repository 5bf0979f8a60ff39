import tempfile
from contextlib import suppress
from pathlib import Path

import httpx
from hypothesis import given
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from meshtide_codec.stream.session import ClientSession
from meshtide_server.hosting.file_names import folders_of, without_folders
from meshtide_server.settings import Settings

from ..conftest import running
from ..http.routes.test_ingest import finished, post, settings_for
from ..made_streams import make_stream

PARTS = st.sampled_from(["meshes", "a b", "scan.obj", "ü", "x"])


@given(st.lists(PARTS, min_size=1, max_size=3), st.lists(PARTS, max_size=3), st.text(max_size=20))
def test_no_text_tells_where_a_folder_lies(folder: list[str], place: list[str], words: str) -> None:
    path = Path("/srv", *folder)
    text = f"{words.replace('/', '')} {path.joinpath(*place)}: cannot be read"
    assert str(path) not in without_folders(text, [path])
    assert without_folders(f"{path}/a/b.obj: no", [path]) == "a/b.obj: no"


def test_folders_are_those_of_the_settings_however_they_are_written(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    settings = Settings(directory=tmp_path / "link", data=tmp_path / "data", store="s3://bucket/a")
    folders = folders_of(settings)
    assert {tmp_path / "real", tmp_path / "data", Path(tempfile.gettempdir())} <= set(folders)
    assert without_folders(f"{tmp_path}/link/a.obj", [tmp_path / "link"]) == "a.obj"
    assert without_folders(f"{tmp_path}/real/a.obj", [tmp_path / "link"]) == "a.obj"
    assert without_folders("GET /meshes lists them", folders) == "GET /meshes lists them"


def test_no_answer_tells_where_the_server_keeps_its_files(tmp_path: Path) -> None:
    secret = tmp_path / "secret-place"
    folder, data = secret / "meshes", secret / "data"
    (folder / "sub").mkdir(parents=True)
    for suffix in ("obj", "ply", "off", "stl", "glb", "tide"):
        (folder / "sub" / f"bad-{suffix}.{suffix}").write_bytes(b"\x00 nothing that anybody reads \xff")
        (folder / f"empty-{suffix}.{suffix}").touch()
    (folder / "gone.tide").write_bytes(make_stream())
    (folder / "other.tide").write_bytes(make_stream(1))
    answers: list[str] = []

    def note(answer: httpx.Response) -> httpx.Response:
        answers.append(f"{answer.status_code} {answer.headers} {answer.text}")
        return answer

    with running(settings_for(folder, data, recursive=True, rescan_seconds=0)) as live, httpx.Client() as client:
        (folder / "gone.tide").unlink()
        (folder / "other.tide").write_bytes(make_stream(2))
        jobs = [
            note(post(live.url, f"up-{suffix}.{suffix}", b"\x00 no mesh \xff")).json()["id"]
            for suffix in ("obj", "ply", "off", "stl", "glb", "tide")
        ]
        for job in jobs:
            assert finished(live.url, job)["state"] == "failed"
            note(client.get(f"{live.url}/jobs/{job}"))
            note(client.get(f"{live.url}/jobs/{job}/events"))
        meshes = note(client.get(f"{live.url}/meshes?limit=1000")).json()
        assert sum(mesh["status"] == "failed" for mesh in meshes) == 18
        for mesh in (*meshes, {"id": "none"}):
            for view in ("", ".tide", "/header"):
                note(client.get(f"{live.url}/meshes/{mesh['id']}{view}"))
            with connect(f"{live.socket_url}/meshes/{mesh['id']}/stream") as websocket:
                with suppress(ConnectionClosed):
                    websocket.send(ClientSession(mesh["id"]).hello())
                    while True:
                        answers.append(repr(websocket.recv(10.0)))
                answers.append(repr(websocket.protocol.close_rcvd))
        for path in ("/packets/x", "/jobs/none", "/nothing", "/readyz", "/meshes?after=%00"):
            note(client.get(live.url + path))
    assert len(answers) > 100
    assert sum("409" in answer for answer in answers) >= 50
    for answer in answers:
        assert "secret-place" not in answer
        assert tempfile.gettempdir() + "/" not in answer
