from meshtide_server.hosting.packet_index import PacketIndex
from meshtide_server.hosting.stream import load_stream
from meshtide_server.store.range_reader import MemoryReader

from ..made_streams import make_stream

FIRST = load_stream(MemoryReader(make_stream(1)))
SECOND = load_stream(MemoryReader(make_stream(2)))


def test_packets_are_found_while_their_mesh_is_hosted() -> None:
    index = PacketIndex()
    index.add("a", FIRST)
    for place, digest in enumerate(FIRST.packet_digests):
        assert index.find(digest) == (FIRST, place)
    assert index.find(SECOND.packet_digests[0]) is None
    index.remove("a")
    index.remove("a")
    assert index.find(FIRST.packet_digests[0]) is None


def test_a_new_stream_replaces_the_old_one() -> None:
    index = PacketIndex()
    index.add("a", FIRST)
    index.add("a", SECOND)
    assert index.find(FIRST.packet_digests[0]) is None
    assert index.find(SECOND.packet_digests[3]) == (SECOND, 3)


def test_a_packet_of_several_streams_outlives_one_of_them() -> None:
    index = PacketIndex()
    copy = load_stream(MemoryReader(make_stream(1)))
    index.add("a", FIRST)
    index.add("b", copy)
    index.remove("a")
    place = index.find(FIRST.packet_digests[2])
    assert place is not None
    assert place.stream is copy


def test_a_stream_that_has_changed_on_the_disk_is_the_last_choice() -> None:
    class Changed(MemoryReader):
        def unchanged(self) -> bool:
            return False

    index = PacketIndex()
    stale = load_stream(Changed(make_stream(1)))
    index.add("a", stale)
    place = index.find(FIRST.packet_digests[0])
    assert place is not None
    assert place.stream is stale
    index.add("b", FIRST)
    place = index.find(FIRST.packet_digests[0])
    assert place is not None
    assert place.stream is FIRST
