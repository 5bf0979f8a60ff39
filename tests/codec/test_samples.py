from __future__ import annotations

from importlib import resources

import pytest

from meshtide_codec.errors import OptionError
from meshtide_codec.samples import load_sample, sample_names


def test_the_samples_are_there_with_their_sizes_and_licences() -> None:
    sizes = {name: (len(load_sample(name).vertices), len(load_sample(name).faces)) for name in sample_names()}
    assert sizes == {"spot": (2930, 5856), "stanford-bunny": (34834, 69451)}
    notes = (resources.files("meshtide_codec.samples") / "LICENSES.md").read_text()
    assert all(f"{name}.npz" in notes for name in sizes)
    assert "Stanford 3D Scanning Repository" in notes


def test_unknown_samples() -> None:
    with pytest.raises(OptionError, match="no sample 'teapot'"):
        load_sample("teapot")
