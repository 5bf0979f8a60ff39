// Bench of the encoder's geometry; also a shared library, for comparisons with other implementations (-DSHARED).
#include "layers.hpp"
#include "surface/closest_points.hpp"
#include "surface/distance.hpp"
#include "surface/previews.hpp"

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
void measure(const double* v, long n, const int32_t* f, long m, const double* w, long k, const int32_t* g, long l,
             double* result) {
    Budget budget(1ull << 40);
    auto surface = [](const double* points, long count, const int32_t* faces, long face_count) {
        return Surface{{reinterpret_cast<const Vector*>(points), static_cast<size_t>(count)},
                       {faces, static_cast<size_t>(3 * face_count)}};
    };
    DistanceMeter meter(surface(v, n, f, m), {}, budget);
    Distortion found = meter.measure(surface(w, k, g, l));
    result[0] = found.rms, result[1] = found.maximum;
}
void* simplifier_new(const int32_t* positions, long n, const int32_t* faces, long m, int bits, long finest) {
    static Budget budget(1ull << 40);
    return new Simplifier({positions, static_cast<size_t>(3 * n)}, {faces, static_cast<size_t>(3 * m)}, bits,
                          static_cast<size_t>(finest), budget);
}
void simplifier_reduce(void* simplifier, long target, double* vertices, int32_t* faces, long* counts) {
    Budget budget(1ull << 40);
    TriangleMesh mesh(budget);
    static_cast<Simplifier*>(simplifier)->reduce(static_cast<size_t>(target), mesh);
    std::memcpy(vertices, mesh.vertices.begin(), 24 * mesh.vertices.size());
    std::memcpy(faces, mesh.faces.begin(), 4 * mesh.faces.size());
    counts[0] = static_cast<long>(mesh.vertices.size()), counts[1] = static_cast<long>(mesh.faces.size() / 3);
}
void simplifier_free(void* simplifier) { delete static_cast<Simplifier*>(simplifier); }
// Previews one behind the other: bits, vertices, faces, positions, corners.
long previews(const int32_t* positions, long n, const int32_t* faces, long m, int bits, size_t (*size)(long, int),
              int32_t* out) {
    Budget budget(1ull << 40);
    GridMesh mesh{{positions, static_cast<size_t>(3 * n)}, {faces, static_cast<size_t>(3 * m)}, bits};
    int32_t* start = out;
    for (const Preview& preview : choose_previews(
             mesh, [&](const Preview& p) { return size(static_cast<long>(p.vertex_count()), p.bits); }, budget)) {
        *out++ = preview.bits;
        *out++ = static_cast<int32_t>(preview.vertex_count());
        *out++ = static_cast<int32_t>(preview.faces.size() / 3);
        out = std::copy(preview.positions.begin(), preview.positions.end(), out);
        out = std::copy(preview.faces.begin(), preview.faces.end(), out);
    }
    return out - start;
}
void tree_free(void* handle) { delete static_cast<Handle*>(handle); }
}

#else

int main() { return 0; }

#endif
