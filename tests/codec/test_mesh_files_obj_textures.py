from __future__ import annotations

import pytest

from meshtide_codec.mesh_files.obj.textures import texture_line


@pytest.mark.parametrize(
    ("line", "name", "options"),
    [
        ("map_Kd a.png", "a.png", {}),
        ("MAP_KD\ta b  c.png ", "a b  c.png", {}),
        ("map_Kd -s 1 2 3 a.png", "a.png", {"-s": ("1", "2", "3")}),
        ("map_Kd -o 1 -s 2 2 a b.png", "a b.png", {"-o": ("1",), "-s": ("2", "2")}),
        ("map_Kd -S .5 1e-1 0001.png", "0001.png", {"-s": (".5", "1e-1")}),
        ("map_Kd -s 1 1 1 7", "7", {"-s": ("1", "1", "1")}),
        ("map_Kd -s 1 7", "7", {"-s": ("1",)}),
        ("bump -bm 0.3 -clamp on b.png", "b.png", {"-bm": ("0.3",), "-clamp": ("on",)}),
        (
            "map_Kd -mm 0 1 -blendu off -type sphere c.png",
            "c.png",
            {"-mm": ("0", "1"), "-blendu": ("off",), "-type": ("sphere",)},
        ),
        ("map_Kd -unknown 1 a.png", "-unknown 1 a.png", {}),
        (r"map_Kd C:\tex\a.png", r"C:\tex\a.png", {}),
    ],
)
def test_names_and_options(line: str, name: str, options: dict[str, tuple[str, ...]]) -> None:
    found = texture_line(line)
    assert found is not None
    assert (found.name, dict(found.options)) == (name, options)
    assert line.split() == f"{found.before} {found.name}".split()


@pytest.mark.parametrize("line", ["", "Kd 1 0 0", "map_Kd", "map_Kd -s", "map_x a.png"])
def test_lines_that_name_no_image(line: str) -> None:
    found = texture_line(line)
    assert found is None or found.name == "-s"
