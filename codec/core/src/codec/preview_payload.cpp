#include "codec/preview_payload.hpp"

#include "stream/numbers.hpp"

namespace meshtide::inline MESHTIDE_ISA {

void encode_preview(const Octree& octree, EncoderLayers& layers, Array<uint8_t>& payload, Budget& budget) {
    Array<uint8_t> coded(budget);
    layers.encode_preview(coded);
    int leaf_depth = static_cast<int>(octree.depths.size()) - 1;
    payload.clear();
    write_number(payload, static_cast<uint64_t>(octree.bits * (octree.bits + 1) / 2 + leaf_depth));
    for (uint8_t byte : coded) payload.push(byte);
}

} // namespace meshtide::inline MESHTIDE_ISA
