"""Extensions that a file requires: known ones are taken, others refused by their name."""

from __future__ import annotations

import pytest

from gltf_files import read, triangle_file
from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.gltf.document import Document
from meshtide_codec.mesh_files.gltf.extensions import GEOMETRIC, is_known, is_required


@pytest.mark.parametrize("name", ["EXT_not_known", "KHR_gaussian_splatting", "MSFT_packing"])
def test_what_is_required_and_unknown_is_refused_by_name(name: str) -> None:
    with pytest.raises(MeshFileError, match=f"requires {name}, which is not known"):
        read(triangle_file(extensionsRequired=["KHR_texture_transform", name]))


def test_what_is_used_and_unknown_is_passed_over() -> None:
    assert len(read(triangle_file(extensionsUsed=["EXT_not_known"])).mesh().faces) == 1


@pytest.mark.parametrize(
    "name",
    [
        *sorted(GEOMETRIC),
        "KHR_materials_unlit",
        "KHR_materials_variants",
        "KHR_texture_basisu",
        "KHR_lights_punctual",
        "EXT_texture_webp",
        "KHR_animation_pointer",
        "KHR_node_visibility",
    ],
)
def test_known_ones_may_be_required(name: str) -> None:
    assert is_known(name)
    assert is_required(Document({"extensionsRequired": [name]}), name)
    assert len(read(triangle_file(extensionsRequired=[name])).mesh().faces) == 1


def test_names_are_shown_escaped_and_few() -> None:
    with pytest.raises(MeshFileError) as error:
        read(triangle_file(extensionsRequired=[f"\x1b[31m\ud800{i}" for i in range(1000)]))
    assert "\\x1b[31m\\ud8000" in str(error.value)
    assert len(str(error.value)) < 200
    assert "\x1b" not in str(error.value)


@pytest.mark.parametrize("value", ["EXT_a", {"EXT_a": 1}, [1], None])
def test_a_list_that_is_none_is_refused(value: object) -> None:
    with pytest.raises(MeshFileError, match="extensionsRequired of the file is not a list of names"):
        read(triangle_file(extensionsRequired=value))


def test_hidden_nodes_are_taken_and_told() -> None:
    file = triangle_file()
    file.root["nodes"][0]["extensions"] = {"KHR_node_visibility": {"visible": False}}
    scene = read(file)
    assert len(scene.mesh().faces) == 1
    assert scene.notes == ("nodes that the file hides (1): taken like the others",)
