// Bench of the encoder's geometry; also a shared library, for comparisons with other implementations (-DSHARED).
#include "layers.hpp"
#include "surface/closest_points.hpp"
#include "surface/display_filter.hpp"
#include "surface/distance.hpp"
#include "surface/filters.hpp"
#include "surface/mirror.hpp"
#include "surface/order.hpp"
#include "surface/previews.hpp"
#include "surface/samples.hpp"

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
void mirror(const int32_t* positions, long n, int32_t* out) {
    Budget budget(1ull << 40);
    Mirror found = find_mirror({positions, static_cast<size_t>(3 * n)}, budget);
    out[0] = found.axis, out[1] = found.sum;
}
void strengths(const int32_t* positions, long n, const int32_t* faces, long m, int bits, int first, uint8_t* out) {
    Budget budget(1ull << 40);
    Octree octree({positions, static_cast<size_t>(3 * n)}, {faces, static_cast<size_t>(3 * m)}, bits, budget);
    Array<uint8_t> chosen(budget);
    choose_strengths(octree, first, chosen, budget);
    std::copy(chosen.begin(), chosen.end(), out);
}
// Middles and half sides of the cells; rings are given back too.
void drawn(const double* middles, const int32_t* sides, long n, const int32_t* faces, long m, int f, int g, double* out,
           uint32_t* starts, int32_t* members, uint8_t* closed) {
    Budget budget(1ull << 40);
    Rings rings(budget);
    Array<F32x4> cells(budget);
    Array<Vector> vertices(budget);
    order_rings({faces, static_cast<size_t>(3 * m)}, static_cast<size_t>(n), rings, budget);
    for (long i = 0; i < 3 * n; i += 3)
        cells.push({static_cast<float>(middles[i]), static_cast<float>(middles[i + 1]),
                    static_cast<float>(middles[i + 2]), 0.0f});
    draw({cells.span(), {sides, static_cast<size_t>(n)}}, rings, {static_cast<uint8_t>(f), static_cast<uint8_t>(g)},
         vertices, budget);
    std::memcpy(out, vertices.begin(), 24 * vertices.size());
    std::copy(rings.starts.begin(), rings.starts.end(), starts);
    std::copy(rings.members.begin(), rings.members.end(), members);
    std::copy(rings.closed.begin(), rings.closed.end(), closed);
}
void filter(const int32_t* faces, long m, const double* points, long n, const int32_t* kinds, const double* taubin,
            const float* coefficients, double* out) {
    Budget budget(1ull << 40);
    Graph graph(budget);
    auto count = static_cast<size_t>(n);
    build_graph({faces, static_cast<size_t>(3 * m)}, count, graph, budget);
    Filter filter{static_cast<FilterKind>(kinds[0]),
                  static_cast<FilterBasis>(kinds[1]),
                  static_cast<size_t>(kinds[2]),
                  static_cast<size_t>(kinds[3]),
                  taubin[0],
                  taubin[1]};
    predict(graph, filter, {coefficients, 3 * filter.coefficient_count()},
            {reinterpret_cast<const Vector*>(points), count}, {reinterpret_cast<Vector*>(out), count}, budget);
}
// Encodes, decodes and compares; the size of the packet, or -1.
long order(const uint32_t* vertices, long n, const uint32_t* faces, long m, const int32_t* stream, long k, long v) {
    Budget budget(1ull << 40);
    InputOrder input(budget), output(budget);
    input.vertices.copy({vertices, static_cast<size_t>(n)});
    input.faces.copy({faces, static_cast<size_t>(3 * m)});
    StreamMesh mesh{{stream, static_cast<size_t>(3 * k)}, static_cast<size_t>(v)};
    Array<uint8_t> payload(budget);
    encode_order(input, mesh, payload, budget);
    decode_order(payload.span(), mesh, {1u << 30, 1u << 30}, output, budget);
    bool same = std::equal(input.vertices.begin(), input.vertices.end(), output.vertices.begin()) &&
                std::equal(input.faces.begin(), input.faces.end(), output.faces.begin());
    return same ? static_cast<long>(payload.size()) : -1;
}
void tree_free(void* handle) { delete static_cast<Handle*>(handle); }
}

#else

namespace {

// Least time of some runs, in milliseconds.
template <class Work>
double least_time(int runs, Work work) {
    double least = 1e9;
    for (int i = 0; i < runs; i++) {
        double start = seconds();
        work();
        least = std::min(least, seconds() - start);
    }
    return 1e3 * least;
}

struct Loaded {
    explicit Loaded(const std::string& path) : sample(load_sample(path)) {
        for (size_t i = 0; i < sample.positions.size(); i += 3)
            points.push_back({static_cast<double>(sample.positions[i]), static_cast<double>(sample.positions[i + 1]),
                              static_cast<double>(sample.positions[i + 2])});
    }
    Surface surface() const { return {{points.data(), points.size()}, {sample.faces.data(), sample.faces.size()}}; }
    GridMesh grid() const {
        return {{sample.positions.data(), sample.positions.size()},
                {sample.faces.data(), sample.faces.size()},
                sample.bits};
    }
    Sample sample;
    std::vector<Vector> points;
};

void bench(const Loaded& mesh, int runs) {
    Budget budget(1ull << 40);
    std::unique_ptr<ClosestPoints> tree;
    double build = least_time(runs, [&] { tree = std::make_unique<ClosestPoints>(mesh.surface(), budget); });
    std::vector<Foot> feet(20000);
    sample(tree->faces(), 7, {feet.data(), feet.size()});
    std::vector<Vector> points;
    for (size_t i = 0; i < feet.size(); i++) { // up to 8 steps off the surface
        Vector normal = mesh.surface().normal(static_cast<size_t>(feet[i].face));
        double size = length(normal);
        Vector on = feet[i].on(mesh.surface());
        points.push_back(size > 0.0 ? on + normal * ((static_cast<double>(i % 17) - 8.0) / size) : on);
    }
    Spread spread;
    double search = least_time(runs, [&] { spread = tree->spread({points.data(), points.size()}); });
    TriangleMesh reduced(budget);
    size_t n = mesh.points.size();
    double simplify = least_time(runs, [&] {
        Simplifier simplifier(mesh.grid().positions, mesh.grid().faces, mesh.sample.bits, n / 40, budget);
        simplifier.reduce(n / 40, reduced);
    });
    double fit = least_time(runs, [&] {
        TriangleMesh copy(budget);
        copy.vertices.copy(reduced.vertices.span());
        copy.faces.copy(reduced.faces.span());
        Refitter refitter(*tree, copy.faces.span(), copy.vertices.size(), budget);
        refitter.fit(copy.vertices.span());
    });
    size_t count = 0;
    double choice = least_time(std::min(runs, 3), [&] {
        count = choose_previews(
                    mesh.grid(),
                    [](const Preview& p) { return p.vertex_count() * static_cast<size_t>(9 + p.bits * 3 / 2); }, budget)
                    .size();
    });
    Octree octree(mesh.grid().positions, mesh.grid().faces, mesh.sample.bits, budget);
    Array<uint8_t> chosen(budget);
    double strengths = least_time(runs, [&] { choose_strengths(octree, 3, chosen, budget); });
    Mirror mirror;
    double mirrored = least_time(runs, [&] { mirror = find_mirror(mesh.grid().positions, budget); });
    if (mirror.axis != mesh.sample.mirror_axis || mirror.sum != mesh.sample.mirror_sum)
        std::printf("the mirror differs: axis %d sum %d\n", mirror.axis, mirror.sum);
    std::printf("%-22s strengths %6.2f ms, mirror %6.2f ms\n", mesh.sample.name.c_str(), strengths, mirrored);
    std::printf("%-22s tree %6.2f ms, search %5.0f ns (visits %.1f, rms %.4f), simplify %6.2f ms, fit %6.2f ms, "
                "%zu previews %6.1f ms\n",
                mesh.sample.name.c_str(), build, 1e6 * search / static_cast<double>(points.size()),
                tree->visits_per_search({points.data(), points.size()}), std::sqrt(spread.mean), simplify, fit, count,
                choice);
}

} // namespace

int main(int argc, char** argv) {
    int runs = 5;
    for (int i = 1; i < argc; i++) {
        if (std::string(argv[i]) == "-n")
            runs = std::atoi(argv[++i]);
        else
            bench(Loaded(argv[i]), runs);
    }
    return 0;
}

#endif
