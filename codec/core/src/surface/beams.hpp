// Beams: tight bounds of long thin triangles, where boxes along the axes are loose.
//
// Thousands of slivers around one vertex, or along a turned cylinder, have boxes that all hold the same points, and a
// search among boxes alone visits most of them. A beam is the set of points within a radius of a line. A part of the
// search tree gets one if its triangles fit a beam that is much thinner than its box: then a wedge of a fan keeps away
// all points outside of its angle. In the spirit of Gottschalk, Lin, Manocha, "OBBTree: a hierarchical structure for
// rapid interference detection", SIGGRAPH 1996, but only where it pays.
#pragma once

#include "surface/geometry.hpp"

namespace meshtide::inline MESHTIDE_ISA {

struct Beam {
    Vector point, direction; // of length 1
    double radius = 0;

    // The square of a distance that all triangles in the beam have at least from a point.
    double squared_distance(Vector from) const;
};

// The triangles of a part of the tree: order[first], ..., order[end - 1].
struct BeamRange {
    Span<const uint32_t> order;
    size_t first, end;
    Vector sides;     // of their box
    uint32_t longest; // edge, as 3 face + corner where it begins
};

// Diagonals of boxes are at most so many longest edges where there can be a beam.
constexpr double SPANNED = 4.0;
// And at least so many radii of the beam.
constexpr double THIN = 8.0;

enum class Thinness { wide, thin, worth_a_beam };

// Whether the triangles fit a beam along their longest edge, which is then filled in; only one that is worth it is to
// be kept, but ranges of two thin ones may be thin again. O(triangles).
Thinness find_beam(const Surface& surface, const BeamRange& range, Beam& beam);

} // namespace meshtide::inline MESHTIDE_ISA
