// entropy/mixing.hpp: the same bits with every kind of lanes, in both directions; it learns; places are checked.
#include "check.hpp"
#include "entropy/mixing.hpp"

namespace meshtide::testing {

namespace {

template <class Mixing>
struct Known {
    static constexpr uint32_t CONTEXTS = 256, CLASSES = 9;
    explicit Known(Budget& budget) : contexts(budget), weights(budget), final_weights(budget) {
        contexts.assign(CONTEXTS, Context{});
        weights.assign(static_cast<size_t>(CLASSES) * Mixing::lanes, WEIGHT_ONE / 8);
        final_weights.assign(CLASSES * 8, WEIGHT_ONE / Mixing::neuron_count);
    }
    MixerStates states() { return {contexts.span(), weights.span(), final_weights.span()}; }
    Array<Context> contexts;
    Array<int16_t> weights, final_weights;
};

template <class Mixing>
typename Mixing::Question ask(Numbers& numbers) {
    typename Mixing::Question question;
    for (uint32_t& context : question.contexts) context = numbers.below(256);
    for (I16x8& signs : question.opposed) {
        uint32_t which = numbers.below(16);
        signs = opposed((which & 1) != 0, (which & 2) != 0, (which & 4) != 0, (which & 8) != 0);
    }
    int16_t given[8];
    for (int16_t& number : given) number = static_cast<int16_t>(numbers.between(-2047, 2047));
    question.numbers = load<I16x8>(given);
    for (uint32_t& neuron : question.neurons) neuron = numbers.below(9);
    question.final_neuron = numbers.below(9);
    return question;
}

// What is coded hangs on one of the numbers, nine times out of ten; 469 bytes know no more than that.
template <class Mixing>
int truth(const typename Mixing::Question& question, Numbers& noise) {
    bool likely = question.numbers[2] > 0;
    return noise.below(10) == 0 ? (likely ? 0 : 1) : (likely ? 1 : 0);
}

template <class Mixing>
uint64_t test_shape(size_t greatest_size) {
    Budget budget(1 << 22);
    Array<uint8_t> payload(budget);
    Known<Mixing> writing(budget), reading(budget);
    {
        RangeEncoder encoder(payload);
        Mixing mixer(writing.states());
        Numbers numbers, noise{77};
        for (int i = 0; i < 8000; i++) {
            auto question = ask<Mixing>(numbers);
            mixer.code(encoder, question, truth<Mixing>(question, noise));
        }
        encoder.finish();
    }
    {
        RangeDecoder decoder(static_cast<Span<const uint8_t>>(payload.span()));
        Mixing mixer(reading.states());
        Numbers numbers, noise{77};
        for (int i = 0; i < 8000; i++) {
            auto question = ask<Mixing>(numbers);
            check_equal(mixer.code(decoder, question), truth<Mixing>(question, noise));
        }
        decoder.finish();
    }
    check(payload.size() < greatest_size);
    auto digest = [&](const Known<Mixing>& known) {
        Digest found;
        found.add(payload.begin(), payload.size());
        found.add(known.weights.begin(), 2 * known.weights.size());
        found.add(known.final_weights.begin(), 2 * known.final_weights.size());
        found.add(known.contexts.begin(), sizeof(Context) * known.contexts.size());
        return found.value;
    };
    check_equal(digest(reading), digest(writing));
    return digest(writing);
}

void test_places() {
    using Mixing = Mixer<1, 2, 5>;
    Budget budget(1 << 16);
    Known<Mixing> known(budget);
    const uint8_t bytes[] = {1, 2, 3, 4};
    RangeDecoder decoder({bytes, 4});
    Mixing mixer(known.states());
    Numbers numbers;
    auto question = ask<Mixing>(numbers);
    auto wrong = question;
    wrong.contexts[3] = 256;
    check_fails(Fault::internal, [&] { mixer.code(decoder, wrong); });
    wrong = question;
    wrong.neurons[1] = 9;
    check_fails(Fault::internal, [&] { mixer.code(decoder, wrong); });
    wrong = question;
    wrong.final_neuron = 0xffffffff;
    check_fails(Fault::internal, [&] { mixer.code(decoder, wrong); });
}

} // namespace

void test_mixing() {
    check_equal(test_shape<Mixer<1, 1, 4>>(900), 0x45b6eb2a17738f9d);
    check_equal(test_shape<Mixer<2, 5, 5>>(900), 0xdcf7d20c4e47d642);
    check_equal(test_shape<Mixer<3, 8, 6>>(900), 0x63923ed7b70aaabf);
    test_places();
}

} // namespace meshtide::testing
