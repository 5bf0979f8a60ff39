from __future__ import annotations

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from meshtide_client.connection.address import MeshAddress, ServerAddress
from meshtide_codec.errors import OptionError


@pytest.mark.parametrize(
    "url",
    [
        "http://h:8000/meshes/bunny",
        "http://h:8000/meshes/bunny/",
        "http://h:8000/meshes/bunny/stream",
        "http://h:8000/meshes/bunny.tide",
        "ws://h:8000/meshes/bunny/stream",
        "ws://h:8000/meshes/bunny",
        "  http://h:8000/meshes/bunny\n",
        "HTTP://h:8000/meshes/bunny",
    ],
)
def test_all_forms_name_the_same_mesh(url: str) -> None:
    address = MeshAddress.parse(url)
    assert address.mesh == "bunny"
    assert address.stream_url == "ws://h:8000/meshes/bunny/stream"
    assert str(address) == "http://h:8000/meshes/bunny"


@pytest.mark.parametrize("scheme", ["https", "wss"])
def test_secure_schemes_stay_secure(scheme: str) -> None:
    address = MeshAddress.parse(f"{scheme}://h/meshes/bunny")
    assert address.stream_url == "wss://h/meshes/bunny/stream"
    assert address.server.listing_url == "https://h/meshes"


def test_a_prefix_of_a_proxy_is_kept() -> None:
    address = MeshAddress.parse("https://h/a/meshes/b/meshes/c")
    assert (address.server.prefix, address.mesh) == ("/a/meshes/b", "c")
    assert ServerAddress.parse("https://h/tide/").listing_url == "https://h/tide/meshes"
    assert ServerAddress.parse("https://h/tide/meshes").listing_url == "https://h/tide/meshes"


@pytest.mark.parametrize(
    "mesh", ["scans/bunny", "a/b/c", "meshes/bunny", "a/meshes/b", "../a", "a/./b", "a//b", "ü/ä b"]
)
def test_a_mesh_of_a_subfolder_is_found_again_by_its_address(mesh: str) -> None:
    for prefix in ("", "/tide"):
        address = ServerAddress.parse(f"https://h{prefix}").mesh(mesh)
        for url in (str(address), address.page_url, address.file_url, address.stream_url):
            assert MeshAddress.parse(url) == address
    assert MeshAddress.parse("http://h/meshes/scans/bunny.tide").mesh == "scans/bunny"
    assert ServerAddress.parse("http://h").mesh("scans/bunny").stream_url == "ws://h/meshes/scans/bunny/stream"
    assert "/" not in address.file_stem


def test_a_server_can_be_named_by_one_of_its_meshes() -> None:
    assert ServerAddress.parse("ws://h:1/meshes/bunny/stream") == ServerAddress.parse("http://h:1")
    assert ServerAddress.parse("http://h:1").mesh("bunny") == MeshAddress.parse("http://h:1/meshes/bunny")


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("", "does not start with"),
        ("localhost:8000/meshes/bunny", "does not start with http://"),
        ("ftp://h/meshes/bunny", "does not start with"),
        ("http:h/meshes/bunny", "does not start with"),
        ("http:///meshes/bunny", "names no host"),
        ("http://h:0/meshes/bunny", "names no host and port"),
        ("http://h:99999/meshes/bunny", "is not an address"),
        ("http://h:x/meshes/bunny", "is not an address"),
        ("http://[::1/meshes/bunny", "is not an address"),
        ("http://h/meshes", "names no mesh"),
        ("http://h/meshes/", "names no mesh"),
        ("http://h/meshes//a", "names no mesh"),
        ("http://h/bunny", "names no mesh"),
        ("http://h/meshes/bunny?x=1", r"after \? or #"),
        ("http://h/meshes/bunny#x", r"after \? or #"),
        ("http://h/meshes/" + "b" * 201, "201 characters"),
    ],
)
def test_what_is_no_address_of_a_mesh_is_refused(url: str, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        MeshAddress.parse(url)


def test_a_good_address_is_shown_with_the_refusal() -> None:
    with pytest.raises(OptionError, match="write it like http://localhost:8000/meshes/stanford-bunny"):
        MeshAddress.parse("bunny")


def test_passwords_are_used_but_not_shown() -> None:
    address = MeshAddress.parse("https://me:secret@h/meshes/bunny")
    assert "me:secret@h" in address.stream_url
    assert "secret" not in str(address)
    assert "secret" not in str(address.server)


@pytest.mark.parametrize(
    ("host", "expected"),
    [("localhost:1", True), ("127.0.0.1:1", True), ("[::1]:1", True), ("example.org", False), ("192.168.0.1", False)],
)
def test_this_machine_is_recognised(host: str, expected: bool) -> None:
    assert ServerAddress.parse(f"http://{host}").is_loopback is expected


@example("stream")
@example("meshes")
@given(st.text(min_size=1, max_size=200).filter(lambda text: text.isprintable()))
def test_any_id_survives_its_url(mesh: str) -> None:
    address = ServerAddress.parse("http://h:8000").mesh(mesh)
    assume(not mesh.endswith(".tide"))
    assert MeshAddress.parse(str(address)).mesh == mesh
    assert MeshAddress.parse(address.stream_url).mesh == mesh


@given(st.text(max_size=50))
def test_a_file_stem_never_leaves_its_folder(mesh: str) -> None:
    stem = ServerAddress.parse("http://h").mesh(mesh).file_stem
    assert stem
    assert not stem.startswith(".")
    assert not set(stem) & set("/\\:\0")
