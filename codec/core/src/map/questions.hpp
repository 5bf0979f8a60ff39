// Which contexts and neurons decide: the one thing in which the efforts differ, but for how neighbours are found.
#pragma once

#include "base/effort.hpp"
#include "entropy/mixing.hpp"
#include "map/facts.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Blocks of places, one after the other.
template <size_t N>
struct Blocks {
    std::array<uint32_t, N> starts{};
    uint32_t end = 0;
};
template <size_t N>
constexpr Blocks<N> make_blocks(uint32_t start, const std::array<uint32_t, N>& sizes) {
    Blocks<N> blocks;
    for (size_t i = 0; i < N; i++) {
        blocks.starts[i] = start;
        start += sizes[i];
    }
    blocks.end = start;
    return blocks;
}

// How many contexts and neurons there are of each kind, in the order in which ask() lists them.
template <Effort effort>
struct MapShape;

template <>
struct MapShape<Effort::standard> {
    typedef Mixer<2, 3, 4> Mix;
    static constexpr bool all_contacts = false; // neighbours that touch a cell are those in its ring
    static constexpr std::array<uint32_t, 8> octant_contexts = {7168, 1728, 1680, 600, 1728, 4352, 20480, 3564};
    static constexpr std::array<uint32_t, 3> octant_neurons = {96, 112, 16};
    static constexpr std::array<uint32_t, 8> child_contexts = {1088, 1024, 1024, 240, 4096, 3600, 4374, 384};
    static constexpr std::array<uint32_t, 3> child_neurons = {32, 24, 64};
};

template <>
struct MapShape<Effort::high> {
    typedef Mixer<3, 6, 4> Mix;
    static constexpr bool all_contacts = true;
    static constexpr std::array<uint32_t, 12> octant_contexts = {7168,  1728, 10752,  600,  16384, 4352,
                                                                 20480, 3564, 110592, 6912, 4096,  4096};
    static constexpr std::array<uint32_t, 6> octant_neurons = {96, 112, 42, 68, 27, 144};
    static constexpr std::array<uint32_t, 12> child_contexts = {1088, 1024, 1024, 240,  4096, 3600,
                                                                4374, 384,  2304, 4096, 3072, 4032};
    static constexpr std::array<uint32_t, 6> child_neurons = {48, 36, 64, 112, 32, 12};
};

template <Effort effort>
struct MapPlaces {
    typedef MapShape<effort> Shape;
    static constexpr auto octant_contexts = make_blocks(0, Shape::octant_contexts);
    static constexpr auto child_contexts = make_blocks(octant_contexts.end, Shape::child_contexts);
    static constexpr auto octant_neurons = make_blocks(0, Shape::octant_neurons);
    static constexpr auto child_neurons = make_blocks(octant_neurons.end, Shape::child_neurons);
    static constexpr size_t contexts = child_contexts.end, neurons = child_neurons.end;
    static constexpr size_t final_neurons = 8 + 16; // by rank; by size and children that are no leaves
};

template <Effort effort>
using MapQuestion = typename MapShape<effort>::Mix::Question;

template <size_t N>
MESHTIDE_INLINE void put_places(uint32_t* places, const Blocks<N>& blocks, const std::array<uint32_t, N>& indices) {
    for (size_t i = 0; i < N; i++) places[i] = blocks.starts[i] + indices[i];
}
MESHTIDE_INLINE int16_t number(uint32_t value) { return static_cast<int16_t>(value); }

MESHTIDE_INLINE uint32_t distance_class(const CellFacts& cell, int32_t height) {
    return cell.normal_class == 6 ? 23 : static_cast<uint32_t>(std::min(std::abs(height) >> 4, 22));
}

template <Effort effort>
MESHTIDE_INLINE void ask(MapQuestion<effort>& question, const CellFacts& cell, const OctantFacts& octant) {
    typedef MapPlaces<effort> Places;
    const auto& c = cell;
    const auto& o = octant;
    uint32_t count3 = std::min(o.count, 3u), count4 = std::min(o.count, 4u);
    auto high = static_cast<uint32_t>(o.height + 3 * HEIGHT_ONE); // 0 .. 1024
    uint32_t height = c.normal_class == 6 ? 12 : high >> 6, fine = c.normal_class == 6 ? 32 : std::min(high >> 5, 31u);
    if constexpr (effort == Effort::standard) {
        put_places(question.contexts, Places::octant_contexts,
                   {(o.path * 7 + c.normal_class) * 4 + o.vote, o.faces * 27 + o.beside,
                    ((o.rank * 5 + count4) * 7 + c.density) * 6 + c.ratio,
                    ((o.answer * 5 + c.mirror) * 8 + o.rank) * 5 + count4, o.edges * 27 + o.beside,
                    (o.faces * 17 + height) * 4 + count3, (o.faces * 64 + o.edges) * 5 + count4,
                    (fine * 27 + o.beside) * 4 + o.vote});
        put_places(question.neurons, Places::octant_neurons,
                   {(o.rank * 4 + count3) * 3 + c.trusted, (c.normal_class * 4 + o.vote) * 4 + count3,
                    c.trusted * 4 + o.vote});
    } else {
        uint32_t distance = distance_class(cell, o.height);
        put_places(question.contexts, Places::octant_contexts,
                   {(o.path * 7 + c.normal_class) * 4 + o.vote, o.faces * 27 + o.beside,
                    (o.path * 7 + c.density) * 6 + c.ratio, ((o.answer * 5 + c.mirror) * 8 + o.rank) * 5 + count4,
                    o.edges * 256 + o.path, (o.faces * 17 + height) * 4 + count3, (o.faces * 64 + o.edges) * 5 + count4,
                    (fine * 27 + o.beside) * 4 + o.vote, (o.faces * 64 + o.edges) * 27 + o.beside,
                    (o.corner * 64 + o.edges) * 27 + o.beside, (o.path * 4 + o.corner) * 4 + o.vote,
                    c.recent * 256 + o.path});
        put_places(question.neurons, Places::octant_neurons,
                   {(o.rank * 4 + count3) * 3 + c.trusted, (c.normal_class * 4 + o.vote) * 4 + count3,
                    c.density * 6 + c.ratio, height * 4 + count3, o.beside, distance / 2 * 12 + c.fit});
    }
    question.final_neuron = o.rank;
    int16_t above = c.normal_class == 6 ? static_cast<int16_t>(0) : static_cast<int16_t>(o.height);
    question.numbers = I16x8{256,
                             static_cast<int16_t>(std::abs(above)),
                             above,
                             number(o.inhabited * 256),
                             number(o.bare * 256),
                             number(o.votes * 256),
                             number(c.spacing * 128),
                             number(c.degree * 128)};
}

template <Effort effort>
MESHTIDE_INLINE void ask(MapQuestion<effort>& question, const CellFacts& cell, const ChildFacts& child) {
    typedef MapPlaces<effort> Places;
    const auto& c = cell;
    const auto& l = child;
    uint32_t inner3 = std::min(l.inner, 3u), leaves3 = std::min(l.leaves, 3u);
    uint32_t place = (std::min(l.count, 5u) - 2) * 4 + inner3, distance = distance_class(cell, l.height);
    uint32_t touching = std::min(l.touching_leaves, 3u) * 4 + std::min(l.touching_inner, 3u);
    uint32_t touching5 = std::min(l.touching_leaves, 4u) * 5 + std::min(l.touching_inner, 4u);
    const std::array<uint32_t, 8> basis = {(touching * 17 + c.recent_leaves) * 4 + inner3,
                                           l.faces * 16 + place,
                                           (l.votes * 8 + l.leaf_votes) * 16 + place,
                                           (l.answer * 5 + c.mirror) * 16 + place,
                                           (l.octants * 4 + leaves3) * 4 + inner3,
                                           (touching5 * 36 + c.ratio * 6 + c.coded_ratio) * 4 + leaves3,
                                           ((l.count * 9 + l.inner) * 9 + l.leaves) * 6 + c.coded_ratio,
                                           distance * 16 + place};
    if constexpr (effort == Effort::standard) {
        put_places(question.contexts, Places::child_contexts, basis);
        put_places(question.neurons, Places::child_neurons,
                   {l.beside * 4 + l.vote, c.ratio * 4 + c.trusted, c.degree * 4 + leaves3});
    } else {
        put_places(question.contexts, Places::child_contexts,
                   {basis[0], basis[1], basis[2], basis[3], basis[4], basis[5], basis[6], basis[7], 0, 0, 0, 0});
        put_places(question.neurons, Places::child_neurons,
                   {place * 3 + c.trusted, c.ratio * 6 + c.coded_ratio, c.degree * 4 + leaves3, c.age * 16 + c.spacing,
                    l.beside * 4 + l.vote, c.fit});
    }
    question.final_neuron = 8 + place;
    question.numbers = I16x8{256,
                             number(c.ratio * 100),
                             number((c.coded_ratio == 5 ? 2 : c.coded_ratio) * 100),
                             number(c.spacing * 128),
                             number(c.degree * 128),
                             number(l.touching_leaves * 256),
                             number(l.touching_inner * 256),
                             number(l.leaf_votes * 256)};
}

} // namespace meshtide::inline MESHTIDE_ISA
