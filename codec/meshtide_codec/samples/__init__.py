"""Sample meshes that ship with the package; their origins and licences are in LICENSES.md beside them.

Each is one compressed numpy archive of float32 vertices and int32 faces, made by tools/make_samples.py.
"""

from __future__ import annotations

from importlib import resources

import numpy as np

from meshtide_codec.errors import OptionError
from meshtide_codec.mesh import Mesh

_NAMES = ("spot", "stanford-bunny")


def sample_names() -> tuple[str, ...]:
    """Names of the samples, smallest first."""
    return _NAMES


def load_sample(name: str) -> Mesh:
    """One of the samples.

    Raises:
        OptionError: there is none of that name.

    >>> load_sample("spot")
    Mesh(2930 vertices, 5856 faces)
    """
    if name not in _NAMES:
        raise OptionError(f"there is no sample {name!r}; there are {', '.join(_NAMES)}")
    with (resources.files(__name__) / f"{name}.npz").open("rb") as file, np.load(file) as arrays:
        return Mesh.checked(arrays["vertices"].T, arrays["faces"].T)
