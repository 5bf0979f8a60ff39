"""Virtual time: queues, delays, jitter, deadlines."""

from __future__ import annotations

from meshtide_codec.packets import PacketKind
from meshtide_codec.stream.header import PacketEntry
from meshtide_lab.link.timing import Bandwidth, Deadline, Delay, Jitter
from meshtide_lab.link.traffic import Fate


def fates(*lengths: int) -> list[Fate]:
    return [Fate(PacketEntry(PacketKind.DIFF, 0, 0, length, 0), index, False) for index, length in enumerate(lengths)]


def test_packets_queue_for_the_link() -> None:
    packets = fates(100, 50, 200)
    packets[1].lose("loss")
    Bandwidth(100.0).apply(packets, 0, "")
    assert [fate.seconds for fate in packets] == [1.0, 0.0, 3.0]


def test_a_packet_that_arrives_late_waits_for_no_other() -> None:
    packets = fates(100, 100)
    packets[0].seconds = 10.0
    Bandwidth(100.0).apply(packets, 0, "")
    assert [fate.seconds for fate in packets] == [11.0, 1.0]


def test_delay_and_jitter_add_up() -> None:
    packets = fates(*[1] * 200)
    Delay(2.0).apply(packets, 0, "")
    Jitter(0.5).apply(packets, 3, "jitter")
    seconds = [fate.seconds for fate in packets]
    assert 2.0 <= min(seconds) < 2.05
    assert 2.45 < max(seconds) < 2.5
    again = fates(*[1] * 200)
    Delay(2.0).apply(again, 0, "")
    Jitter(0.5).apply(again, 3, "jitter")
    assert [fate.seconds for fate in again] == seconds


def test_what_is_late_is_lost_unless_it_is_protected() -> None:
    packets = fates(1, 1, 1)
    for fate, seconds in zip(packets, (1.0, 2.5, 2.5), strict=True):
        fate.seconds = seconds
    packets[2].protected = True
    Deadline(2.0).apply(packets, 0, "")
    assert [fate.cause for fate in packets] == [None, "deadline", None]
    assert packets[1].lost
    packets[1].lose("loss")
    assert packets[1].cause == "deadline"
