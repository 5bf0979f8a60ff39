// Bench of the encoder's geometry; also a shared library, for comparisons with other implementations (-DSHARED).
#include "layers.hpp"
#include "surface/closest_points.hpp"

#include <algorithm>
#include <cmath>

using namespace meshtide;

#ifdef SHARED

extern "C" {

struct Handle {
    Budget budget{1ull << 40};
    std::unique_ptr<ClosestPoints> tree;
};

void* tree_new(const double* vertices, long n, const int32_t* faces, long m) {
    auto* handle = new Handle;
    Surface surface{{reinterpret_cast<const Vector*>(vertices), static_cast<size_t>(n)},
                    {faces, static_cast<size_t>(3 * m)}};
    handle->tree = std::make_unique<ClosestPoints>(surface, handle->budget);
    return handle;
}
void tree_closest(void* handle, const double* points, long k, double* squared, int32_t* faces, double* weights) {
    const ClosestPoints& tree = *static_cast<Handle*>(handle)->tree;
    size_t hint = tree.order()[0];
    for (long i = 0; i < k; i++) {
        Closest found = tree.closest({points[3 * i], points[3 * i + 1], points[3 * i + 2]}, hint);
        squared[i] = found.squared;
        faces[i] = found.foot.face;
        hint = static_cast<size_t>(found.foot.face);
        for (size_t c = 0; c < 3; c++) weights[3 * i + static_cast<long>(c)] = found.foot.weight(c);
    }
}
double tree_visits(void* handle, const double* points, long k) {
    return static_cast<Handle*>(handle)->tree->visits_per_search(
        {reinterpret_cast<const Vector*>(points), static_cast<size_t>(k)});
}
void tree_free(void* handle) { delete static_cast<Handle*>(handle); }
}

#else

int main() { return 0; }

#endif
