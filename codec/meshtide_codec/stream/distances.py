"""How far a state is from the finest mesh, as the header stores it: a little too far, and never too near.

Both distances of a state take two bytes: the root mean square is at most 1/64 too large, the maximum at most 1/4.
Nothing that is shown depends on more. All stored values are exact in a double (docs/format.md, Header).
"""

from __future__ import annotations

from ctypes import byref, c_double

from meshtide_codec import core

LARGEST = 127 / 64
"""Two points of a mesh are one diagonal apart at most, and what is drawn of it is in a cube hardly longer than that."""


def stored_distances(rms: float, maximum: float) -> tuple[float, float]:
    """The least root mean square and maximum, not below those given, that a header can hold.

    Beyond `LARGEST` that is what they become. The maximum is never below the root mean square.

    >>> stored_distances(0.01, 0.03)
    (0.010009765625, 0.030029296875)
    >>> stored_distances(0.0, 0.0)
    (0.0, 0.0)
    """
    stored_rms, stored_maximum = c_double(rms), c_double(maximum)
    core.library().mt_stored_distances(byref(stored_rms), byref(stored_maximum))
    return stored_rms.value, stored_maximum.value
