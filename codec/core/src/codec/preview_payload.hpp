// A preview as a packet: a whole mesh on a grid of its own, coded in one go (docs/format.md, Previews).
#pragma once

#include "codec/effort_layers.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// The payload by layers that have coded nothing yet: a number that gives the bits and the depth at which all vertices
// are alone in their cells, then the levels down to it and all bit planes.
void encode_preview(const Octree& octree, EncoderLayers& layers, Array<uint8_t>& payload, Budget& budget);

} // namespace meshtide::inline MESHTIDE_ISA
