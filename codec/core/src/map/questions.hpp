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
    static constexpr std::array<uint32_t, 8> octant_contexts = {256, 1728, 1680, 600, 6912, 1275, 20480, 3564};
    static constexpr std::array<uint32_t, 3> octant_neurons = {96, 112, 16};
    static constexpr std::array<uint32_t, 8> child_contexts = {1088, 1024, 1024, 240, 256, 3600, 4374, 96};
    static constexpr std::array<uint32_t, 3> child_neurons = {32, 24, 64};
};

template <>
struct MapShape<Effort::high> {
    static constexpr std::array<uint32_t, 12> octant_contexts = {7168,  1728, 10752, 600,    16384, 4352,
                                                                 20480, 3564, 4096,  110592, 6912,  4096};
    static constexpr std::array<uint32_t, 6> octant_neurons = {96, 112, 16, 64, 27, 144};
    static constexpr std::array<uint32_t, 12> child_contexts = {1088, 1024, 1024, 240,   4096, 3600,
                                                                4374, 384,  9216, 25600, 2304, 4096};
    static constexpr std::array<uint32_t, 6> child_neurons = {32, 24, 64, 36, 112, 256};
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
using MapMixer = EffortMixer<effort, FixedShape<2, 3, 4>, FixedShape<3, 6, 4>>;
template <Effort effort>
using MapQuestion = typename MapMixer<effort>::Question;

// In whole vectors, since they are loaded as such; the last one is filled up with 0.
template <size_t N>
MESHTIDE_INLINE void put_places(uint32_t* places, const Blocks<N>& blocks, const std::array<uint32_t, N>& indices) {
    auto place = [&](size_t i) { return i < N ? blocks.starts[i] + indices[i] : 0; };
    for (size_t i = 0; i < N; i += 4) store(places + i, U32x4{place(i), place(i + 1), place(i + 2), place(i + 3)});
}
// Inputs of the mixer beside the contexts; below 2^11.
MESHTIDE_INLINE I16x8 numbers(const std::array<uint32_t, 8>& values) {
    I16x8 vector;
    for (size_t i = 0; i < 8; i++) vector[i] = static_cast<int16_t>(values[i]);
    return vector;
}

MESHTIDE_INLINE uint32_t distance_class(const CellFacts& cell, int32_t height) {
    return cell.normal_class == 6 ? 23 : static_cast<uint32_t>(std::min(std::abs(height) >> 4, 22));
}

// Is the octant occupied?
template <Effort effort>
MESHTIDE_INLINE void ask(MapQuestion<effort>& question, const CellFacts& c, const OctantFacts& o) {
    const bool oriented = c.normal_class != 6;
    const uint32_t count3 = std::min(o.count, 3u), count4 = std::min(o.count, 4u);
    const auto above_lowest = static_cast<uint32_t>(o.height + 3 * HEIGHT_ONE); // 0 .. 1024
    const uint32_t height = oriented ? above_lowest >> 6 : 12,
                   fine_height = oriented ? std::min(above_lowest >> 5, 31u) : 32;
    if (!IS_HIGH<effort>) {
        typedef MapPlaces<Effort::standard> Places;
        put_places(
            question.contexts, Places::octant_contexts,
            {o.path,                  // the octants before it
             o.faces * 27 + o.beside, // what lies across its faces, outside and inside of the cell
             ((o.rank * 5 + count4) * 7 + c.density) * 6 + c.ratio,  // how many children neighbours have
             ((o.answer * 5 + c.mirror) * 8 + o.rank) * 5 + count4,  // the mirror image
             (o.corner * 64 + o.edges) * 27 + o.beside,              // what lies across edges and the corner
             ((o.answer * 17 + height) * 5 + count4) * 5 + c.mirror, // the image, and the height over the surface
             (o.faces * 64 + o.edges) * 5 + count4,                  // the cells around it
             (fine_height * 27 + o.beside) * 4 + o.vote});           // the height
        put_places(question.neurons, Places::octant_neurons,
                   {(o.rank * 4 + count3) * 3 + c.trusted,      //
                    (c.normal_class * 4 + o.vote) * 4 + count3, //
                    c.trusted * 4 + o.vote});
    } else {
        typedef MapPlaces<Effort::high> Places;
        put_places(question.contexts, Places::octant_contexts,
                   {(o.path * 7 + c.normal_class) * 4 + o.vote, // the octants before it, and how the surface leans
                    o.faces * 27 + o.beside, // what lies across its faces, outside and inside of the cell
                    (o.path * 7 + c.density) * 6 + c.ratio,                // and how many children neighbours have
                    ((o.answer * 5 + c.mirror) * 8 + o.rank) * 5 + count4, // the mirror image
                    o.edges * 256 + o.path,                     // what lies across edges, and the octants before
                    (o.faces * 17 + height) * 4 + count3,       // what lies across faces, and the height
                    (o.faces * 64 + o.edges) * 5 + count4,      // the cells around it
                    (fine_height * 27 + o.beside) * 4 + o.vote, // the height
                    (o.path * 4 + o.corner) * 4 + o.vote,      // the octants before it, and neighbours in its direction
                    (o.faces * 64 + o.edges) * 27 + o.beside,  // and the octants
                    (o.corner * 64 + o.edges) * 27 + o.beside, // what lies across edges and the corner
                    c.recent * 256 + o.path});                 // how many children cells have had of late
        put_places(question.neurons, Places::octant_neurons,
                   {(o.rank * 4 + count3) * 3 + c.trusted,      //
                    (c.normal_class * 4 + o.vote) * 4 + count3, //
                    c.trusted * 4 + o.vote,                     //
                    o.faces,                                    //
                    o.beside,                                   //
                    distance_class(c, o.height) / 2 * 12 + c.fit});
    }
    question.final_neuron = o.rank;
    question.numbers = numbers({256, oriented ? static_cast<uint32_t>(std::abs(o.height)) : 0, 0, o.inhabited * 256,
                                o.bare * 256, o.votes * 256, c.spacing * 128, c.degree * 128});
    question.numbers[2] = static_cast<int16_t>(oriented ? o.height : 0);
}

// Is the child a leaf?
template <Effort effort>
MESHTIDE_INLINE void ask(MapQuestion<effort>& question, const CellFacts& c, const ChildFacts& l) {
    const uint32_t inner3 = std::min(l.inner, 3u), leaves3 = std::min(l.leaves, 3u);
    const uint32_t place = (std::min(l.count, 5u) - 2) * 4 + inner3;
    const uint32_t touching4 = std::min(l.touching_leaves, 3u) * 4 + std::min(l.touching_inner, 3u);
    const uint32_t touching5 = std::min(l.touching_leaves, 4u) * 5 + std::min(l.touching_inner, 4u);
    if (!IS_HIGH<effort>) {
        typedef MapPlaces<Effort::standard> Places;
        put_places(
            question.contexts, Places::child_contexts,
            {(touching4 * 17 + c.recent_leaves) * 4 + inner3,              // children that touch it, and leaves of late
             l.faces * 16 + place,                                         // what lies across its faces
             (l.votes * 8 + l.leaf_votes) * 16 + place,                    // neighbours in its direction
             (l.answer * 5 + c.mirror) * 16 + place,                       // the mirror image
             c.degree * 16 + place,                                        // how many neighbours there are
             (touching5 * 36 + c.ratio * 6 + c.coded_ratio) * 4 + leaves3, // leaves among children and neighbours
             ((l.count * 9 + l.inner) * 9 + l.leaves) * 6 + c.coded_ratio, // what the cell's children are so far
             (l.vote * 4 + inner3) * 6 + c.ratio});                        // the share of leaves among the neighbours
        put_places(question.neurons, Places::child_neurons,
                   {l.beside * 4 + l.vote, c.ratio * 4 + c.trusted, l.votes * 8 + l.leaf_votes});
    } else {
        typedef MapPlaces<Effort::high> Places;
        put_places(
            question.contexts, Places::child_contexts,
            {(touching4 * 17 + c.recent_leaves) * 4 + inner3,              // children that touch it, and leaves of late
             l.faces * 16 + place,                                         // what lies across its faces
             (l.votes * 8 + l.leaf_votes) * 16 + place,                    // neighbours in its direction
             (l.answer * 5 + c.mirror) * 16 + place,                       // the mirror image
             (l.octants * 4 + leaves3) * 4 + inner3,                       // the cell's octants
             (touching5 * 36 + c.ratio * 6 + c.coded_ratio) * 4 + leaves3, // leaves among children and neighbours
             ((l.count * 9 + l.inner) * 9 + l.leaves) * 6 + c.coded_ratio, // what the cell's children are so far
             distance_class(c, l.height) * 16 + place,                     // the distance from the surface
             ((l.votes * 8 + l.leaf_votes) * 4 + leaves3) * 36 + c.ratio * 6 + c.coded_ratio, // leaves around
             ((touching5 * 16 + l.beside) * 4 + l.vote) * 16 + place,                         // children around
             (c.ratio * 6 + c.coded_ratio) * 64 + place * 4 + leaves3,                        // shares of leaves
             (c.degree * 16 + c.spacing) * 16 + place});                                      // how dense the mesh is
        put_places(question.neurons, Places::child_neurons,
                   {l.beside * 4 + l.vote, c.ratio * 4 + c.trusted, c.degree * 4 + leaves3, c.ratio * 6 + c.coded_ratio,
                    c.age * 16 + c.spacing, c.degree * 16 + c.spacing});
    }
    question.final_neuron = 8 + place;
    question.numbers = numbers({256, c.ratio * 100, c.coded_ratio == 5 ? 200 : c.coded_ratio * 100, c.spacing * 128,
                                c.degree * 128, l.touching_leaves * 256, l.touching_inner * 256, l.leaf_votes * 256});
}

} // namespace meshtide::inline MESHTIDE_ISA
