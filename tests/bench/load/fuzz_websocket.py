"""Random and mutated websocket messages against a real server: `python tests/bench/load/fuzz_websocket.py`.

Every connection says a few things: hellos and credits as they should be, the same with damaged bytes, any msgpack, any
bytes, text, frames that are too large; then it waits, closes, or is gone without a word. Some write bytes instead:
floods of tiny frames, messages in many pieces, frames with damaged heads, handshakes that go on and on. Meshes are
asked for by ids with paths as well. A close with code 1011, an error frame `internal`, an end of the server, a line
about a fault in its log, or growing memory or descriptors is a failure: the exit code is 1 then.
"""

from __future__ import annotations

import asyncio
import sys
from collections import Counter
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit

import msgpack
from fuzzing import Budget, run_command
from watched_server import MESH, watched_server
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, WebSocketException

from meshtide_codec.errors import ProtocolError
from meshtide_codec.stream.messages import LARGEST_MESSAGE, Credit, Error, Hello, decode_message, encode_message

AT_ONCE = 20
INTERNAL = 1011
_OTHER_IDS = ("7", "sub/spot", "sub%2Fspot", "sub/none", "a/b/c/d", "%00/a", "..%2F..", "sub/..%2fspot", "x" * 300)
_ODD_NUMBERS = (0, 1, -1, 63, 64, 2**31, 2**53, 2**63 - 1, 2**64 - 1, -(2**63))


class Fuzzer:
    """Opens connections and talks.

    Args:
        budget: how many messages, and for how long.
    """

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._server = budget.server
        self._url = budget.server.url.replace("http", "ws", 1)
        self._random = budget.random
        self._noted = False
        self.connections = 0
        self.endings: Counter[str] = Counter()

    async def run(self) -> None:
        """Send all messages."""
        while not self._budget.done:
            await asyncio.gather(*(self._talk() for _ in range(AT_ONCE)))
            if not self._noted and self._budget.warm:
                self._noted = True
                await asyncio.to_thread(self._server.note)

    async def _talk(self) -> None:
        pick = self._random
        self.connections += 1
        if pick.random() < 0.15:
            with suppress(OSError, TimeoutError):
                async with asyncio.timeout(30.0):
                    await self._write()
            return
        mesh = MESH if pick.random() < 0.9 else pick.choice(_OTHER_IDS)
        path = f"/meshes/{mesh}/stream{pick.choice(('', '', '?ticket=x'))}"
        try:
            async with (
                asyncio.timeout(30.0),
                connect(self._url + path, compression=None, max_size=None, proxy=None, close_timeout=5.0) as socket,
            ):
                for _ in range(pick.randrange(1, 12)):
                    await socket.send(self._message())
                    self._budget.sent += 1
                    if pick.random() < 0.2:
                        with suppress(TimeoutError):
                            self._look_at(await asyncio.wait_for(socket.recv(), 0.2))
                if pick.random() < 0.3:
                    socket.transport.abort()
                    self.endings["gone"] += 1
                    return
                if pick.random() < 0.5:
                    with suppress(TimeoutError):
                        while True:
                            self._look_at(await asyncio.wait_for(socket.recv(), 0.2))
            self._ended(socket.close_code)
        except ConnectionClosed as error:
            self._ended(error.rcvd.code if error.rcvd else None)
        except (OSError, WebSocketException, TimeoutError) as error:
            self.endings[type(error).__name__] += 1

    async def _write(self) -> None:
        """Bytes that no library would send."""
        pick = self._random
        parts = urlsplit(self._server.url)
        reader, writer = await asyncio.open_connection(parts.hostname, parts.port)
        try:
            head = f"GET /meshes/{MESH}/stream HTTP/1.1\r\nHost: h\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            head += "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
            if pick.random() < 0.1:
                head += "X: 1\r\n" * pick.choice((50, 200, 100_000))
            writer.write(f"{head}\r\n".encode())
            if pick.random() < 0.8:
                await asyncio.wait_for(reader.read(4096), 5.0)
            hello = encode_message(self._hello())
            first = pick.choice((0x82, 0x82, 0x82, 0x02))
            writer.write(bytes((first, 0xFE)) + len(hello).to_bytes(2, "big") + bytes(4) + hello)
            tiny = (
                b"\x89\x80",
                b"\x8a\x80",
                b"\x82\x80",
                b"\x00\x80",
                b"\x80\x80",
                b"\x02\x80",
                b"\xff\x80",
                b"\x88\x80",
            )
            for _ in range(pick.randrange(1, 5)):
                writer.write(
                    pick.choice((pick.choice(tiny) + bytes(4), pick.randbytes(9))) * pick.choice((1, 70, 20_000))
                )
                self._budget.sent += 1
            if pick.random() < 0.5:
                with suppress(TimeoutError):
                    while await asyncio.wait_for(reader.read(1 << 16), 0.3):
                        pass
            self.endings["bytes"] += 1
        finally:
            writer.transport.abort()

    def _message(self) -> bytes | str:
        """Something to say."""
        pick = self._random
        kind = pick.randrange(10)
        if kind < 3:
            return encode_message(self._hello())
        if kind == 3:
            return encode_message(Credit(pick.choice((0, 1, 1000, 1 << 20, 2**53))))
        if kind < 6:
            frame = bytearray(encode_message(self._hello()))
            for _ in range(pick.randrange(1, 5)):
                frame[pick.randrange(len(frame))] = pick.randrange(256)
            return bytes(frame[: pick.randrange(1, len(frame) + 1)])
        if kind < 8:
            return bytes(msgpack.packb([pick.choice((*range(7), None, "x")), *(self._value(3) for _ in range(8))]))
        if kind == 8:
            return pick.choice(("", "hello", "\u0000", "[0]"))
        return pick.randbytes(pick.choice((0, 1, 100, LARGEST_MESSAGE, LARGEST_MESSAGE + 1)))

    def _hello(self) -> Hello:
        pick = self._random
        held = tuple((3 * index, 3 * index + pick.randrange(1, 3)) for index in range(pick.choice((0, 1, 5, 4000))))
        return Hello(
            protocol=pick.choice((1, 1, 1, 2)),
            mesh=pick.choice((MESH, MESH, MESH, "other", "")),
            fingerprint=pick.choice((b"", pick.randbytes(32))),
            held=held,
            until_level=pick.choice((None, 0, 3, 63)),
            until_error=pick.choice((None, 0.0, 1e-3, 1e300)),
            until_bytes=pick.choice((None, 0, 1000, 2**53)),
            credit=pick.choice((0, 1, 1000, 1 << 20, 2**53)),
        )

    def _value(self, depth: int) -> Any:
        pick = self._random
        kind = pick.randrange(8 if depth else 6)
        simple = (None, pick.random() < 0.5, pick.choice(_ODD_NUMBERS), pick.choice((0.5, float("nan"), float("inf"))))
        if kind < len(simple):
            return simple[kind]
        if kind == 4:
            return pick.randbytes(pick.randrange(40))
        if kind == 5:
            return pick.choice(("", MESH, "x" * 300))
        if kind == 6:
            return [self._value(depth - 1) for _ in range(pick.randrange(4))]
        return {pick.randrange(9): self._value(depth - 1)}

    def _look_at(self, frame: bytes | str) -> None:
        try:
            message = decode_message(frame)
        except ProtocolError as error:
            self._server.problems.append(f"the server sent what it must not: {error}")
            return
        if isinstance(message, Error) and message.code == "internal":
            self._server.problems.append(f"error frame: {message.message}")

    def _ended(self, code: int | None) -> None:
        self.endings[str(code)] += 1
        if code == INTERNAL:
            self._server.problems.append("a connection was closed with code 1011")


def fuzz(wanted: int, seconds: float, seed: int) -> dict[str, Any]:
    """Run, and return what was seen; `problems` is empty if nothing was wrong."""
    with watched_server("--hello-timeout", "2", "--stall-timeout", "5") as server:
        budget = Budget(server, wanted, seconds, seed)
        fuzzer = Fuzzer(budget)
        asyncio.run(fuzzer.run())
        endings = dict(sorted(fuzzer.endings.items()))
        return budget.report("messages", connections=fuzzer.connections, endings=endings)


if __name__ == "__main__":
    sys.exit(run_command(__doc__, "messages", fuzz))
