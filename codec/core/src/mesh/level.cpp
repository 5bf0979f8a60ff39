#include "mesh/level.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

void link(Level& level, Budget& budget) {
    size_t faces = level.face_count(), vertices = level.vertex_count();
    level.twins.assign(4 * faces, NONE);
    level.heads.assign(vertices, NONE);
    level.degrees.assign(vertices, 0);

    // The half-edges of each vertex, by counting.
    Array<uint32_t> starts(budget), leaving(budget);
    starts.assign(vertices + 1, 0);
    auto corner = [&](size_t h) { return static_cast<size_t>(level.corners[h]); };
    for (size_t t = 0; t < faces; t++)
        for (size_t k = 0; k < 3; k++) level.degrees[corner(4 * t + k)]++;
    for (size_t v = 0; v < vertices; v++) starts[v + 1] = starts[v] + level.degrees[v];
    leaving.resize(3 * faces);
    for (size_t t = 0; t < faces; t++)
        for (size_t k = 0; k < 3; k++) leaving[starts[corner(4 * t + k)]++] = static_cast<uint32_t>(4 * t + k);
    for (size_t v = vertices; v > 0; v--) starts[v] = starts[v - 1];
    starts[0] = 0;

    for (size_t v = 0; v < vertices; v++) {
        for (size_t i = starts[v]; i < starts[v + 1]; i++) {
            auto h = static_cast<int32_t>(leaving[i]);
            if (level.twins[static_cast<size_t>(h)] >= 0) continue;
            size_t to = corner(static_cast<size_t>(next_half_edge(h)));
            for (size_t j = starts[to]; j < starts[to + 1]; j++) {
                auto back = static_cast<int32_t>(leaving[j]);
                if (level.twins[static_cast<size_t>(back)] >= 0 || back == h) continue;
                if (corner(static_cast<size_t>(next_half_edge(back))) != v) continue;
                level.twins[static_cast<size_t>(h)] = back;
                level.twins[static_cast<size_t>(back)] = h;
                break;
            }
        }
    }
    for (size_t t = faces; t-- > 0;) {
        for (size_t k = 3; k-- > 0;) {
            size_t h = 4 * t + k, v = corner(h);
            int32_t head = level.heads[v];
            if (head < 0 || level.twins[static_cast<size_t>(head)] >= 0 || level.twins[h] < 0)
                level.heads[v] = static_cast<int32_t>(h);
        }
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
