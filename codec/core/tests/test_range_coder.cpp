// entropy/range_coder.hpp: what one direction writes, the other reads; payloads end where they should.
#include "check.hpp"
#include "entropy/range_coder.hpp"

namespace meshtide::testing {

namespace {

struct Decision {
    uint32_t probability;
    int bit;
};

void code_and_read(Span<const Decision> decisions, Budget& budget, Digest& digest) {
    Array<uint8_t> payload(budget);
    RangeEncoder encoder(payload);
    for (const Decision& decision : decisions)
        check_equal(encoder.code(decision.probability, decision.bit), decision.bit);
    encoder.finish();
    check(payload.empty() || payload.back() != 0);
    digest.add(payload.begin(), payload.size());

    Span<const uint8_t> whole = payload.span();
    RangeDecoder decoder(whole);
    for (const Decision& decision : decisions) check_equal(decoder.code(decision.probability, 0), decision.bit);
    decoder.finish();

    // More than a decoder reads ahead.
    for (int i = 0; i < 8; i++) payload.push(0);
    RangeDecoder longer(static_cast<Span<const uint8_t>>(payload.span()));
    for (const Decision& decision : decisions) longer.code(decision.probability, 0);
    check_fails(Fault::malformed, [&] { longer.finish(); });
}

} // namespace

void test_range_coder() {
    Budget budget(1 << 22);
    Array<Decision> decisions(budget);
    Digest digest;
    code_and_read(static_cast<Span<const Decision>>(decisions.span()), budget, digest);

    // Of every probability, and as often right as it says.
    Numbers numbers;
    for (int i = 0; i < 100000; i++) {
        uint32_t probability = numbers.below(2) == 0   ? LEAST_PROBABILITY + numbers.below(65441)
                               : numbers.below(2) == 0 ? LEAST_PROBABILITY
                                                       : GREATEST_PROBABILITY;
        decisions.push({probability, numbers.below(65536) < probability ? 1 : 0});
    }
    code_and_read(static_cast<Span<const Decision>>(decisions.span()), budget, digest);

    // Carries that run through many bytes: the likeliest of all, over and over, then what is hardly ever so.
    for (int bit = 0; bit < 2; bit++) {
        decisions.clear();
        uint32_t likely = bit != 0 ? GREATEST_PROBABILITY : LEAST_PROBABILITY;
        for (int i = 0; i < 20000; i++) decisions.push({likely, bit ^ (i % 4999 == 4998 ? 1 : 0)});
        code_and_read(static_cast<Span<const Decision>>(decisions.span()), budget, digest);
    }

    check_equal(digest.value, 0xa15a45ac4508bb52);

    // Behind its end a payload is zeros: any bytes can be read from, for ever.
    const uint8_t bytes[] = {0xff, 0xff, 0xff, 0xff, 0xff};
    RangeDecoder decoder({bytes, 5});
    for (int i = 0; i < 1000; i++) decoder.code(32768, 0);
    decoder.finish();
    RangeDecoder early({bytes, 5});
    check_fails(Fault::malformed, [&] { early.finish(); });
}

} // namespace meshtide::testing
