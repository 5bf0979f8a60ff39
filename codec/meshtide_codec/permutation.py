"""Which stream vertex each input vertex became: the order that quantization gives up, kept on request.

A stream's vertices stand in Morton order and welded ones are one. Who needs the input's own order, for attributes that
are kept elsewhere, stores this table behind the last packet. Payload: the number of input vertices, then their stream
vertices by the steps between them, which are short where the input's order follows its surface. Cost: O(n).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from meshtide_codec import permutation_kernels
from meshtide_codec.entropy import codec as entropy
from meshtide_codec.entropy.model_kernels import SIGNED_CONTEXTS, new_contexts
from meshtide_codec.errors import PacketError
from meshtide_codec.mesh import Mesh
from meshtide_codec.stream.packets import Packet, PacketKind
from meshtide_codec.stream.parts import read_number, write_number
from meshtide_codec.stream.plain_values import BadValueError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from meshtide_codec.limits import Limits


def permutation_packet(permutation: NDArray[np.int64], vertices: int) -> Packet:
    """The packet that holds `permutation` (input vertices,), indices below `vertices`."""
    payload = entropy.encoded(
        lambda coder, buffer: permutation_kernels.code_steps(
            coder, buffer, new_contexts(SIGNED_CONTEXTS), permutation.copy(), vertices
        ),
        2 * len(permutation),
    )
    return Packet(PacketKind.PERMUTATION, 0, 0, write_number(len(permutation)) + payload)


def read_permutation(packet: Packet, vertices: int, limits: Limits) -> NDArray[np.int64]:
    """The table (input vertices,) int64 that `permutation_packet` wrote.

    Raises:
        PacketError: the packet is damaged.
        LimitError: it claims more vertices than `limits` allow.
    """
    label = packet.kind.label
    try:
        count, start = read_number(packet.payload, 0)
    except BadValueError as error:
        raise PacketError(f"{error}; the stream is damaged", packet=label, offset=0) from error
    limits.check_mesh(count, 0)
    permutation = np.zeros(count, np.int64)
    payload = packet.payload[start:]
    coder, buffer = entropy.opened(payload)
    status = permutation_kernels.code_steps(coder, buffer, new_contexts(SIGNED_CONTEXTS), permutation, vertices)
    if status != permutation_kernels.OK or not entropy.fully_read(coder, payload):
        raise PacketError(f"it does not hold {count} indices below {vertices}; the stream is damaged", packet=label)
    return permutation


def in_input_order(mesh: Mesh, permutation: NDArray[np.int64]) -> Mesh:
    """The finest level with the input's vertices in the input's order; faces use the first of those that were welded.

    >>> mesh = Mesh.checked([[0, 0, 0], [0, 1, 0], [1, 0, 0]], [[0, 2, 1]])
    >>> in_input_order(mesh, np.array([2, 0, 1, 2])).faces.tolist()
    [[1, 0, 2]]
    """
    first = np.zeros(len(mesh.vertices), np.int64)
    first[permutation[::-1]] = np.arange(len(permutation))[::-1]
    return Mesh(mesh.vertices[permutation], first[mesh.faces])
