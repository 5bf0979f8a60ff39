from __future__ import annotations

import subprocess
import sys

import numba

from meshtide_codec.compilation import announced_compilation


def test_a_compilation_is_announced_once_and_a_loaded_kernel_not_at_all() -> None:
    announcements: list[str] = []

    @numba.njit
    def double(value: int) -> int:
        return 2 * value

    @numba.njit
    def halve(value: float) -> float:
        return value / 2

    with announced_compilation(lambda: announcements.append("compiling")):
        assert double(2) == 4
        assert halve(2.0) == 1.0
    assert announcements == ["compiling"]
    with announced_compilation(lambda: announcements.append("again")):
        assert double(3) == 6
    assert announcements == ["compiling"]


def test_importing_the_package_loads_nothing_heavy() -> None:
    heavy = {"numba", "numpy", "scipy", "trimesh"}
    script = f"import sys, meshtide_codec, meshtide_codec.commands; print(sorted(set(sys.modules) & {heavy}))"
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_exported_names_are_those_that_load() -> None:
    import meshtide_codec

    assert sorted(meshtide_codec._HOMES) == meshtide_codec.__all__ == dir(meshtide_codec)
    for name in meshtide_codec.__all__:
        assert getattr(meshtide_codec, name).__name__.lower() == name.lower()
    assert not hasattr(meshtide_codec, "nothing")
