from pathlib import Path

import pytest
from pydantic import ValidationError

from meshtide_codec.errors import OptionError
from meshtide_server.settings_sources import load_settings


def test_arguments_win_over_the_environment_and_that_over_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "settings.toml"
    file.write_text('samples = true\nport = 1\nbits = 10\neffort = "high"\nmax_upload = 11\ndrain_timeout = 1.5\n')
    monkeypatch.setenv("MESHTIDE_PORT", "2")
    monkeypatch.setenv("MESHTIDE_BITS", "9")
    monkeypatch.setenv("MESHTIDE_MAX_UPLOAD", "")
    settings = load_settings({"bits": 8}, assigned=["MESHTIDE_MAX_FACES=4"], file=file)
    assert (settings.port, settings.bits, settings.max_upload, settings.max_faces) == (2, 8, 11, 4)
    assert settings.drain_timeout == 1.5
    assert settings.effort == "high"
    assert settings.samples


def test_secrets_may_stand_in_the_file_but_not_among_the_arguments(tmp_path: Path) -> None:
    file = tmp_path / "settings.toml"
    file.write_text('samples = true\nwrite_tokens = ["a-secret-of-someone"]\n')
    settings = load_settings({}, file=file)
    assert [token.get_secret_value() for token in settings.write_tokens] == ["a-secret-of-someone"]
    for name in ("write_tokens", "READ_TOKENS", "database"):
        with pytest.raises(OptionError, match="is a secret") as caught:
            load_settings({"samples": True}, assigned=[f"{name}=hush-hush-hush-hush"])
        assert "hush" not in str(caught.value)


@pytest.mark.parametrize(
    ("assigned", "words"),
    [("max_upload", "sets nothing"), ("colour=red", "no setting 'colour'"), ("port=3", "port is given twice")],
)
def test_odd_assignments_are_refused(assigned: str, words: str) -> None:
    with pytest.raises(OptionError, match=words):
        load_settings({"samples": True, "port": 2}, assigned=[assigned])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"port = ", "is not TOML"),
        (b"\xff", "is not text"),
        (b"colour = 1\n", "no setting 'colour'"),
        (b"[server]\nport = 1\n", "no setting 'server'"),
        (b"#" * ((1 << 20) + 1), "more than 1048576 bytes"),
        (None, "cannot be read: No such file"),
    ],
)
def test_odd_files_are_refused(tmp_path: Path, content: bytes | None, words: str) -> None:
    file = tmp_path / "settings.toml"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(OptionError, match=words):
        load_settings({"samples": True}, file=file)


def test_values_are_checked_wherever_they_come_from(tmp_path: Path) -> None:
    file = tmp_path / "settings.toml"
    file.write_text("samples = true\nport = 70000\n")
    with pytest.raises(ValidationError, match="port"):
        load_settings({}, file=file)
    with pytest.raises(ValidationError, match="max_upload"):
        load_settings({"samples": True}, assigned=["max_upload=0"])
