#include "surface/samples.hpp"

namespace meshtide::inline MESHTIDE_ISA {

namespace {

// Fractions of 2^64: powers of 1 / 1.2207440846..., the root of x^4 = x + 1.
constexpr uint64_t STEPS[3] = {0xd1b54a32d192ed03, 0xabc98388fb8fac02, 0x8cb92ba72f3d8dd6};

uint64_t mixed(uint64_t value) { // splitmix64, G. Steele et al. 2014
    value += 0x9e3779b97f4a7c15;
    value = (value ^ value >> 30) * 0xbf58476d1ce4e5b9;
    value = (value ^ value >> 27) * 0x94d049bb133111eb;
    return value ^ value >> 31;
}

// Element `place` of the sequence, in [0, 1).
double element(uint64_t start, uint64_t step, uint64_t place) {
    return static_cast<double>((start + step * place) >> 11) * 0x1p-53;
}

} // namespace

void sum_areas(const Surface& surface, Span<const uint32_t> order, Array<double>& areas) {
    areas.resize(order.size());
    double total = 0.0;
    for (size_t i = 0; i < order.size(); i++) areas[i] = total += length(surface.normal(order[i]));
    if (total > 0.0) return;
    for (size_t i = 0; i < order.size(); i++) areas[i] = static_cast<double>(i + 1);
}

void sample(const OrderedFaces& faces, uint64_t seed, Span<Foot> samples) {
    size_t last = faces.order.size() - 1, at = 0;
    double share = faces.areas[last] / static_cast<double>(samples.size());
    uint64_t starts[3] = {mixed(3 * seed), mixed(3 * seed + 1), mixed(3 * seed + 2)};
    for (size_t i = 0; i < samples.size(); i++) {
        double target = (static_cast<double>(i) + element(starts[0], STEPS[0], i)) * share;
        while (at < last && faces.areas[at] < target) at++;
        double root = std::sqrt(element(starts[1], STEPS[1], i)), across = element(starts[2], STEPS[2], i);
        samples[i] = {static_cast<int32_t>(faces.order[at]), root * (1.0 - across), root * across};
    }
}

void used_vertices(const Surface& surface, Span<const uint32_t> order, size_t limit, Array<Vector>& vertices,
                   Budget& budget) {
    Array<uint8_t> seen(budget);
    Array<int32_t> used(budget);
    seen.assign(surface.vertices.size(), 0);
    for (uint32_t face : order) {
        for (size_t k = 0; k < 3; k++) {
            int32_t v = surface.corner(face, k);
            if (seen[static_cast<size_t>(v)] != 0) continue;
            seen[static_cast<size_t>(v)] = 1;
            used.push(v);
        }
    }
    size_t stride = used.size() > limit ? (used.size() + limit - 1) / limit : 1;
    vertices.clear();
    for (size_t i = 0; i < used.size(); i += stride) vertices.push(surface.vertices[static_cast<size_t>(used[i])]);
}

} // namespace meshtide::inline MESHTIDE_ISA
