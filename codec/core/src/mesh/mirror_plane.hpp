// The plane of symmetry of a mesh (docs/format.md, Mirror).
#pragma once

#include <cstdint>

namespace meshtide {

// A plane across an axis that takes finest coordinate x to sum - x.
struct MirrorPlane {
    int axis = -1; // -1: there is none
    int32_t sum = 0;

    bool exists() const { return axis >= 0; }
    // What a coordinate along the axis, in half finest steps, and its image add up to.
    float doubled() const { return static_cast<float>(2 * (static_cast<int64_t>(sum) + 1)); }
};

} // namespace meshtide
