from pathlib import Path

import pytest

from meshtide_client.connection.credentials import find_token
from meshtide_client.connection.link import Link
from meshtide_codec.errors import OptionError


@pytest.fixture(autouse=True)
def _no_token(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MESHTIDE_TOKEN", raising=False)
    monkeypatch.delenv("MESHTIDE_TOKEN_FILE", raising=False)


def test_the_environment_holds_the_token_or_names_its_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert find_token() is None
    file = tmp_path / "token"
    file.write_text("# mine\n\nfrom-the-file\nanother\n")
    monkeypatch.setenv("MESHTIDE_TOKEN_FILE", str(file))
    assert find_token() == "from-the-file"
    monkeypatch.setenv("MESHTIDE_TOKEN", "from-the-environment")
    assert find_token() == "from-the-environment"
    assert find_token(file) == "from-the-file"


def test_a_link_does_not_show_its_token(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MESHTIDE_TOKEN", "from-the-environment")
    assert Link().token == "from-the-environment"  # noqa: S105
    assert "from-the-environment" not in repr(Link())
    assert Link(retries=2).without_token() == Link(retries=2, token=None)


@pytest.mark.parametrize("content", ["", "# nothing\n", "two words\n", "ünïcödé\n"])
def test_what_is_no_token_is_told_without_showing_it(content: str, tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text(content, encoding="utf-8")
    with pytest.raises(OptionError, match="holds no token") as caught:
        find_token(file)
    assert "words" not in str(caught.value)


def test_a_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="cannot be read"):
        find_token(tmp_path / "missing")
