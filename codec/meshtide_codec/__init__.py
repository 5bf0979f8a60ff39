"""meshtide's codec: meshes to progressive streams and back; numpy in, bytes out.

The names below load what they need on first use, so importing the package costs nothing.

>>> import meshtide_codec
>>> mesh = meshtide_codec.load_sample("spot")
>>> encoded = meshtide_codec.encode(mesh)
>>> meshtide_codec.decode(encoded.to_bytes(), level=6)
Mesh(2611 vertices, 5218 faces)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshtide_codec.attributes import Attribute
    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.compact.options import CompactOptions
    from meshtide_codec.decoder import Decoder, LevelUpdate, decode
    from meshtide_codec.encoder import EncodedMesh, encode
    from meshtide_codec.errors import MeshtideError
    from meshtide_codec.filters import FilterSpec
    from meshtide_codec.grid import Grid
    from meshtide_codec.limits import FileLimits, Limits
    from meshtide_codec.merging import Merging, merged_by_quantization
    from meshtide_codec.mesh import Mesh
    from meshtide_codec.mesh_files import load_mesh, load_scene, save_mesh, save_scene
    from meshtide_codec.order import Order, in_input_order
    from meshtide_codec.packets import Packet, PacketKind
    from meshtide_codec.quantize import QuantizedMesh
    from meshtide_codec.samples import load_sample, sample_names
    from meshtide_codec.scene import Scene
    from meshtide_codec.stream.container import ContainerReader, read_available, read_container
    from meshtide_codec.stream.header import StreamHeader

_HOMES = {
    "Attribute": "attributes",
    "ClassicOptions": "classic.options",
    "CompactOptions": "compact.options",
    "ContainerReader": "stream.container",
    "Decoder": "decoder",
    "EncodedMesh": "encoder",
    "FileLimits": "limits",
    "FilterSpec": "filters",
    "Grid": "grid",
    "LevelUpdate": "decoder",
    "Limits": "limits",
    "Merging": "merging",
    "Mesh": "mesh",
    "MeshtideError": "errors",
    "Order": "order",
    "Packet": "packets",
    "PacketKind": "packets",
    "QuantizedMesh": "quantize",
    "Scene": "scene",
    "StreamHeader": "stream.header",
    "decode": "decoder",
    "encode": "encoder",
    "in_input_order": "order",
    "load_mesh": "mesh_files",
    "load_sample": "samples",
    "load_scene": "mesh_files",
    "merged_by_quantization": "merging",
    "read_available": "stream.container",
    "read_container": "stream.container",
    "sample_names": "samples",
    "save_mesh": "mesh_files",
    "save_scene": "mesh_files",
}

__all__ = [
    "Attribute",
    "ClassicOptions",
    "CompactOptions",
    "ContainerReader",
    "Decoder",
    "EncodedMesh",
    "FileLimits",
    "FilterSpec",
    "Grid",
    "LevelUpdate",
    "Limits",
    "Merging",
    "Mesh",
    "MeshtideError",
    "Order",
    "Packet",
    "PacketKind",
    "QuantizedMesh",
    "Scene",
    "StreamHeader",
    "decode",
    "encode",
    "in_input_order",
    "load_mesh",
    "load_sample",
    "load_scene",
    "merged_by_quantization",
    "read_available",
    "read_container",
    "sample_names",
    "save_mesh",
    "save_scene",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
