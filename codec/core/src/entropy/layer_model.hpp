// What the mixed decisions of a layer know, in arrays of its own: contexts, and the weights of neurons.
#pragma once

#include "entropy/mixing.hpp"
#include "entropy/states.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// How much there is of each, and the weights that neurons have before any training.
struct LayerShape {
    size_t contexts, neurons, final_neurons;
    size_t lanes; // of the mixer
    int weight;   // of what is stretched; other inputs weigh nothing
    int final_weight;
};

// How a layer's trained states are read and written, see StatesModel.
struct LayerStates {
    uint16_t settled_rate;
    int weight_shift, final_weight_shift;
};

class LayerModel {
public:
    LayerModel(Budget& budget, const LayerShape& shape)
        : contexts(budget), weights(budget), final_weights(budget), lanes_(shape.lanes) {
        contexts.assign(shape.contexts, Context{});
        weights.assign(shape.neurons * lanes_, 0);
        for (size_t i = 0; i < weights.size(); i++)
            if (i % lanes_ < lanes_ - 8 && (i & 4) == 0) weights[i] = static_cast<int16_t>(shape.weight);
        final_weights.assign(8 * shape.final_neurons, static_cast<int16_t>(shape.final_weight));
    }

    void copy(const LayerModel& other) {
        contexts.copy(other.contexts.span());
        weights.copy(other.weights.span());
        final_weights.copy(other.final_weights.span());
    }
    MixerStates mixer_states() { return {contexts.span(), weights.span(), final_weights.span()}; }

    // The trained states, from or to their bytes.
    template <class Coder>
    void code_states(Coder& coder, StatesModel& states, const LayerStates& how) {
        states.code_contexts(coder, contexts.span(), how.settled_rate);
        states.code_weights(coder, weights.span(), lanes_, how.weight_shift);
        states.code_weights(coder, final_weights.span(), 8, how.final_weight_shift);
    }

    Array<Context> contexts;
    Array<int16_t> weights, final_weights;

private:
    size_t lanes_;
};

} // namespace meshtide::inline MESHTIDE_ISA
