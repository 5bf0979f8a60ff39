from pathlib import Path

import pytest

from meshtide_client.download.byte_source import PIECE, LocalSource


@pytest.mark.parametrize(("start", "end"), [(0, None), (0, 10), (5, 5), (PIECE - 3, PIECE + 3), (2 * PIECE, None)])
async def test_ranges_of_a_file_are_read(start: int, end: int | None, tmp_path: Path) -> None:
    content = bytes(range(256)) * (PIECE * 2 // 256 + 3)
    path = tmp_path / "file"
    path.write_bytes(content)
    source = LocalSource(path)
    async with source.read(start, end) as reading:
        assert (reading.start, reading.ranged, reading.size) == (start, True, len(content))
        assert b"".join([piece async for piece in reading.pieces]) == content[start:end]
    await source.close()


async def test_a_file_that_is_not_there_is_an_error_of_the_disk(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        async with LocalSource(tmp_path / "missing").read(0, None):
            pass
