#include "self_check.hpp"

#include "entropy/mixing.hpp"

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr int ROUNDS = 2000;

// D. Lehmer's generator modulo 2^64, with M. O'Neill's multiplier; the upper bits are used.
struct Numbers {
    uint64_t state = 0x2545f4914f6cdd1d;
    uint32_t below(uint32_t limit) {
        state *= 0xda942042e4dd58b5;
        return static_cast<uint32_t>((state >> 32) * limit >> 32);
    }
};

// What there is to be learned; the same for an encoder and its decoder.
struct Memory {
    explicit Memory(Budget& budget) : contexts(budget), weights(budget), final_weights(budget), numbers(budget) {
        contexts.assign(CONTEXTS, Context{});
        weights.assign(CLASSES * Mixing::lanes, WEIGHT_ONE / 8);
        final_weights.assign(CLASSES * 8, WEIGHT_ONE / Mixing::neuron_count);
        numbers.assign(SIGNED_CONTEXTS, Context{});
    }
    using Mixing = Mixer<2, 5, 5, 3>;
    static constexpr uint32_t CONTEXTS = 64, CLASSES = 7;
    Array<Context> contexts;
    Array<int16_t> weights, final_weights;
    Array<Context> numbers;
};

// One walk for both directions: `made` are the numbers that steer it, `told` gives what is coded and takes what is
// read.
template <class Coder>
uint64_t walk(Coder& coder, Memory& memory, Array<int32_t>& told) {
    Memory::Mixing mixer({memory.contexts.span(), memory.weights.span(), memory.final_weights.span()});
    Numbers made;
    F32x4 place = {0.5f, -0.25f, 0.125f, 0};
    size_t next = 0;
    for (int round = 0; round < ROUNDS; round++) {
        Memory::Mixing::Question questions[Memory::Mixing::questions];
        for (auto& question : questions) {
            for (int i = 0; i < Memory::Mixing::context_count; i++) question.contexts[i] = made.below(Memory::CONTEXTS);
            for (int g = 0; g < Memory::Mixing::groups; g++) {
                uint32_t which = made.below(16);
                question.opposed[g] = opposed((which & 1) != 0, (which & 2) != 0, (which & 4) != 0, (which & 8) != 0);
            }
            int16_t numbers[8];
            for (int16_t& number : numbers) number = static_cast<int16_t>(static_cast<int>(made.below(4095)) - 2047);
            question.numbers = load<I16x8>(numbers);
            for (int j = 0; j < Memory::Mixing::neuron_count; j++) question.neurons[j] = made.below(Memory::CLASSES);
            question.final_neuron = made.below(Memory::CLASSES);
        }
        told[next] = mixer.code(coder, questions, told[next]);
        next++;

        // A point that is thrown about: every step depends on the rounding of all steps before.
        F32x4 push = to_floats(I32x4{static_cast<int32_t>(made.below(2000)) - 1000, 7 * round % 1999 - 999, 31, 0});
        F32x4 turned = cross3(place, push) + push * splat(0.375f);
        F32x4 length = square_root(splat(dot3(turned, turned) + 1.0f));
        place = greatest(least(turned / length, splat(0.9375f)), splat(-0.9375f));
        I32x4 steps = truncate(magnitude(place) * splat(4096.0f));
        int32_t guess = sum(steps) - 8192 * (signs(reinterpret_cast<I32x4>(place)) & 1);
        told[next] = guess + code_signed(coder, memory.numbers.span(), told[next] - guess);
        next++;
    }
    return made.state;
}

} // namespace

uint64_t self_check() {
    Budget budget(1 << 20);
    Array<int32_t> told(budget), read(budget);
    Array<uint8_t> bytes(budget);
    Numbers numbers;
    for (int i = 0; i < ROUNDS; i++) {
        int bits = 0;
        for (int k = 0; k < Memory::Mixing::questions; k++) bits |= static_cast<int>(numbers.below(4) != 0) << k;
        told.push(bits);
        told.push(static_cast<int32_t>(numbers.below(16384)) - 8192);
    }
    Memory writing(budget), reading(budget);
    RangeEncoder encoder(bytes);
    walk(encoder, writing, told);
    encoder.finish();

    read.assign(told.size(), 0);
    RangeDecoder decoder(static_cast<Span<const uint8_t>>(bytes.span()));
    walk(decoder, reading, read);
    decoder.finish();
    for (size_t i = 0; i < told.size(); i++)
        if (read[i] != told[i]) return 0;

    uint64_t digest = 0xcbf29ce484222325; // G. Fowler, L. C. Noll, K.-P. Vo, 1a
    for (uint8_t byte : bytes) digest = (digest ^ byte) * 0x100000001b3;
    return digest;
}

} // namespace meshtide::inline MESHTIDE_ISA
