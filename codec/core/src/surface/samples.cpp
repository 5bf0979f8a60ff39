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

// The area of each face together with all before it, in some unit; or how many there are, if none has an area.
void sum_areas(const Surface& surface, Span<const uint32_t> order, Array<double>& areas) {
    areas.resize(order.size());
    double total = 0.0;
    for (size_t i = 0; i < order.size(); i++) areas[i] = total += length(surface.normal(order[i]));
    if (total > 0.0) return;
    for (size_t i = 0; i < order.size(); i++) areas[i] = static_cast<double>(i + 1);
}

} // namespace

void sample(const Surface& surface, Span<const uint32_t> order, uint64_t seed, Span<Foot> samples, Budget& budget) {
    Array<double> areas(budget);
    sum_areas(surface, order, areas);
    size_t last = order.size() - 1, at = 0;
    double share = areas[last] / static_cast<double>(samples.size());
    uint64_t starts[3] = {mixed(3 * seed), mixed(3 * seed + 1), mixed(3 * seed + 2)};
    for (size_t i = 0; i < samples.size(); i++) {
        double target = (static_cast<double>(i) + element(starts[0], STEPS[0], i)) * share;
        while (at < last && areas[at] < target) at++;
        double root = std::sqrt(element(starts[1], STEPS[1], i)), across = element(starts[2], STEPS[2], i);
        samples[i] = {static_cast<int32_t>(order[at]), root * (1.0 - across), root * across};
    }
}

void used_vertices(const Surface& surface, Span<const uint32_t> order, size_t limit, Array<UsedVertex>& used,
                   Budget& budget) {
    Array<uint8_t> seen(budget);
    seen.assign(surface.vertices.size(), 0);
    used.clear();
    for (size_t i = 0; i < order.size(); i++) {
        for (size_t k = 0; k < 3; k++) {
            int32_t v = surface.corner(order[i], k);
            if (seen[static_cast<size_t>(v)] != 0) continue;
            seen[static_cast<size_t>(v)] = 1;
            used.push({v, static_cast<uint32_t>(i)});
        }
    }
    size_t stride = used.size() > limit ? (used.size() + limit - 1) / limit : 1, kept = 0;
    for (size_t i = 0; i < used.size(); i += stride) used[kept++] = used[i];
    used.resize(kept);
}

} // namespace meshtide::inline MESHTIDE_ISA
