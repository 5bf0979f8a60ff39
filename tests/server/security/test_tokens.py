from pathlib import Path

import pytest
from pydantic import SecretStr

from meshtide_codec.errors import OptionError
from meshtide_server.security.tokens import LARGEST_FILE, TokenSet, collect_tokens

FIRST, SECOND = "first-token-of-many", "second-token-of-many"


def test_each_of_several_tokens_is_known_and_no_other() -> None:
    tokens = TokenSet([FIRST, SECOND])
    assert FIRST in tokens
    assert SECOND in tokens
    for wrong in ("", FIRST[:-1], FIRST + " ", FIRST.upper(), FIRST + "\n" + SECOND, "\udcff"):
        assert wrong not in tokens


def test_no_tokens_let_nobody_pass() -> None:
    assert not TokenSet([])
    assert "" not in TokenSet([])


def test_a_set_does_not_show_its_tokens() -> None:
    assert FIRST not in repr(TokenSet([FIRST])) + str(vars(TokenSet([FIRST])))


def test_environment_and_file_are_joined(tmp_path: Path) -> None:
    file = tmp_path / "tokens"
    file.write_text(f"# for the museum\n\n  {SECOND}\n{FIRST}\n")
    assert collect_tokens([SecretStr(FIRST)], file, "write") == (FIRST, SECOND)


@pytest.mark.parametrize(
    "token", ["short", "x" * 513, "white space in a token", "ünïcödé-in-a-token", "comma,in,a,token"]
)
def test_a_bad_token_is_refused_without_being_shown(token: str) -> None:
    with pytest.raises(OptionError, match="MESHTIDE_READ_TOKENS, token 1: a token") as caught:
        collect_tokens([SecretStr(token)], None, "read")
    assert token not in str(caught.value)


def test_files_that_hold_no_tokens_are_refused(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="cannot be read"):
        collect_tokens([], tmp_path / "missing", "write")
    file = tmp_path / "tokens"
    file.write_text("# nothing\n")
    with pytest.raises(OptionError, match="holds no token"):
        collect_tokens([], file, "write")
    file.write_bytes(b"x" * (LARGEST_FILE + 1))
    with pytest.raises(OptionError, match="more than"):
        collect_tokens([], file, "write")
    file.write_text(f"{FIRST}\nsecret\n")
    with pytest.raises(OptionError, match="line 2") as caught:
        collect_tokens([], file, "write")
    assert "secret" not in str(caught.value).replace("secrets", "")
