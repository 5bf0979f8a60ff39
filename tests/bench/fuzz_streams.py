"""Damaged streams for the decoder: it may refuse one or decode it, but never raise anything else, hang or grow.

    python tests/bench/fuzz_streams.py --seconds 600
    python tests/bench/fuzz_streams.py --streams 1000000 --processes 2

Most streams are damaged inside: a payload or the header, whose checksums are right then, so that the damage gets to the
core's parser and coders, which are called directly. The others are damaged as files, and read as anybody reads them. A
stream that takes more than two seconds of processor time, or more memory than its limits, is a problem.
"""

from __future__ import annotations

import argparse
import json
import mmap
import random
import resource
import selectors
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from ctypes import byref
from functools import cache
from pathlib import Path
from typing import IO, Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from damage import damaged

from meshtide_codec import core
from meshtide_codec.decoder import Decoder
from meshtide_codec.errors import PacketError, StreamError
from meshtide_codec.limits import Limits
from meshtide_codec.packets import Packet, PacketKind
from meshtide_codec.stream.container import PREAMBLE_BYTES, read_available, read_container

GOLDEN = Path(__file__).parents[1] / "golden"
LIMITS = Limits(vertices=1 << 16, faces=1 << 17, memory=1 << 27)
SLACK = 1 << 26  # bytes that Python may take beside the core
LONGEST_SECONDS = 2.0
BATCH = 500
MOST_PROBLEMS = 20
NUMBER = struct.Struct("<q")


@cache
def streams() -> list[tuple[bytes, bytes, list[Packet]]]:
    """Whole files, their headers' bytes, and their packets."""
    found = []
    for path in sorted(GOLDEN.glob("*.tide")):
        data = path.read_bytes()
        header, packets = read_container(data)
        found.append((data, data[PREAMBLE_BYTES : PREAMBLE_BYTES + len(header.to_bytes())], list(packets)))
    return found


def attempt(pick: random.Random) -> str:
    """Damage one stream and decode it; a word for how that ended."""
    data, header, packets = pick.choice(streams())
    if pick.random() < 0.05:
        return attempt_file(damaged(pick, ".tide", data))
    packets = list(packets)
    if pick.random() < 0.1:
        header = damaged(pick, ".tide", header)
    else:
        index = pick.randrange(len(packets))
        packet = packets[index]
        packets[index] = Packet(packet.kind, packet.level, packet.slice, damaged(pick, ".tide", packet.payload))
    if pick.random() < 0.1:
        pick.shuffle(packets)
    if pick.random() < 0.1:
        packets = [packet for packet in packets if packet.kind is not PacketKind.DIFF or pick.random() < 0.5]
    return attempt_packets(header, packets)


def attempt_packets(header: bytes, packets: list[Packet]) -> str:
    """The core alone: parse, push everything whatever fails, show all levels."""
    limited, stream, decoder, shown = core.Limited.of(LIMITS), core.Handle("mt_stream_free"), None, core.Shown()
    word = "decoded"
    try:
        core.call("mt_stream_parse", header, len(header), byref(limited), byref(stream.pointer))
        decoder = core.Handle("mt_decoder_free")
        core.call("mt_decoder_new", stream, byref(limited), core.states(0, 1, 2), byref(decoder.pointer))
    except StreamError as error:
        return type(error).__name__
    for packet in packets:
        payload = packet.payload
        try:
            core.call("mt_decoder_push", decoder, packet.kind, packet.level, packet.slice, payload, len(payload))
        except StreamError as error:
            word = type(error).__name__
    levels = core.library().mt_decoder_available(decoder)
    for level in range(levels.bit_length()):
        if levels >> level & 1:
            try:
                core.call("mt_decoder_show", decoder, level, byref(shown))
            except PacketError as error:  # a face that is told twice
                word = type(error).__name__
            else:
                check_shown(shown)
    del decoder  # before the stream, which it looks at
    return word


def check_shown(shown: core.Shown) -> None:
    """Raise AssertionError unless positions are finite and faces are triangles of them."""
    faces = shown.copied_faces()
    if not np.isfinite(shown.copied_positions()).all():
        raise AssertionError("a decoded position is not finite")
    if faces.size and not (faces.min() >= 0 and faces.max() < shown.vertex_count):
        raise AssertionError("a face names a vertex that is not there")


def attempt_file(data: bytes) -> str:
    """A file, read as anybody reads it."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            header, packets, problem = read_available(data, LIMITS)
            decoder = Decoder(header, LIMITS)
            for packet in packets:
                decoder.push(packet)
            if decoder.finest is not None:
                decoder.mesh(decoder.finest)
        except StreamError as error:
            problem = error
    return "decoded" if problem is None else type(problem).__name__


def child(seed: int, number: int, step: int, told: Path) -> None:
    """Decode streams number, number + step, ... and report; the processor's alarm ends it where one takes too long."""
    attempt(random.Random(0))
    resident = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()  # data and stack
    most = resident + LIMITS.memory + SLACK
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    with told.open("r+b") as file:
        now = mmap.mmap(file.fileno(), NUMBER.size)
    while True:
        ends: Counter[str] = Counter()
        for _ in range(BATCH):
            NUMBER.pack_into(now, 0, number)  # so that whatever ends this process is laid at the door of one stream
            signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_SECONDS)  # SIGVTALRM ends the process
            try:
                ends[attempt(random.Random(f"{seed}/{number}"))] += 1
            except BaseException:  # noqa: BLE001 - whatever it is, it is a finding
                print(json.dumps({"problem": f"stream {number}: {traceback.format_exc()[-1500:]}"}), flush=True)
                ends["problem"] += 1
            number += step
        print(json.dumps({"end": ends}), flush=True)


class Watched:
    """A child that is started again behind whatever ended it.

    Args:
        seed: of everything that is random.
        first: its first stream.
        step: from one of its streams to the next.
        folder: for the file in which it tells which stream it decodes.
    """

    def __init__(self, seed: int, first: int, step: int, folder: str) -> None:
        self.seed, self.number, self.step = seed, first, step
        self.done = 0
        self.ends: Counter[str] = Counter()
        self.problems: list[str] = []
        self._told = Path(folder) / str(first)
        self._told.write_bytes(NUMBER.pack(first))
        self._process = self._start()

    def _start(self) -> subprocess.Popen[str]:
        numbers = [str(each) for each in (self.seed, self.number, self.step)]
        return subprocess.Popen(
            [sys.executable, __file__, "--child", *numbers, str(self._told)], stdout=subprocess.PIPE, text=True
        )

    @property
    def output(self) -> IO[str]:
        """What the child prints."""
        assert self._process.stdout is not None
        return self._process.stdout

    def take(self) -> None:
        """The child's next line, or its end."""
        line = self.output.readline()
        if line:
            event: dict[str, Any] = json.loads(line)
            self.ends.update(event.get("end", {}))
            self.done += sum(event.get("end", {}).values())
            self.problems += [event["problem"]] if "problem" in event else []
            return
        code = self._process.wait()
        (number,) = NUMBER.unpack(self._told.read_bytes())
        self.problems.append(f"stream {number} ended the process with code {code}; decode it alone with --one")
        self.done += 1
        self.number = number + self.step
        self._process = self._start()

    def stop(self) -> None:
        """End the child."""
        self._process.kill()
        self._process.wait()


def watch(wanted: int, seconds: float, seed: int, processes: int) -> dict[str, Any]:
    """Decode so many streams, or for so long; what was found."""
    folder = tempfile.TemporaryDirectory()
    started = shown = time.monotonic()
    children = [Watched(seed, first, processes, folder.name) for first in range(processes)]

    def total() -> int:
        return sum(each.done for each in children)

    def problems() -> list[str]:
        return [problem for each in children for problem in each.problems]

    while total() < wanted and time.monotonic() < started + seconds and len(problems()) < MOST_PROBLEMS:
        with selectors.DefaultSelector() as ready:
            for each in children:
                ready.register(each.output, selectors.EVENT_READ, each)
            for key, _ in ready.select(10.0):
                key.data.take()
        if time.monotonic() > shown + 30:
            shown = time.monotonic()
            print(f"{total()} streams, {len(problems())} problems", file=sys.stderr)
    for each in children:
        each.stop()
    folder.cleanup()
    taken = time.monotonic() - started
    ends = sum((each.ends for each in children), Counter())
    found = problems() if total() else ["no stream was decoded", *problems()]
    return {
        "streams": total(),
        "seconds": round(taken, 1),
        "streams_per_second": round(total() / taken, 1),
        "ends": dict(sorted(ends.items())),
        "problems": found,
    }


def main() -> int:
    """The command; the exit code says whether a problem was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--streams", type=int, default=10**9, help="how many at most (default: as there is time)")
    parser.add_argument("--seconds", type=float, help="how long (default: 60, or until all --streams are done)")
    parser.add_argument("--processes", type=int, default=1, help="side by side")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is random")
    parser.add_argument("--one", type=int, help="decode the stream of this number only, here, and show what it does")
    parser.add_argument("--child", nargs=4, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.child:
        seed, number, step, told = given.child
        child(int(seed), int(number), int(step), Path(told))
    if given.one is not None:
        signal.setitimer(signal.ITIMER_VIRTUAL, 5 * LONGEST_SECONDS)
        print(attempt(random.Random(f"{given.seed}/{given.one}")))
        return 0
    unlimited = 1e9 if given.streams < 10**9 else 60.0
    seconds = given.seconds if given.seconds is not None else unlimited
    result = watch(given.streams, seconds, given.seed, given.processes)
    print(json.dumps(result, indent=1))
    return 1 if result["problems"] else 0


if __name__ == "__main__":
    sys.exit(main())
