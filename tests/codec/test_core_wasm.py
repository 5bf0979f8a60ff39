"""codec/core/wasm/*.wasm, run by Node: the same levels as the native core's, and the same failures."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import struct
import subprocess
import zlib
from ctypes import byref
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from meshtide_codec import core
from meshtide_codec.compact.options import CompactHeader
from meshtide_codec.decoder import Decoder
from meshtide_codec.effort import Effort
from meshtide_codec.errors import MeshtideError
from meshtide_codec.limits import Limits
from meshtide_codec.stream.container import PREAMBLE_BYTES, ContainerReader

if TYPE_CHECKING:
    from collections.abc import Sequence

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="Node runs WebAssembly")

REPOSITORY = Path(__file__).parents[2]
CORE = REPOSITORY / "codec/core"
STATES = REPOSITORY / "codec/meshtide_codec/states"
GOLDEN = sorted((REPOSITORY / "tests/golden").glob("*.tide"))
FULL, SMALL = "meshtide-full.wasm", "meshtide.wasm"
FAULTS = {"LimitError": "limit", "VersionError": "version", "CoreError": "internal"}


def by_wasm(requests: Sequence[dict[str, Any]], module: str = FULL) -> list[dict[str, Any]]:
    """What Node answers to each request, see run_wasm.mjs."""
    command = ["node", CORE / "tests/run_wasm.mjs", "decode", CORE / "wasm" / module, STATES]
    lines = "".join(json.dumps(request) + "\n" for request in requests)
    told = subprocess.run(command, input=lines, capture_output=True, text=True, check=True)
    return [json.loads(line) for line in told.stdout.splitlines()]


def natively(data: bytes, limits: Limits | None = None) -> dict[str, Any]:
    """The same by the native core."""
    answer: dict[str, Any] = {"levels": [], "error": None}
    try:
        reader = ContainerReader(limits)
        packets = reader.feed(data)
        assert reader.header is not None
        decoder = Decoder(reader.header, limits)
        for packet in packets:
            if packet.kind.label != "Order":
                decoder.push(packet)
    except MeshtideError as error:
        answer["error"] = {"fault": FAULTS.get(type(error).__name__, "malformed"), "level": error.level}
        return answer
    available = core.library().mt_decoder_available(decoder._core)
    for level in range(64):
        if not available >> level & 1:
            continue
        shown = core.Shown()
        core.call("mt_decoder_show", decoder._core, level, byref(shown))
        positions, faces = shown.copied_positions(), shown.copied_faces()
        digest = hashlib.sha256(positions.tobytes() + faces.tobytes()).hexdigest()
        answer["levels"].append([level, len(positions), len(faces), digest])
    return answer


def damaged(data: bytes, packet: int, bit: int) -> bytes:
    """A stream whose packet has another bit, and the checksums that belong to it."""
    reader = ContainerReader()
    reader.feed(data)
    header = reader.header
    assert header is not None
    payload = bytearray(reader.packets[packet].payload)
    before = struct.pack("<I", header.packets[packet].checksum)
    payload[bit // 8] ^= 1 << bit % 8
    told = bytearray(reader.header_bytes)
    assert told.count(before) == 1
    place = told.index(before)
    told[place : place + 4] = struct.pack("<I", zlib.crc32(payload))
    start = PREAMBLE_BYTES + len(told) + sum(row.length for row in header.packets[:packet])
    preamble = data[: PREAMBLE_BYTES - 4] + struct.pack("<I", zlib.crc32(told))
    rest = data[PREAMBLE_BYTES + len(told) : start] + bytes(payload) + data[start + len(payload) :]
    return preamble + bytes(told) + rest


def refused(file: Path) -> str | None:
    """What meshtide.wasm says that it lacks for a stream."""
    reader = ContainerReader()
    reader.feed(file.read_bytes())
    assert reader.header is not None
    options = reader.header.options
    if not isinstance(options, CompactHeader):
        return "profile classic"
    return "effort high" if options.effort is Effort.HIGH else None


@pytest.mark.parametrize("module", [FULL, SMALL])
def test_golden_streams(module: str) -> None:
    refusals = [refused(file) if module == SMALL else None for file in GOLDEN]
    assert sum(refusal is None for refusal in refusals) > 10
    answers = by_wasm([{"file": os.fspath(file)} for file in GOLDEN], module)
    for file, answer, refusal in zip(GOLDEN, answers, refusals, strict=True):
        if refusal is not None:
            assert answer["error"] == {"fault": "unsupported", "text": refusal, "offset": None, "packet": None}
            assert answer["levels"] == []
            continue
        expected = natively(file.read_bytes())
        assert answer["error"] is None, file.name
        assert answer["levels"] == expected["levels"], file.name
        assert answer["levels"]


@pytest.mark.parametrize("module", [FULL, SMALL])
def test_damaged_packets_fail_alike(tmp_path: Path, module: str) -> None:
    streams = [
        damaged(file.read_bytes(), packet, bit)
        for file in GOLDEN
        if file.name in {"compact-bowl.tide", "compact-dome-high.tide", "classic-bowl-power.tide"}
        and (module == FULL or refused(file) is None)
        for packet, bit in ((0, 5), (1, 3), (1, 11), (2, 6))
    ]
    files = [tmp_path / f"{i}.tide" for i in range(len(streams))]
    for file, stream in zip(files, streams, strict=True):
        file.write_bytes(stream)
    failures = 0
    answers = by_wasm([{"file": os.fspath(file)} for file in files], module)
    for answer, stream in zip(answers, streams, strict=True):
        expected = natively(stream)
        if expected["error"] is None:
            assert answer == expected
        else:
            failures += 1
            assert answer["error"]["fault"] == expected["error"]["fault"]
            assert answer["error"]["packet"][1] == expected["error"]["level"]
            assert answer["levels"] == []
    assert failures > len(streams) // 3


def test_limits_and_foreign_files(tmp_path: Path) -> None:
    stream = REPOSITORY / "tests/golden/compact-bowl.tide"
    cut, foreign = tmp_path / "cut.tide", tmp_path / "foreign.tide"
    cut.write_bytes(stream.read_bytes()[:-1])
    foreign.write_bytes(b"ply\n")
    limited, shortened, other = by_wasm(
        [
            {"file": os.fspath(stream), "limits": {"vertices": 20}},
            {"file": os.fspath(cut)},
            {"file": os.fspath(foreign)},
        ]
    )
    assert limited["error"]["fault"] == natively(stream.read_bytes(), Limits(vertices=20))["error"]["fault"] == "limit"
    assert limited["error"]["text"] == "vertices"
    assert shortened == natively(cut.read_bytes())
    assert other["error"] == {"fault": "malformed", "text": "not a .tide file", "offset": 0, "packet": None}
