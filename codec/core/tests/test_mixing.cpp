// entropy/mixing.hpp: the same bits with every kind of lanes, in both directions, one or several at once; it learns;
// places are checked.
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
    for (int i = 0; i < Mixing::context_count; i++) question.contexts[i] = numbers.below(256);
    for (int g = 0; g < Mixing::groups; g++) {
        uint32_t which = numbers.below(16);
        question.opposed[g] = opposed((which & 1) != 0, (which & 2) != 0, (which & 4) != 0, (which & 8) != 0);
    }
    int16_t given[8];
    for (int16_t& number : given) number = static_cast<int16_t>(numbers.between(-2047, 2047));
    question.numbers = load<I16x8>(given);
    for (int j = 0; j < Mixing::neuron_count; j++) question.neurons[j] = numbers.below(9);
    question.final_neuron = numbers.below(9);
    return question;
}

// What is coded hangs on one of the numbers, nine times out of ten; 469 bytes know no more than that.
template <class Mixing>
int truth(const typename Mixing::Question& question, Numbers& noise) {
    bool likely = question.numbers[2] > 0;
    return noise.below(10) == 0 ? (likely ? 0 : 1) : (likely ? 1 : 0);
}

// As many questions as are asked at once, and their bits. With 256 contexts, nine neurons and nine final neurons some
// of them share what they learn.
template <class Mixing>
struct Asked {
    Asked(Numbers& numbers, Numbers& noise) {
        for (int k = 0; k < Mixing::questions; k++) {
            questions[k] = ask<Mixing>(numbers);
            bits |= truth<Mixing>(questions[k], noise) << k;
        }
    }
    typename Mixing::Question questions[Mixing::questions];
    int bits = 0;
};

template <class Mixing>
uint64_t test_shape(size_t greatest_size) {
    constexpr int ROUNDS = 8000 / Mixing::questions;
    Budget budget(1 << 22);
    Array<uint8_t> payload(budget);
    Known<Mixing> writing(budget), reading(budget);
    {
        RangeEncoder encoder(payload);
        Mixing mixer(writing.states());
        Numbers numbers, noise{77};
        for (int i = 0; i < ROUNDS; i++) {
            Asked<Mixing> asked(numbers, noise);
            mixer.code(encoder, asked.questions, asked.bits);
        }
        encoder.finish();
    }
    {
        RangeDecoder decoder(static_cast<Span<const uint8_t>>(payload.span()));
        Mixing mixer(reading.states());
        Numbers numbers, noise{77};
        for (int i = 0; i < ROUNDS; i++) {
            Asked<Mixing> asked(numbers, noise);
            check_equal(mixer.code(decoder, asked.questions, 0), asked.bits);
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
    using Mixing = Mixer<1, 2, 5, 2>;
    Budget budget(1 << 16);
    Known<Mixing> known(budget);
    const uint8_t bytes[] = {1, 2, 3, 4};
    RangeDecoder decoder({bytes, 4});
    Mixing mixer(known.states());
    Numbers numbers, noise;
    const Asked<Mixing> right(numbers, noise);
    auto wrong = right;
    wrong.questions[1].contexts[3] = 256;
    check_fails(Fault::internal, [&] { mixer.code(decoder, wrong.questions, 0); });
    wrong = right;
    wrong.questions[1].neurons[1] = 9;
    check_fails(Fault::internal, [&] { mixer.code(decoder, wrong.questions, 0); });
    wrong = right;
    wrong.questions[1].final_neuron = 0xffffffff;
    check_fails(Fault::internal, [&] { mixer.code(decoder, wrong.questions, 0); });
}

// Of the tables that integers of 128 bits make.
void test_tables() {
    Digest digest;
    digest.add(&LOGISTIC, sizeof LOGISTIC);
    check_equal(digest.value, 0x7a68c856d1baa149);
}

} // namespace

void test_mixing() {
    test_tables();
    check_equal(test_shape<Mixer<1, 1, 4>>(900), 0xbdc9e2a7200408d1);
    check_equal(test_shape<Mixer<2, 5, 5>>(900), 0x2587e6be44c362a6);
    check_equal(test_shape<Mixer<3, 8, 6>>(900), 0xdad979a14aa9de29);
    check_equal(test_shape<Mixer<1, 2, 4, 3>>(900), 0xf74bbf16d524dc5);
    test_places();
}

} // namespace meshtide::testing
