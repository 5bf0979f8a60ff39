from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_client.connection.address import MeshAddress
from meshtide_client.connection.tide_address import TideAddress, parse_address
from meshtide_codec.errors import OptionError


@pytest.mark.parametrize(
    ("url", "kind", "mesh", "shown"),
    [
        ("https://h/scans/vase.tide", "web", "vase", "https://h/scans/vase.tide"),
        ("http://h:8000/old%20vase.tide", "web", "old vase", "http://h:8000/old%20vase.tide"),
        ("https://h/meshes/vase.tide?X-Signature=abc", "web", "vase", "https://h/meshes/vase.tide"),
        ("https://me:abc@h/vase.tide", "web", "vase", "https://h/vase.tide"),
        ("s3://bucket/scans/vase.tide", "s3", "vase", "s3://bucket/scans/vase.tide"),
        ("vase.tide", "local", "vase", "vase.tide"),
        ("/scans/a b/vase.TIDE.tide", "local", "vase.TIDE", "/scans/a b/vase.TIDE.tide"),
        ("file:///scans/a%20b/vase.tide", "local", "vase", str(Path("/scans/a b/vase.tide"))),
        ("file:vase.tide", "local", "vase", "vase.tide"),
    ],
)
def test_files_are_told_apart(url: str, kind: str, mesh: str, shown: str) -> None:
    address = parse_address(url)
    assert isinstance(address, TideAddress)
    assert (address.kind, address.mesh, str(address)) == (kind, mesh, shown)
    assert "abc" not in repr(address)


@pytest.mark.parametrize("url", ["http://h/meshes/vase.tide", "http://h/meshes/vase", "wss://h/meshes/vase/stream"])
def test_meshes_of_servers_stay_what_they_are(url: str) -> None:
    assert parse_address(url) == MeshAddress.parse("wss://h/meshes/vase" if "wss" in url else "http://h/meshes/vase")


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("vase", "does not start with"),
        ("vase.ply", "does not start with"),
        ("s3://bucket", "names no .tide file of a bucket"),
        ("s3://bucket/vase.ply", "names no .tide file of a bucket"),
        ("s3://key:secret@bucket/vase.tide", "names no .tide file"),
        ("file://elsewhere/vase.tide", "another machine"),
        ("file:///vase.ply", "does not end with .tide"),
        ("ftp://h/vase.tide", "does not start with"),
        ("http:///vase.tide", "names no host"),
        ("http://h/vase.tide#x", r"after \? or #"),
    ],
)
def test_what_names_nothing_is_refused(url: str, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        parse_address(url)


@given(st.text(max_size=40))
def test_any_text_is_an_address_or_refused(text: str) -> None:
    try:
        address = parse_address(text)
    except OptionError:
        return
    assert not set(address.file_stem) & set("/\\:\0")
