// The input's order: its vertices, its faces and their first corners, which quantization gives up, kept on request
// (docs/format.md, Order).
//
// A stream's vertices stand in Morton order, welded ones are one, its faces are sorted and start at their smallest
// index. Who needs the input's own order stores, behind the last packet, the stream vertex of each input vertex, by the
// steps between them, and then the corners of each face. A face is coded in one of two ways, whichever is shorter for
// the whole mesh: by its key, the corner whose vertex was first named last (files often name vertices in the order in
// which their faces need them), and which of the stream's faces of that key it is; or by its row among the stream's
// faces. Faces that quantization made degenerate or merged come back too. O(n + m log m).
#pragma once

#include "entropy/contexts.hpp"
#include "stream/header.hpp"

namespace meshtide::inline MESHTIDE_ISA {

struct InputOrder {
    explicit InputOrder(Budget& budget) : vertices(budget), faces(budget) {}

    Array<uint32_t> vertices; // of the stream, that each input vertex became
    Array<uint32_t> faces;    // input vertices, three for each input face
};

// The finest mesh of the stream: canonical faces, three corners each, below `vertices`.
struct StreamMesh {
    Span<const int32_t> faces;
    size_t vertices;
};

void encode_order(const InputOrder& order, const StreamMesh& mesh, Array<uint8_t>& payload, Budget& budget);

// A packet as it came: so many bytes of the stream besides it stand behind what it claims.
struct OrderPacket {
    Span<const uint8_t> payload;
    uint64_t other_bytes;
};
void decode_order(const OrderPacket& packet, const StreamMesh& mesh, const Limits& limits, InputOrder& order,
                  Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
