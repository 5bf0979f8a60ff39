// What a Map knows of its stream: contexts, neurons, and the room in which it works.
#pragma once

#include "entropy/states.hpp"
#include "map/cell_index.hpp"
#include "map/questions.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Arrays that serve one level after the other.
struct MapRoom {
    explicit MapRoom(Budget& budget) : notes(budget), places(budget), bulges(budget), index(budget) {}
    Array<Note> notes;
    Array<F32x4> places, bulges;
    CellIndex index;

    // Gives back what a Map of so many vertices has taken, where that is much.
    void rest(size_t vertices) {
        if (vertices < ROOMY) return;
        notes.give_back();
        places.give_back();
        bulges.give_back();
        index.give_back();
    }
};

// One for each stream: a Map goes on from what the Map before has learned.
template <Effort effort>
struct MapModel {
    typedef MapMixer<effort> Mix;
    typedef MapPlaces<Effort::standard> Standard;
    typedef MapPlaces<Effort::high> High;

    explicit MapModel(Budget& budget) : contexts(budget), weights(budget), final_weights(budget), room(budget) {
        const auto lanes = static_cast<size_t>(Mix::lanes);
        contexts.assign(BY_EFFORT<effort, Standard::contexts, High::contexts>, Context{});
        weights.assign(BY_EFFORT<effort, Standard::neurons, High::neurons> * lanes, 0);
        for (size_t i = 0; i < weights.size(); i++)
            if (i % lanes < lanes - 8 && (i & 4) == 0)
                weights[i] = static_cast<int16_t>(WEIGHT_ONE * 6 / 5 / Mix::context_count);
        final_weights.assign(Standard::final_neurons * 8, static_cast<int16_t>(WEIGHT_ONE / Mix::neuron_count));
    }

    // The trained states, from or to their bytes. Contexts that were seen 16 times or more count as settled.
    template <class Coder>
    void code_states(Coder& coder, StatesModel& states) {
        states.code_contexts(coder, contexts.span(), SETTLED_RATE);
        states.code_weights(coder, weights.span(), static_cast<size_t>(Mix::lanes), WEIGHT_SHIFT);
        states.code_weights(coder, final_weights.span(), 8, WEIGHT_SHIFT);
    }
    static constexpr uint16_t SETTLED_RATE = 65536 / 18;
    static constexpr auto WEIGHT_SHIFT = BY_EFFORT<effort, 11, 10>;

    void copy(const MapModel& other) {
        contexts.copy(other.contexts.span());
        weights.copy(other.weights.span());
        final_weights.copy(other.final_weights.span());
    }
    MixerStates mixer_states() { return {contexts.span(), weights.span(), final_weights.span()}; }

    Array<Context> contexts;
    Array<int16_t> weights, final_weights;
    MapRoom room;
};

} // namespace meshtide::inline MESHTIDE_ISA
