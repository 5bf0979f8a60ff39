// How far two meshes are from each other: symmetric distance of their surfaces, as fractions of the original's size.
//
// Points spread evenly over each surface are searched for on the other. The root mean square is that of the worse
// direction, the maximum that over both, over samples and all vertices; both are divided by the diagonal of the
// original's bounding box: the convention of Cignoni, Rocchini, Scopigno, "Metro: measuring error on simplified
// surfaces", Computer Graphics Forum 17 (1998), section 3. O((m + samples) log m) a measurement.
#pragma once

#include "surface/closest_points.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// As fractions of the diagonal of the original's bounding box; of a mesh without extent in its own unit.
struct Distortion {
    double rms = 0, maximum = 0;
};

struct DistanceOptions {
    size_t samples = 8000;       // of each surface: good to 1 % of the root mean square
    size_t vertex_limit = 65536; // vertices of each mesh that the maximum looks at; of more, every second and so on
    uint64_t seed = 1;
};

// Measures meshes against one original, which is made ready once. Meshes without faces are the sets of their vertices,
// of which there is at least one.
class DistanceMeter {
public:
    DistanceMeter(Surface original, const DistanceOptions& options, Budget& budget);

    // Threads that have budgets of their own may measure at the same time.
    Distortion measure(Surface other, Budget& budget) const;

private:
    DistanceOptions options_;
    Vector centre_;
    double scale_ = 1.0;
    Array<Vector> vertices_; // about the origin, with the diagonal as the unit
    Array<int32_t> faces_;   // only if the original has none: one for each vertex
    CurvePoints samples_, used_;
    ClosestPoints tree_;
};

} // namespace meshtide::inline MESHTIDE_ISA
