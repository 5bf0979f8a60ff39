from pathlib import Path

import pytest
from pydantic import ValidationError

from meshtide_codec.effort import Effort
from meshtide_codec.errors import OptionError
from meshtide_server.encoding_options import EncodingOptions
from meshtide_server.settings import Settings


def test_defaults_serve_this_machine_only() -> None:
    settings = Settings(samples=True)
    assert (settings.host, settings.port, settings.cache) == ("127.0.0.1", 8000, None)


def test_environment_sets_and_arguments_win(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MESHTIDE_DIRECTORY", str(tmp_path))
    monkeypatch.setenv("MESHTIDE_PORT", "9000")
    monkeypatch.setenv("MESHTIDE_HELLO_TIMEOUT", "2.5")
    monkeypatch.setenv("MESHTIDE_CACHE", "")
    monkeypatch.setenv("MESHTIDE_ALLOWED_ORIGINS", "https://a.example, https://b.example")
    settings = Settings(port=9001)
    assert settings.directory == tmp_path
    assert settings.port == 9001
    assert settings.hello_timeout == 2.5
    assert settings.cache is None
    assert settings.allowed_origins == ("https://a.example", "https://b.example")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("port", -1),
        ("port", 65536),
        ("bits", 3),
        ("bits", 21),
        ("effort", "most"),
        ("hello_timeout", 0),
        ("stall_timeout", -1),
        ("max_message", 10),
        ("max_message", 1 << 20),
        ("log_level", "loud"),
        ("colour", "red"),
    ],
)
def test_values_outside_their_range_are_refused(name: str, value: object) -> None:
    with pytest.raises(ValidationError, match=name):
        Settings(samples=True, **{name: value})


def test_effort_is_of_profile_compact(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Settings(samples=True).encoding == EncodingOptions(12, "compact", Effort.DEFAULT)
    monkeypatch.setenv("MESHTIDE_EFFORT", "high")
    assert Settings(samples=True, bits=10).encoding == EncodingOptions(10, "compact", Effort.HIGH)
    with pytest.raises(ValidationError, match="effort high is of profile compact; take that, or effort default"):
        Settings(samples=True, profile="classic")


def test_nothing_to_host_says_what_to_give() -> None:
    with pytest.raises(ValidationError, match=r"give a DIRECTORY of meshes, --samples"):
        Settings()


def test_directory_must_be_a_folder(tmp_path: Path) -> None:
    with pytest.raises(ValidationError, match="there is no folder"):
        Settings(directory=tmp_path / "missing")
    (tmp_path / "spot.obj").touch()
    with pytest.raises(ValidationError, match="is a file; give the folder that holds it"):
        Settings(directory=tmp_path / "spot.obj")


def test_the_data_folder_holds_store_and_catalogue_unless_they_are_elsewhere(tmp_path: Path) -> None:
    plain = Settings(data=tmp_path)
    assert plain.keeps_meshes
    assert (plain.store_url, plain.database_url) == (f"{tmp_path}/store", f"sqlite:///{tmp_path}/catalogue.db")
    shared = Settings.model_validate({"store": "s3://meshes/a", "database": "postgresql://me:secret@host/meshes"})
    assert (shared.store_url, shared.database_url) == ("s3://meshes/a", "postgresql://me:secret@host/meshes")
    assert "secret" not in repr(shared)
    assert not Settings(samples=True).keeps_meshes


@pytest.mark.parametrize("given", [{"store": "s3://meshes"}, {"database": "sqlite:///a.db"}])
def test_a_store_without_a_catalogue_is_refused(given: dict[str, str]) -> None:
    with pytest.raises(ValidationError, match="store and database belong together"):
        Settings.model_validate({"samples": True, **given})


def test_the_address_of_the_database_may_stand_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "database"
    file.write_text("postgresql://me:secret@host/meshes\n")
    shared = Settings.model_validate({"store": "s3://meshes/a", "database_file": file})
    assert shared.database_url == "postgresql://me:secret@host/meshes"
    assert "secret" not in repr(shared)
    with pytest.raises(ValidationError, match="are the same thing"):
        Settings.model_validate({"store": "a", "database_file": file, "database": "sqlite:///a.db"})
    for content, words in ((b"\n", "its first line is empty"), (b"\xff\xfe", "it is not text"), (None, "No such file")):
        file.unlink(missing_ok=True)
        if content is not None:
            file.write_bytes(content)
        with pytest.raises(OptionError, match=words):
            assert shared.database_url
