// The contexts and the mixer of the Diff layer.
#pragma once

#include "base/effort.hpp"
#include "entropy/layer_model.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// How many places each context has, and how many neurons there are of each kind; see questions.hpp.
template <Effort effort>
struct DiffShape {
    static constexpr auto high = IS_HIGH<effort>;
    static constexpr auto groups = BY_EFFORT<effort, 1, 4>;
    static constexpr auto neurons = BY_EFFORT<effort, 2, 8>;
    static constexpr int most_groups = AT_MOST<effort, 1, 4>;
    static constexpr int JOINT_PLACES = 4 * 4 * 7 * 8 * 5;
    static constexpr int context_sizes[16] = {
        12 * 10 * 2 * 6,   JOINT_PLACES + 8 * 9 * 2, 3 * 3 * 16 * 8,    16 * 7 * 7,     // plane, joint, ring, across
        5 * 4 * 3 * 4 * 2, 10 * 8 * 3 * 3 * 5,       16 * 8 * 4 * 4,    12 * 9 * 8 * 8, // alignment, midpoint
        24 * 4 * 24,       12 * 9 * 9 * 4,           5 * 5 * 3 * 3 * 4, 16 * 9 * 9,     // surface
        16 * 8 * 4 * 4,    12 * 9 * 8 * 8,           16 * 8 * 4 * 4,    12 * 9 * 4 * 4, // pairs, ring, far mean
    };
    static constexpr int neuron_sizes[8] = {
        24 * 4,    9 * 3 * 3,                   // errors, alignment
        8 * 8,     16 * 3,                      // trust, members
        3 * 8 * 3, 24 * 4,    8 * 8, 5 * 5 * 3, // age, surface, pairs, alignment with the patch
    };

    static constexpr int sum(const int* sizes, int count) {
        return count == 0 ? 0 : sizes[0] + sum(sizes + 1, count - 1);
    }
    static constexpr int first_place(int context) { return sum(context_sizes, context); }
    static constexpr int first_neuron(int kind) { return sum(neuron_sizes, kind); }
    static constexpr auto context_count = BY_EFFORT<effort, sum(context_sizes, 4), sum(context_sizes, 16)>;
    static constexpr auto neuron_count = BY_EFFORT<effort, sum(neuron_sizes, 2), sum(neuron_sizes, 8)>;
    static constexpr size_t final_neuron_count = 3 * 8;
};

template <Effort effort>
struct DiffModel : LayerModel {
    using Shape = DiffShape<effort>;
    using DiffMixer = EffortMixer<effort, FixedShape<1, 2, 4, 3>, FixedShape<4, 8, 4>>;

    explicit DiffModel(Budget& budget)
        : LayerModel(budget, {static_cast<size_t>(Shape::context_count), static_cast<size_t>(Shape::neuron_count),
                              Shape::final_neuron_count, static_cast<size_t>(DiffMixer::lanes),
                              WEIGHT_ONE / (3 * Shape::groups), WEIGHT_ONE / Shape::neurons}) {}

    template <class Coder>
    void code_states(Coder& coder, StatesModel& states) {
        constexpr uint16_t SETTLED_RATE = 65536 / 16; // as after 14 decisions
        LayerModel::code_states(coder, states, {SETTLED_RATE, 10, 8});
    }
};

} // namespace meshtide::inline MESHTIDE_ISA
