// Leaves of a slice and their images in the plane of symmetry (docs/format.md, Mirror).
#pragma once

#include "diff/slice.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// What is known from the image of an owner's partner.
struct Reflection {
    F32x4 offset = {}; // from the owner, in half cells; the fourth lane: 1 if the partner is known
    int state = 0;     // 0: there is no partner; 1 + verdict, and 4 more if the partner is known
    static constexpr int STATES = 9;
    static constexpr int TRUSTED = 7; // from here on it is known, and no partner of a neighbour differs, or few are
    static constexpr int KNOWN = 5;
};

class DiffMirror {
public:
    // depth: of the bit plane, whose half cells are `half` half finest steps long.
    DiffMirror(DiffSlice& slice, int depth, float half) : slice_(slice), depth_(depth), half_(half) {}

    // Gives each owner without a partner the leaf nearest to its image, from the same row of cells along the axis.
    void find_partners(Budget& budget);

    Reflection look(size_t owner) const;

    // Notes whether the owner lies where the reflection has put it, now that its steps are known.
    void compare(size_t owner, const Reflection& reflection, F32x4 steps);

private:
    DiffSlice& slice_;
    int depth_;
    float half_;
};

} // namespace meshtide::inline MESHTIDE_ISA
