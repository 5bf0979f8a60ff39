import pytest

from meshtide_server.security.origins import may_connect


@pytest.mark.parametrize(
    ("origin", "allowed", "expected"),
    [
        (None, (), True),
        ("http://127.0.0.1:8000", (), True),
        ("https://127.0.0.1:8000", (), True),
        ("http://127.0.0.1:9000", (), False),
        ("https://elsewhere.example", (), False),
        ("https://elsewhere.example", ("https://elsewhere.example",), True),
        ("https://elsewhere.example", ("*",), True),
        ("https://elsewhere.example.evil", ("https://elsewhere.example",), False),
        ("null", (), False),
        ("", (), False),
        ("http://[", (), False),
    ],
)
def test_only_own_and_allowed_origins(origin: str | None, allowed: tuple[str, ...], expected: bool) -> None:
    headers = {"host": "127.0.0.1:8000"} | ({} if origin is None else {"origin": origin})
    assert may_connect(headers, allowed) is expected


def test_an_empty_host_matches_no_empty_origin() -> None:
    assert not may_connect({"origin": "null"}, ())
