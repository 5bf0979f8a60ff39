// What the faces' decisions know: scores of candidates, contexts and weights. They go on from level to level.
#pragma once

#include "entropy/mixing.hpp"
#include "faces/candidates.hpp"

namespace meshtide::inline MESHTIDE_ISA {

constexpr int PICK_TURNS = 4, ODDS = 32;

// Contexts of "is it this one?" (mixed), of "has the gate a face?" (mixed), and of rare decisions.
struct FacesContexts {
    static constexpr uint32_t PICK_BY_ODDS = 0;
    static constexpr uint32_t PICK_BY_LEFT = PICK_BY_ODDS + PICK_TURNS * ODDS * CORNERS;
    static constexpr uint32_t PICK_BY_RIVAL = PICK_BY_LEFT + 2 * 4 * ODDS * 16;
    static constexpr uint32_t PICK_BY_SHAPE = PICK_BY_RIVAL + 8 * CORNERS * CORNERS;
    static constexpr uint32_t GATE = PICK_BY_SHAPE + 2 * 256 * CORNERS;
    static constexpr uint32_t GATE_BY_SCORE = GATE + 504;
    static constexpr uint32_t GATE_BY_CORNER = GATE_BY_SCORE + ODDS * 21;
    static constexpr uint32_t GATE_BY_ODDS = GATE_BY_CORNER + 12 * CORNERS;
    static constexpr uint32_t HOLE = GATE_BY_ODDS + ODDS * 21;
    static constexpr uint32_t ESCAPE = HOLE + 16;
    static constexpr uint32_t EXTRA = ESCAPE + 64;
    static constexpr uint32_t SEED = EXTRA + 512;
    static constexpr uint32_t NUMBERS = SEED + 64;
    static constexpr uint32_t COUNT = NUMBERS + 6 * SIGNED_CONTEXTS;
};
struct FacesNeurons {
    static constexpr uint32_t PICK_TURN = 0;
    static constexpr uint32_t PICK_CORNER = PICK_TURN + 16;
    static constexpr uint32_t PICK_ODDS = PICK_CORNER + CORNERS;
    static constexpr uint32_t GATE_FAMILY = PICK_ODDS + ODDS;
    static constexpr uint32_t GATE_CORNER = GATE_FAMILY + 64;
    static constexpr uint32_t GATE_ODDS = GATE_CORNER + CORNERS;
    static constexpr uint32_t PICK_MARGIN = GATE_ODDS + ODDS; // high only, as the next
    static constexpr uint32_t GATE_SCORE = PICK_MARGIN + 32;
    static constexpr uint32_t COUNT = GATE_SCORE + 32;
    static constexpr uint32_t FINAL = 16;
};

template <Effort effort, bool positions>
struct FacesModel {
    static constexpr bool high = effort == Effort::high && positions;
    using DecisionMixer = Mixer<high ? 5 : 1, high ? 4 : 3, high ? 5 : 4>;

    explicit FacesModel(Budget& budget) : scores(budget), contexts(budget), weights(budget), final_weights(budget) {
        scores.assign(ScorePlaces<effort, positions>::COUNT, 0);
        contexts.assign(FacesContexts::COUNT + (high ? 9 * ScorePlaces<effort, positions>::COUNT : 0), Context{});
        weights.assign(FacesNeurons::COUNT * DecisionMixer::lanes, 0);
        for (size_t j = 0; j < FacesNeurons::COUNT; j++)
            for (size_t i = 0; i + 8 < DecisionMixer::lanes; i++)
                if ((i & 8) == 0) weights[j * DecisionMixer::lanes + i] = high ? WEIGHT_ONE / 16 : WEIGHT_ONE / 5;
        final_weights.assign(FacesNeurons::FINAL * 8, WEIGHT_ONE / DecisionMixer::neuron_count);
    }

    void copy(const FacesModel& other) {
        scores.copy(other.scores.span());
        contexts.copy(other.contexts.span());
        weights.copy(other.weights.span());
        final_weights.copy(other.final_weights.span());
    }
    MixerStates mixer_states() { return {contexts.span(), weights.span(), final_weights.span()}; }

    Array<int16_t> scores;
    Array<Context> contexts;
    Array<int16_t> weights, final_weights;
};

} // namespace meshtide::inline MESHTIDE_ISA
