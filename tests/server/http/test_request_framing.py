import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_server.http.request_framing import Body, HeadLimits, RequestError, body_of, check_host, chunk_size

LIMITS = HeadLimits(line=20, size=100, headers=3)


def head(*lines: str) -> bytes:
    return "".join(f"{line}\r\n" for line in ("POST /a HTTP/1.1", *lines, "")).encode()


@pytest.mark.parametrize(
    ("lines", "body"),
    [
        ((), 0),
        (("Host: h",), 0),
        (("content-LENGTH:  17 ",), 17),
        (("X-Content-Length: 5", "Content-Length: 0"), 0),
        (("Transfer-Encoding: Chunked",), Body.CHUNKS),
    ],
)
def test_what_follows_a_head(lines: tuple[str, ...], body: int | Body) -> None:
    assert body_of(head(*lines)) == body


@pytest.mark.parametrize(
    "lines",
    [
        ("Content-Length: 5", "Content-Length: 5"),
        ("Content-Length: 5", "Transfer-Encoding: chunked"),
        ("Content-Length: +5",),
        ("Content-Length: 5, 5",),
        ("Content-Length: 0x5",),
        ("Content-Length:",),
        (f"Content-Length: {10**19}",),
        ("Transfer-Encoding: gzip, chunked",),
        ("Transfer-Encoding: identity",),
        ("X: a\n",),
        ("X: a\rb",),
        ("X: a", " Content-Length: 5"),
    ],
)
def test_what_two_readers_could_understand_in_two_ways_is_refused(lines: tuple[str, ...]) -> None:
    with pytest.raises(RequestError, match="malformed") as refused:
        body_of(head(*lines))
    assert (refused.value.status, refused.value.code) == (400, "bad-request")


def test_chunks_belong_to_version_1_1_and_a_tunnel_has_no_body() -> None:
    for line in (b"POST /a HTTP/1.0\r\nTransfer-Encoding: chunked", b"CONNECT a:1 HTTP/1.1\r\nContent-Length: 9"):
        with pytest.raises(RequestError):
            body_of(line + b"\r\n\r\n")
    assert body_of(b"CONNECT a:1 HTTP/1.1\r\n\r\n") == 0


@pytest.mark.parametrize("host", ["", "h", "a-b.example:8000", "127.0.0.1:80", "[::1]", "[::1]:8000", "a_b", "%41"])
def test_hosts(host: str) -> None:
    check_host(head("X: y", f"hOST:  {host} "))


@pytest.mark.parametrize(
    "lines",
    [(), ("X-Host: h",), ("Host: h", "Host: h"), ("Host: [::1",), ("Host: a b",), ("Host: a/b",), ("Host: a:b",)],
)
def test_who_does_not_name_one_host_is_refused(lines: tuple[str, ...]) -> None:
    with pytest.raises(RequestError, match="malformed: .* Host") as refused:
        check_host(head(*lines))
    assert (refused.value.status, refused.value.code) == (400, "bad-request")


def test_version_1_0_need_not_name_a_host_but_not_name_two() -> None:
    check_host(b"GET /a HTTP/1.0\r\n\r\n")
    with pytest.raises(RequestError, match="2 Host headers"):
        check_host(b"GET /a HTTP/1.0\r\nHost: a\r\nHost: b\r\n\r\n")


@pytest.mark.parametrize("line", [b"", b"g", b"-1", b"1 ", b"0x1", b"1" * 16, b";a", b"1;\n"])
def test_chunks_without_a_length(line: bytes) -> None:
    with pytest.raises(RequestError):
        chunk_size(line)


@given(st.integers(0, 16**15 - 1))
def test_lengths_of_chunks(size: int) -> None:
    assert chunk_size(f"{size:X};name=value".encode()) == chunk_size(f"{size:x}".encode()) == size


def test_limits_are_held_to_the_byte() -> None:
    LIMITS.check_line(b"x" * 20 + b"\r\n" + b"y" * 100)
    LIMITS.check_line(b"x" * 20 + b"\r")
    LIMITS.check_size(100)
    LIMITS.check_count(3)
    for status, check in (
        (414, lambda: LIMITS.check_line(b"x" * 21 + b"\r\n")),
        (414, lambda: LIMITS.check_line(b"x" * 22)),
        (431, lambda: LIMITS.check_size(101)),
        (431, lambda: LIMITS.check_count(4)),
    ):
        with pytest.raises(RequestError) as refused:
            check()
        assert refused.value.status == status
