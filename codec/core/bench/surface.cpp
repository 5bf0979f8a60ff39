// Bench of the encoder's geometry.
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
    tree->sample(7, {feet.data(), feet.size()}, budget);
    std::vector<Vector> points;
    CurvePoints curve_points(budget);
    tree->sampled(feet.size(), 7, curve_points, budget);
    for (size_t i = 0; i < feet.size(); i++) { // up to 8 steps off the surface
        Vector normal = mesh.surface().normal(static_cast<size_t>(feet[i].face));
        double size = length(normal);
        Vector on = feet[i].on(mesh.surface());
        points.push_back(size > 0.0 ? on + normal * ((static_cast<double>(i % 17) - 8.0) / size) : on);
        curve_points.at[i] = points.back();
    }
    Spread spread;
    double search = least_time(runs, [&] { spread = tree->spread(curve_points); });
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
    MirrorPlane mirror;
    double mirrored = least_time(runs, [&] { mirror = find_mirror(mesh.grid().positions, budget); });
    if (mirror.axis != mesh.sample.mirror_axis || mirror.sum != mesh.sample.mirror_sum)
        std::printf("the mirror differs: axis %d sum %d\n", mirror.axis, mirror.sum);
    std::vector<Vector> coarse; // as a level is drawn: the middles of cells of 16 steps
    for (Vector v : mesh.points) {
        auto middle = [](double at) { return std::floor(at / 16.0) * 16.0 + 7.5; };
        coarse.push_back({middle(v.x), middle(v.y), middle(v.z)});
    }
    DistanceMeter meter(mesh.surface(), {}, budget);
    double distance = least_time(runs, [&] {
        meter.measure({{coarse.data(), coarse.size()}, mesh.surface().faces}, budget);
    });
    std::printf("%-22s a distance %6.2f ms, strengths %6.2f ms, mirror %6.2f ms\n", mesh.sample.name.c_str(), distance,
                strengths, mirrored);
    std::printf("%-22s tree %6.2f ms, search %5.0f ns (visits %.1f, rms %.4f), simplify %6.2f ms, fit %6.2f ms, "
                "%zu previews %6.1f ms\n",
                mesh.sample.name.c_str(), build, 1e6 * search / static_cast<double>(points.size()),
                tree->visits_per_search({points.data(), points.size()}), std::sqrt(spread.mean), simplify, fit, count,
                choice);
}

// A checksum of everything that is made of a mesh, to compare builds by.
uint64_t checksum(const Loaded& mesh) {
    Budget budget(1ull << 40);
    uint64_t sum = 0xcbf29ce484222325;
    auto add = [&](const void* from, size_t bytes) {
        for (size_t i = 0; i < bytes; i++) sum = (sum ^ static_cast<const uint8_t*>(from)[i]) * 0x100000001b3;
    };
    for (const Preview& preview : choose_previews(
             mesh.grid(), [](const Preview& p) { return p.vertex_count() * static_cast<size_t>(9 + p.bits * 3 / 2); },
             budget)) {
        add(preview.positions.begin(), 4 * preview.positions.size());
        add(preview.faces.begin(), 4 * preview.faces.size());
        std::vector<Vector> vertices;
        double step = 4095.0 / ((1 << preview.bits) - 1);
        for (size_t i = 0; i < preview.positions.size(); i += 3)
            vertices.push_back(Vector{static_cast<double>(preview.positions[i]),
                                      static_cast<double>(preview.positions[i + 1]),
                                      static_cast<double>(preview.positions[i + 2])} *
                               step);
        Distortion found = DistanceMeter(mesh.surface(), {}, budget)
                               .measure({{vertices.data(), vertices.size()}, preview.faces.span()}, budget);
        add(&found, sizeof found);
    }
    Octree octree(mesh.grid().positions, mesh.grid().faces, mesh.sample.bits, budget);
    Array<uint8_t> chosen(budget);
    choose_strengths(octree, 1, chosen, budget);
    add(chosen.begin(), chosen.size());
    for (int depth = 4; depth < octree.bits; depth++) {
        Level level(budget);
        octree.make_level(depth, level, budget);
        Rings rings(budget);
        order_rings(octree.at(depth).faces.span(), level.vertex_count(), rings, budget);
        Array<int32_t> sides(budget);
        for (uint8_t at : level.cell_depths) sides.push(1 << (octree.bits - at));
        Array<Vector> drawn(budget);
        draw({level.centres.span(), sides.span()}, rings, STRENGTHS[chosen[static_cast<size_t>(depth) - 1]], drawn,
             budget);
        add(drawn.begin(), 24 * drawn.size());
    }
    return sum;
}

// An order as of a file whose vertices stand in another order, some of them twice.
void make_order(const Loaded& mesh, const Octree& octree, InputOrder& order) {
    auto n = static_cast<uint32_t>(mesh.points.size());
    auto scattered = [&](uint32_t i) { return static_cast<uint32_t>(static_cast<uint64_t>(i) * 7919 % n); };
    for (uint32_t i = 0; i < n + n / 8; i++) order.vertices.push(scattered(i % n));
    std::vector<uint32_t> first(n);
    for (uint32_t i = 0; i < n; i++) first[scattered(i)] = i;
    bool all = n % 7919 != 0;
    const Array<int32_t>& faces = octree.depths.back().faces;
    for (size_t t = 0; t + 2 < faces.size() && all; t += 3)
        for (size_t k = 0; k < 3; k++) {
            uint32_t v = first[static_cast<size_t>(faces[t + (k + t) % 3])];
            order.faces.push(v + n < order.vertices.size() && t % 2 == 0 ? v + n : v);
        }
    for (uint32_t v : {0u, 0u, n - 1}) order.faces.push(v); // a face that has vanished
}

// Decodes damaged packets of the input's order, and filters with damaged coefficients; counts what is refused.
void damage(const Loaded& mesh, int rounds) {
    Budget budget(1ull << 32);
    Octree octree(mesh.grid().positions, mesh.grid().faces, mesh.sample.bits, budget);
    StreamMesh stream{octree.depths.back().faces.span(), mesh.points.size()};
    InputOrder order(budget);
    make_order(mesh, octree, order);
    Array<uint8_t> payload(budget), damaged(budget);
    encode_order(order, stream, payload, budget);
    InputOrder decoded(budget);
    Limits limits;
    limits.vertices = 4 * order.vertices.size(), limits.faces = 4 * order.faces.size();
    decode_order({payload.span(), 0}, stream, limits, decoded, budget);
    bool same = order.vertices.size() == decoded.vertices.size() && order.faces.size() == decoded.faces.size() &&
                std::equal(order.vertices.begin(), order.vertices.end(), decoded.vertices.begin()) &&
                std::equal(order.faces.begin(), order.faces.end(), decoded.faces.begin());
    int refused = 0;
    uint64_t random = 88172645463325252ull;
    auto next = [&] {
        random ^= random << 13, random ^= random >> 7, random ^= random << 17;
        return static_cast<size_t>(random);
    };
    for (int round = 0; round < rounds; round++) {
        damaged.copy(payload.span());
        for (size_t flips = 1 + next() % 3; flips > 0; flips--) {
            size_t place = next() % 2 == 0 ? next() % damaged.size() : next() % std::min<size_t>(damaged.size(), 40);
            damaged[place] ^= static_cast<uint8_t>(1u << next() % 8);
        }
        if (next() % 4 == 0) damaged.resize(next() % damaged.size());
        try {
            decode_order({damaged.span(), 0}, stream, limits, decoded, budget);
        } catch (const Failure& failure) {
            refused += failure.fault != Fault::internal;
            if (failure.fault == Fault::internal) std::printf("a bug: %s\n", failure.text);
        }
    }
    Graph graph(budget);
    build_graph(mesh.grid().faces, mesh.points.size(), graph, budget);
    std::vector<float> coefficients(18);
    std::vector<Vector> prediction(mesh.points.size());
    Filter filter{FilterKind::rational, FilterBasis::chebyshev, 3, 2, 0, 0};
    int refused_filters = 0;
    for (int round = 0; round < 20; round++) {
        for (float& c : coefficients) {
            auto bits = static_cast<uint32_t>(next());
            std::memcpy(&c, &bits, 4);
            if (round % 2 == 0) c = static_cast<float>(next() % 1000) / 2000.0f;
        }
        try {
            predict(graph, filter, {coefficients.data(), 18}, mesh.surface().vertices,
                    {prediction.data(), prediction.size()}, budget);
        } catch (const Failure& failure) {
            refused_filters++;
        }
    }
    std::printf("%-22s order %zu bytes%s, %d of %d damaged ones refused, %d of 20 filters refused, peak %zu kB\n",
                mesh.sample.name.c_str(), payload.size(), same ? "" : " DIFFERS", refused, rounds, refused_filters,
                static_cast<size_t>(budget.peak() >> 10));
}

} // namespace

// Meshes to measure; -n: runs, of which the fastest counts; -c: checksums instead; -d: so many damaged packets instead.
int main(int argc, char** argv) {
    int runs = 5, damages = 0;
    bool sums = false;
    for (int i = 1; i < argc; i++) {
        std::string argument = argv[i];
        if (argument == "-n")
            runs = std::atoi(argv[++i]);
        else if (argument == "-d")
            damages = std::atoi(argv[++i]);
        else if (argument == "-c")
            sums = true;
        else if (sums)
            std::printf("%-60s %016llx\n", argument.c_str(),
                        static_cast<unsigned long long>(checksum(Loaded(argument))));
        else if (damages > 0)
            damage(Loaded(argument), damages);
        else
            bench(Loaded(argument), runs);
    }
    return 0;
}
