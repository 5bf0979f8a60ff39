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
};

// One for each stream: a Map goes on from what the Map before has learned.
template <Effort effort>
struct MapModel {
    typedef MapPlaces<effort> Places;
    typedef typename MapShape<effort>::Mix Mix;

    explicit MapModel(Budget& budget) : contexts(budget), weights(budget), final_weights(budget), room(budget) {
        contexts.assign(Places::contexts, Context{});
        weights.assign(Places::neurons * Mix::lanes, 0);
        final_weights.assign(Places::final_neurons * 8, WEIGHT_ONE / Mix::neuron_count);
    }

    // The trained states, from or to their bytes. Contexts that were seen 16 times or more count as settled.
    template <class Coder>
    void code_states(Coder& coder, Budget& budget) {
        StatesModel states(budget);
        states.code_contexts(coder, contexts.span(), SETTLED_RATE);
        states.code_weights(coder, weights.span(), Mix::lanes, WEIGHT_SHIFT);
        states.code_weights(coder, final_weights.span(), 8, WEIGHT_SHIFT);
    }
    static constexpr uint16_t SETTLED_RATE = 65536 / 18;
    static constexpr int WEIGHT_SHIFT = effort == Effort::standard ? 11 : 10;

    MixerStates states() { return {contexts.span(), weights.span(), final_weights.span()}; }

    Array<Context> contexts;
    Array<int16_t> weights, final_weights;
    MapRoom room;
};

} // namespace meshtide::inline MESHTIDE_ISA
