// classic/coders.hpp: cells, children and Diffs are read as they were written.
#include "check.hpp"
#include "classic/coders.hpp"

namespace meshtide::testing {

namespace {

constexpr uint64_t PAYLOADS = 0x8e018e696a8a3503; // digest of all payloads, the same on every machine

struct Content {
    explicit Content(Budget& budget) : codes(budget), counts(budget), differences(budget) {}
    int bits = 4;
    uint64_t children = 0;
    Array<uint64_t> codes;
    Array<uint32_t> counts;
    Array<int32_t> differences;
};

template <class Coder>
void code(Coder& coder, Content& content, Budget& budget) {
    code_cells(coder, content.codes.span(), content.bits, budget);
    code_children(coder, content.counts.span(), content.children, budget);
    code_differences(coder, content.differences.span(), budget);
    coder.finish();
}

} // namespace

void test_classic() {
    Budget budget(1u << 24);
    Numbers numbers;
    Digest digest;
    for (int round = 0; round < 50; round++) {
        Content content(budget), read(budget);
        content.bits = numbers.between(4, 20);
        uint64_t next = 0, end = static_cast<uint64_t>(1) << (3 * content.bits);
        while (content.codes.size() < 300) {
            next += numbers.below(1u << numbers.below(static_cast<uint32_t>(content.bits)));
            if (next >= end) break;
            content.codes.push(next++);
        }
        for (int i = 0; i < 200; i++) {
            content.counts.push(1 + numbers.below(1 + numbers.below(5)));
            content.children += content.counts.back();
            for (int k = 0; k < 3; k++)
                content.differences.push(numbers.between(-1, 1) * numbers.between(0, 1 << (i % 24)));
        }
        Array<uint8_t> payload(budget);
        RangeEncoder encoder(payload);
        code(encoder, content, budget);
        digest.add(payload.begin(), payload.size());

        read.bits = content.bits;
        read.children = content.children;
        read.codes.assign(content.codes.size(), 0);
        read.counts.assign(content.counts.size(), 0);
        read.differences.assign(content.differences.size(), 0);
        RangeDecoder decoder(payload.span());
        code(decoder, read, budget);
        for (size_t i = 0; i < read.codes.size(); i++) check_equal(read.codes[i], content.codes[i]);
        for (size_t i = 0; i < read.counts.size(); i++) check_equal(read.counts[i], content.counts[i]);
        for (size_t i = 0; i < read.differences.size(); i++) check_equal(read.differences[i], content.differences[i]);
    }
    check_equal(digest.value, PAYLOADS);

    Array<uint8_t> payload(budget);
    Content content(budget);
    for (int i = 0; i < 9; i++) content.counts.push(2);
    RangeEncoder encoder(payload);
    code_children(encoder, content.counts.span(), 18, budget);
    encoder.finish();
    for (uint64_t announced : {UINT64_C(17), UINT64_C(19)}) {
        check_fails(Fault::malformed, [&] {
            RangeDecoder decoder(payload.span());
            code_children(decoder, content.counts.span(), announced, budget);
        });
    }
}

} // namespace meshtide::testing
