// libFuzzer: any bytes, read as numbers, raw bits and mixed decisions; then written, they read back the same.
#include "entropy/mixing.hpp"

#include <cstdlib>

using namespace meshtide;

namespace {

using Mixing = Mixer<1, 3, 5>;

// The walk that the bytes steer: what is coded next depends on what was coded before.
template <class Coder>
void walk(Coder& coder, Budget& budget, Array<uint32_t>& told) {
    Array<Context> contexts(budget), numbers(budget);
    Array<int16_t> weights(budget), final_weights(budget);
    contexts.assign(16, Context{});
    numbers.assign(SIGNED_CONTEXTS, Context{});
    weights.assign(4 * Mixing::lanes, WEIGHT_ONE / 8);
    final_weights.assign(8, WEIGHT_ONE / 3);
    Mixing mixer({contexts.span(), weights.span(), final_weights.span()});
    for (size_t i = 0; i < 200; i++) {
        if (!Coder::encoding) told.push(0);
        uint32_t before = i > 0 ? told[i - 1] : 0;
        switch (i % 4) {
        case 0:
            told[i] = code_unsigned(coder, numbers.span(), told[i]);
            break;
        case 1:
            told[i] = static_cast<uint32_t>(code_signed(coder, numbers.span(), static_cast<int32_t>(told[i])));
            break;
        case 2:
            told[i] = code_raw(coder, static_cast<int>(before % 33), told[i]);
            break;
        default:
            Mixing::Question question;
            for (uint32_t k = 0; k < 4; k++) question.contexts[k] = (before >> 4 * k) % 16;
            question.opposed[0] = opposed((before & 1) != 0, (before & 2) != 0, false, true);
            question.numbers = splat16(static_cast<int>(before % 4095) - 2047);
            for (uint32_t k = 0; k < 3; k++) question.neurons[k] = (before >> k) % 4;
            question.final_neuron = 0;
            told[i] = static_cast<uint32_t>(mixer.code(coder, question, static_cast<int>(told[i])));
        }
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t count) {
    Budget budget(1 << 20);
    Array<uint32_t> told(budget), again(budget);
    try {
        RangeDecoder decoder({bytes, count});
        walk(decoder, budget, told);
    } catch (const Failure& failure) {
        if (failure.fault != Fault::malformed) std::abort();
        return 0;
    }
    Array<uint8_t> payload(budget);
    RangeEncoder encoder(payload);
    walk(encoder, budget, told);
    encoder.finish();
    RangeDecoder decoder(static_cast<Span<const uint8_t>>(payload.span()));
    walk(decoder, budget, again);
    decoder.finish();
    for (size_t i = 0; i < told.size(); i++)
        if (told[i] != again[i]) std::abort();
    return 0;
}
