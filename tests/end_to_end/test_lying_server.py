"""`meshtide fetch` against a server in a process of its own that does not keep to its word."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest

from meshtide_codec.command_line import ExitCode
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.stream.container import preamble

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

LIAR = '''
"""A websocket server of one file that says Done, or what else it is told, after some packets."""
import sys
from websockets.sync.server import serve
from meshtide_codec.stream.container import ContainerReader
from meshtide_codec.stream.messages import Done, Hello, PacketPart, decode_message, encode_message
from meshtide_codec.stream.session import ServerSession, error_frame

lie, packets = sys.argv[1], int(sys.argv[2])
whole = open(sys.argv[3], "rb").read()
reader = ContainerReader()
reader.feed(whole)


def framed(due):
    if isinstance(due, bytes):
        return due
    return due.frame(reader.packets[due.index].payload[due.start : due.end])


def handle(socket):
    hello = decode_message(socket.recv())
    honest = ServerSession(hello.mesh, reader.header, reader.header_bytes)
    honest.receive(encode_message(hello))
    frames = [framed(honest.next()) for _ in range(1 + packets)]
    for frame in frames:
        socket.send(frame)
    if lie == "done":
        socket.send(encode_message(Done(len(reader.header.packets), len(whole), False)))
    elif lie == "repeat":
        socket.send(frames[-1])
    elif lie == "silence":
        socket.recv(timeout=60)
    elif lie == "words":
        socket.send(error_frame("gone", "\\x1b]0;owned\\x07\\x1b[2J\\u202eall is well\\nmeshtide: done"))


with serve(handle, "127.0.0.1", 0, compression=None) as server:
    print(server.socket.getsockname()[1], flush=True)
    server.serve_forever()
'''


@contextmanager
def lying(folder: Path, lie: str, packets: int, stream: Path) -> Iterator[str]:
    """The address of the mesh of such a server."""
    program = folder / "liar.py"
    program.write_text(LIAR)
    command = [sys.executable, str(program), lie, str(packets), str(stream)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        try:
            assert process.stdout is not None
            yield f"http://127.0.0.1:{int(process.stdout.readline())}/meshes/patch"
        finally:
            process.kill()


@pytest.mark.parametrize(
    ("lie", "message"),
    [
        ("done", "the server says that all is sent, but"),
        ("repeat", "was not asked for"),
        ("silence", "nothing came from"),
        ("close", "was lost"),
        ("words", r"\x1b]0;owned\x07\x1b[2J\u202eall is well"),
    ],
)
def test_a_part_is_not_passed_off_as_the_whole(
    lie: str, message: str, encoded: Any, meshtide: Any, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("liar")
    (folder / "patch.tide").write_bytes(encoded.to_bytes())
    sent = encoded.header.levels[1].packet_count
    partial = meshtide.folder / "patch.ply.partial.tide"
    with lying(folder, lie, sent, folder / "patch.tide") as url:
        done = meshtide("fetch", url, "--json", "--timeout", "1", "--retries", "0", "--transport", "websocket")
    assert done.returncode == ExitCode.NETWORK
    assert message in done.stderr
    left = len(encoded.header.packets) - sent
    assert f"{left} of {len(encoded.header.packets)} packets are missing" in done.stderr
    assert "the same request goes on from there" in done.stderr
    assert done.stdout == ""
    assert done.stderr.rstrip("\n").isprintable()
    assert meshtide.files == {partial.name}
    header_bytes = encoded.header.to_bytes()
    start = len(preamble(header_bytes))
    assert partial.read_bytes() == encoded.to_bytes()[: start + int(encoded.header.packet_offsets[sent])]


def test_what_was_kept_of_a_liar_is_gone_on_with_elsewhere(
    encoded: Any, meshtide: Any, server: Any, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("liar")
    (folder / "patch.tide").write_bytes(encoded.to_bytes())
    with lying(folder, "done", 2, folder / "patch.tide") as url:
        assert meshtide("fetch", url, "--retries", "0").returncode == ExitCode.NETWORK
    done = meshtide("fetch", server.mesh_url, "--json")
    answer = json.loads(done.stdout)
    assert (answer["complete"], answer["exact"], answer["level"]) == (True, True, 0)
    assert answer["received_bytes"] == sum(entry.length for entry in encoded.header.packets[2:])
    assert len(load_mesh(meshtide.folder / "patch.ply").vertices) == len(encoded.quantized.mesh().vertices)
