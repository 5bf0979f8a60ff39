"""The suffix of a mesh file's name, which is two for one that is packed: of scan.ply.gz, .ply.gz."""

from __future__ import annotations

from pathlib import PurePath
from typing import NamedTuple

GZIP_SUFFIX = ".gz"


class SplitName(NamedTuple):
    """A file's name without its folders, cut in two.

    Attributes:
        stem: what is before the suffix.
        suffix: as it is written; with the one before it, if it is that of gzip.
    """

    stem: str
    suffix: str


def split_name(path: PurePath | str) -> SplitName:
    """The stem and the suffix of a file.

    >>> split_name("scans/Scan.v2.PLY.gz")
    SplitName(stem='Scan.v2', suffix='.PLY.gz')
    >>> split_name("scan.ply").suffix, split_name("scan.gz").suffix, split_name("-").suffix
    ('.ply', '.gz', '')
    """
    name = PurePath(path)
    if name.suffix.lower() != GZIP_SUFFIX:
        return SplitName(name.stem, name.suffix)
    inner = PurePath(name.stem)
    return SplitName(inner.stem, inner.suffix + name.suffix)
