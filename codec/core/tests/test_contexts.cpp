// entropy/contexts.hpp: how probabilities move, and numbers of every length in both directions.
#include "check.hpp"
#include "entropy/contexts.hpp"

namespace meshtide::testing {

namespace {

constexpr uint32_t LARGEST = 0xfffffffe;

void test_learning() {
    for (int bit = 0; bit < 2; bit++) {
        Context context;
        for (int i = 0; i < 5000; i++) {
            uint16_t slow = context.slow, fast = context.fast;
            learn(context.slow, context.slow_rate, SLOWEST_RATE, bit);
            learn(context.fast, context.fast_rate, FASTEST_FLOOR, bit);
            check(bit != 0 ? context.slow >= slow && context.fast >= fast
                           : context.slow <= slow && context.fast <= fast);
            check(context.slow_rate >= SLOWEST_RATE && context.fast_rate >= FASTEST_FLOOR);
        }
        check_equal(context.slow_rate, SLOWEST_RATE);
        check_equal(context.fast_rate, FASTEST_FLOOR);
        // It comes as near as its rate can tell apart.
        int left = bit != 0 ? 65535 - context.slow : context.slow;
        check(left <= 65536 / SLOWEST_RATE);
    }
    // The first decision counts half, the second a third: a mean of all that was seen.
    Context context;
    learn(context.slow, context.slow_rate, SLOWEST_RATE, 1);
    check(context.slow >= 49151 && context.slow <= 49153);
    learn(context.slow, context.slow_rate, SLOWEST_RATE, 0);
    check(context.slow >= 36862 && context.slow <= 36866);
}

void test_numbers() {
    Budget budget(1 << 22);
    Array<uint32_t> values(budget);
    for (int length = 0; length < 32; length++)
        for (int i = -2; i <= 2; i++) values.push((1u << length) + static_cast<uint32_t>(i));
    Numbers numbers;
    for (int i = 0; i < 3000; i++) values.push(numbers.below(1u << numbers.below(32)));
    for (uint32_t& value : values) value = value > LARGEST ? LARGEST : value;

    auto walk = [&](auto& coder, bool told) {
        Array<Context> contexts(budget), signs(budget);
        contexts.assign(UNSIGNED_CONTEXTS, Context{});
        signs.assign(SIGNED_CONTEXTS, Context{});
        for (uint32_t value : values) {
            check_equal(code_unsigned(coder, contexts.span(), told ? value : 0), value);
            auto magnitude = static_cast<int32_t>(value & 0x7fffffff);
            int32_t number = value % 3 == 0 ? -magnitude : magnitude;
            check_equal(code_signed(coder, signs.span(), told ? number : 0), number);
            check_equal(code_raw(coder, 5, told ? value & 31 : 0), value & 31);
        }
    };
    Array<uint8_t> payload(budget);
    RangeEncoder encoder(payload);
    walk(encoder, true);
    encoder.finish();
    Digest digest;
    digest.add(payload.begin(), payload.size());
    check_equal(digest.value, 0xc0f840fc7a303094);
    RangeDecoder decoder(static_cast<Span<const uint8_t>>(payload.span()));
    walk(decoder, false);
    decoder.finish();
}

// Every bit a one: a length that no number has.
struct Ones {
    static constexpr bool encoding = false;
    int code(uint32_t, int) { return 1; }
};

void test_endless_number() {
    Ones ones;
    Budget budget(1 << 16);
    Array<Context> contexts(budget);
    contexts.assign(SIGNED_CONTEXTS, Context{});
    check_fails(Fault::malformed, [&] { code_unsigned(ones, contexts.span()); });
    check_fails(Fault::internal, [&] { code_unsigned(ones, contexts.span().part(0, 8)); });
}

} // namespace

void test_contexts() {
    test_learning();
    test_numbers();
    test_endless_number();
}

} // namespace meshtide::testing
