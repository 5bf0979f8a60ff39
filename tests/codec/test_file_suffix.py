from __future__ import annotations

from pathlib import PurePath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.file_suffix import split_name


@pytest.mark.parametrize(
    ("name", "stem", "suffix"),
    [
        ("a/b.c/scan.obj", "scan", ".obj"),
        ("scan.OBJ.GZ", "scan", ".OBJ.GZ"),
        ("scan.tide.gz", "scan", ".tide.gz"),
        ("scan.gz", "scan", ".gz"),
        ("scan.gz.gz", "scan", ".gz.gz"),
        (".ply.gz", ".ply", ".gz"),
        (".ply", ".ply", ""),
        ("gz", "gz", ""),
        ("", "", ""),
    ],
)
def test_names_are_cut_before_the_suffix(name: str, stem: str, suffix: str) -> None:
    assert split_name(name) == split_name(PurePath(name)) == (stem, suffix)


@given(st.text("ab.gzGZ", max_size=12))
def test_the_two_parts_are_the_name(name: str) -> None:
    assert "".join(split_name(name)) == PurePath(name).name
