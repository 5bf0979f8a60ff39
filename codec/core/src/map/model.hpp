// What a Map knows of its stream: contexts, neurons, and the room in which it works.
#pragma once

#include "entropy/layer_model.hpp"
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
struct MapModel : LayerModel {
    typedef MapMixer<effort> Mix;
    typedef MapPlaces<Effort::standard> Standard;
    typedef MapPlaces<Effort::high> High;

    explicit MapModel(Budget& budget)
        : LayerModel(budget, {BY_EFFORT<effort, Standard::contexts, High::contexts>,
                              BY_EFFORT<effort, Standard::neurons, High::neurons>, Standard::final_neurons,
                              static_cast<size_t>(Mix::lanes), WEIGHT_ONE * 6 / 5 / Mix::context_count,
                              WEIGHT_ONE / Mix::neuron_count}),
          room(budget) {}

    // Contexts that were seen 16 times or more count as settled.
    static constexpr uint16_t SETTLED_RATE = 65536 / 18;
    static constexpr auto WEIGHT_SHIFT = BY_EFFORT<effort, 11, 10>;
    template <class Coder>
    void code_states(Coder& coder, StatesModel& states) {
        LayerModel::code_states(coder, states, {SETTLED_RATE, WEIGHT_SHIFT, WEIGHT_SHIFT});
    }

    MapRoom room;
};

} // namespace meshtide::inline MESHTIDE_ISA
