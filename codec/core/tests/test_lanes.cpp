// base/lanes.hpp: every operation against what its comment says, on numbers that go to the edges.
#include "base/lanes.hpp"
#include "check.hpp"

#include <cmath>

namespace meshtide::testing {

namespace {

int clipped(int value) { return value < -32768 ? -32768 : value > 32767 ? 32767 : value; }

I16x8 some16(Numbers& numbers) {
    constexpr int16_t edges[] = {-32768, -32767, -1, 0, 1, 2, 16384, 32767};
    int16_t lanes[8];
    for (int16_t& lane : lanes)
        lane = numbers.below(3) == 0 ? edges[numbers.below(8)] : static_cast<int16_t>(numbers.between(-32768, 32767));
    return load<I16x8>(lanes);
}

I32x4 some32(Numbers& numbers) {
    constexpr int32_t edges[] = {INT32_MIN, INT32_MIN + 1, -32769, -32768, 0, 32767, 32768, INT32_MAX};
    int32_t lanes[4];
    for (int32_t& lane : lanes)
        lane = numbers.below(3) == 0 ? edges[numbers.below(8)] : numbers.between(-100000, 100000);
    return load<I32x4>(lanes);
}

F32x4 some_floats(Numbers& numbers) {
    constexpr float edges[] = {0.0f, -0.0f, 1e-45f, -1.1754944e-38f, 8388607.5f, -16777216.0f, 1e18f, 0.99999994f};
    float lanes[4];
    for (float& lane : lanes)
        lane =
            numbers.below(4) == 0 ? edges[numbers.below(8)] : static_cast<float>(numbers.between(-30000, 30000)) / 7.0f;
    return load<F32x4>(lanes);
}

bool same_bits(float a, float b) { return std::bit_cast<uint32_t>(a) == std::bit_cast<uint32_t>(b); }

void test_integers(Numbers& numbers) {
    I16x8 a = some16(numbers), b = some16(numbers);
    I32x4 p = some32(numbers), q = some32(numbers), r = some32(numbers), s = some32(numbers);
    I16x8 high = multiply_high(a, b), added = add_saturated(a, b), low_lanes = interleave_low(a, b);
    I16x8 high_lanes = interleave_high(a, b), packed = pack(p, q), less = least(a, b), more = greatest(a, b);
    I32x4 all = sums(p, q, r, s), plus = add32(p, q);
    for (int i = 0; i < 8; i++) {
        auto x = static_cast<uint16_t>(a[i]), y = static_cast<uint16_t>(b[i]);
        check_equal(static_cast<uint16_t>(high[i]), (static_cast<uint32_t>(x) * y) >> 16);
        check_equal(static_cast<int>(added[i]), clipped(a[i] + b[i]));
        check_equal(static_cast<int>(less[i]), a[i] < b[i] ? a[i] : b[i]);
        check_equal(static_cast<int>(more[i]), a[i] > b[i] ? a[i] : b[i]);
        check_equal(static_cast<int>(packed[i]), clipped(i < 4 ? p[i] : q[i - 4]));
        check_equal(static_cast<int>(low_lanes[i]), i % 2 == 0 ? a[i / 2] : b[i / 2]);
        check_equal(static_cast<int>(high_lanes[i]), i % 2 == 0 ? a[4 + i / 2] : b[4 + i / 2]);
    }
    a = greatest(a, splat16(-32767)); // not both -2^15
    I16x8 rounded = multiply_rounded(a, b);
    I32x4 pairs = multiply_pairs(a, b);
    for (int i = 0; i < 8; i++) check_equal(static_cast<int>(rounded[i]), (a[i] * b[i] + (1 << 14)) >> 15);

    auto total = [](I32x4 v) {
        uint32_t t = 0;
        for (int i = 0; i < 4; i++) t += static_cast<uint32_t>(v[i]);
        return static_cast<int32_t>(t);
    };
    const I32x4 rows[] = {p, q, r, s};
    for (int i = 0; i < 4; i++) {
        int64_t pair = static_cast<int64_t>(a[2 * i]) * b[2 * i] + static_cast<int64_t>(a[2 * i + 1]) * b[2 * i + 1];
        check_equal(pairs[i], static_cast<int32_t>(static_cast<uint32_t>(pair)));
        check_equal(all[i], total(rows[i]));
        check_equal(plus[i], static_cast<int32_t>(static_cast<uint32_t>(p[i]) + static_cast<uint32_t>(q[i])));
        check_equal(signs(p) >> i & 1, p[i] < 0 ? 1 : 0);
    }
    check_equal(sum(p), total(p));
}

void test_floats(Numbers& numbers) {
    F32x4 a = some_floats(numbers), b = some_floats(numbers);
    F32x4 less = least(a, b), more = greatest(a, b), root = square_root(magnitude(a)), crossed = cross3(a, b);
    for (int i = 0; i < 4; i++) {
        check(same_bits(less[i], a[i] < b[i] ? a[i] : b[i])); // b of two that are equal, such as 0 and -0
        check(same_bits(more[i], a[i] > b[i] ? a[i] : b[i]));
        check(same_bits(root[i], std::sqrt(std::fabs(a[i]))));
    }
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        float forth = a[j] * b[k], back = a[k] * b[j];
        check(same_bits(crossed[i], forth - back));
    }
    float x = a[0] * b[0], y = a[1] * b[1], z = a[2] * b[2];
    check(same_bits(dot3(a, b), x + y + z));

    F32x4 small = least(greatest(a, splat(-2e9f)), splat(2e9f));
    I32x4 cut = truncate(small);
    for (int i = 0; i < 4; i++) check_equal(cut[i], static_cast<int32_t>(small[i]));
    I32x4 p = some32(numbers);
    F32x4 converted = to_floats(p);
    for (int i = 0; i < 4; i++) check(same_bits(converted[i], static_cast<float>(p[i])));
}

} // namespace

void test_lanes() {
    Numbers numbers;
    for (int round = 0; round < 20000; round++) {
        test_integers(numbers);
        test_floats(numbers);
    }
    check_equal(splat16(-3)[7], -3);
    check_equal(splat32(1 << 20)[3], 1 << 20);
    check(same_bits(splat(0.1f)[2], 0.1f));
}

} // namespace meshtide::testing
