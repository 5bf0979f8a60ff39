import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_server.store import InvalidKeyError, check_key, source_key, stream_key
from meshtide_server.store.keys import check_prefix

DIGEST = "ab" * 32


@given(st.from_regex(r"\A[a-z0-9][a-z0-9._-]{0,20}(/[a-z0-9][a-z0-9._-]{0,20}){0,4}\Z"))
def test_keys_are_taken_as_they_are(key: str) -> None:
    assert check_key(key) == key
    assert check_prefix(key) == check_prefix(f"{key}/") == key


@given(st.text(max_size=20))
def test_no_text_makes_a_key_that_leaves_the_folder(text: str) -> None:
    try:
        key = check_key(text)
    except InvalidKeyError:
        return
    assert all(segment[0] != "." and segment.isascii() and segment == segment.lower() for segment in key.split("/"))


@pytest.mark.parametrize("prefix", ["/", "a//", "..", "a/.."])
def test_foreign_prefixes_are_refused(prefix: str) -> None:
    with pytest.raises(InvalidKeyError):
        check_prefix(prefix)


def test_keys_of_streams_and_sources() -> None:
    assert stream_key(DIGEST) == f"streams/{DIGEST}.tide"
    assert source_key(DIGEST, ".OBJ") == f"sources/{DIGEST}.obj"
    assert source_key(DIGEST, "") == f"sources/{DIGEST}"


@pytest.mark.parametrize("digest", ["", "ab", DIGEST.upper(), DIGEST + "0", "../" + DIGEST])
def test_foreign_digests_are_refused(digest: str) -> None:
    with pytest.raises(InvalidKeyError, match="is not a SHA-256"):
        stream_key(digest)
    with pytest.raises(InvalidKeyError, match="is not a SHA-256"):
        source_key(digest, ".obj")


@pytest.mark.parametrize("suffix", ["obj", "./x", ".gz.tar", ".tar.gz.gz", ".", ".verylongsuffix"])
def test_foreign_suffixes_are_refused(suffix: str) -> None:
    with pytest.raises(InvalidKeyError, match="is not the suffix"):
        source_key(DIGEST, suffix)
