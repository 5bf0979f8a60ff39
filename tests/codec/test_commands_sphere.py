from __future__ import annotations

from command_runner import meshtide


def test_the_spheres_table_stands_beside_the_published_one() -> None:
    text = meshtide("sphere").stdout
    assert "23.96" in text
    assert "degree 7" in text
