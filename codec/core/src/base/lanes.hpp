// Vectors of 16 bytes whose every operation gives the same bits on every machine.
//
// The compiler's own vector types serve for what they do well (+ - * /, comparisons, shuffles); what processors have as
// single instructions and compilers do not find is written for SSE2, SSE4.1, NEON and WebAssembly, with a plain form
// beside it that says what it computes. Floats are never fused (-ffp-contract=off).
#pragma once

#include "base/inlining.hpp"

#include <bit>
#include <cstdint>
#include <cstring>

#if defined(MESHTIDE_PLAIN_LANES)
#elif defined(__SSE2__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#elif defined(__wasm_simd128__)
#include <wasm_simd128.h>
#endif

#ifndef MESHTIDE_ISA
#define MESHTIDE_ISA baseline
#endif

namespace meshtide::inline MESHTIDE_ISA {

typedef int16_t I16x8 __attribute__((vector_size(16)));
typedef uint16_t U16x8 __attribute__((vector_size(16)));
typedef int32_t I32x4 __attribute__((vector_size(16)));
typedef uint32_t U32x4 __attribute__((vector_size(16)));
typedef float F32x4 __attribute__((vector_size(16)));

MESHTIDE_INLINE I16x8 splat16(int value) {
    auto v = static_cast<int16_t>(value);
    return I16x8{v, v, v, v, v, v, v, v};
}
MESHTIDE_INLINE I32x4 splat32(int value) { return I32x4{value, value, value, value}; }
MESHTIDE_INLINE F32x4 splat(float value) { return F32x4{value, value, value, value}; }

template <class V>
MESHTIDE_INLINE V load(const void* from) {
    V value;
    std::memcpy(&value, from, 16);
    return value;
}
template <class V>
MESHTIDE_INLINE void store(void* to, V value) {
    std::memcpy(to, &value, 16);
}

#if defined(MESHTIDE_PLAIN_LANES) || !(defined(__SSE2__) || defined(__ARM_NEON) || defined(__wasm_simd128__))

// (a * b) >> 16, unsigned.
MESHTIDE_INLINE I16x8 multiply_high(I16x8 a, I16x8 b) {
    I16x8 c;
    for (int i = 0; i < 8; i++)
        c[i] = static_cast<int16_t>(
            (static_cast<uint32_t>(static_cast<uint16_t>(a[i])) * static_cast<uint16_t>(b[i])) >> 16);
    return c;
}
// (a * b + 2^14) >> 15; never both -2^15.
MESHTIDE_INLINE I16x8 multiply_rounded(I16x8 a, I16x8 b) {
    I16x8 c;
    for (int i = 0; i < 8; i++) c[i] = static_cast<int16_t>((a[i] * b[i] + (1 << 14)) >> 15);
    return c;
}
MESHTIDE_INLINE int16_t saturated(int value) {
    return static_cast<int16_t>(value < -32768 ? -32768 : value > 32767 ? 32767 : value);
}
MESHTIDE_INLINE I16x8 add_saturated(I16x8 a, I16x8 b) {
    I16x8 c;
    for (int i = 0; i < 8; i++) c[i] = saturated(a[i] + b[i]);
    return c;
}
// a0 b0 + a1 b1, a2 b2 + a3 b3, ..., modulo 2^32.
MESHTIDE_INLINE I32x4 multiply_pairs(I16x8 a, I16x8 b) {
    I32x4 c;
    for (int i = 0; i < 4; i++)
        c[i] = static_cast<int32_t>(static_cast<uint32_t>(a[2 * i] * b[2 * i]) +
                                    static_cast<uint32_t>(a[2 * i + 1] * b[2 * i + 1]));
    return c;
}
MESHTIDE_INLINE I16x8 pack(I32x4 a, I32x4 b) {
    I16x8 c;
    for (int i = 0; i < 4; i++) {
        c[i] = saturated(a[i]);
        c[i + 4] = saturated(b[i]);
    }
    return c;
}
MESHTIDE_INLINE I16x8 least(I16x8 a, I16x8 b) {
    I16x8 c;
    for (int i = 0; i < 8; i++) c[i] = a[i] < b[i] ? a[i] : b[i];
    return c;
}
MESHTIDE_INLINE I16x8 greatest(I16x8 a, I16x8 b) {
    I16x8 c;
    for (int i = 0; i < 8; i++) c[i] = a[i] > b[i] ? a[i] : b[i];
    return c;
}
MESHTIDE_INLINE F32x4 least(F32x4 a, F32x4 b) {
    F32x4 c;
    for (int i = 0; i < 4; i++) c[i] = a[i] < b[i] ? a[i] : b[i];
    return c;
}
MESHTIDE_INLINE F32x4 greatest(F32x4 a, F32x4 b) {
    F32x4 c;
    for (int i = 0; i < 4; i++) c[i] = a[i] > b[i] ? a[i] : b[i];
    return c;
}
MESHTIDE_INLINE F32x4 square_root(F32x4 a) {
    F32x4 c;
    for (int i = 0; i < 4; i++) c[i] = __builtin_sqrtf(a[i]);
    return c;
}
// Towards zero; only of what fits.
MESHTIDE_INLINE I32x4 truncate(F32x4 a) {
    I32x4 c;
    for (int i = 0; i < 4; i++) c[i] = static_cast<int32_t>(a[i]);
    return c;
}
// Bit i of the answer is the sign of lane i.
MESHTIDE_INLINE int signs(I32x4 a) {
    int bits = 0;
    for (int i = 0; i < 4; i++) bits |= static_cast<int>(static_cast<uint32_t>(a[i]) >> 31) << i;
    return bits;
}

#elif defined(__SSE2__)

MESHTIDE_INLINE I16x8 multiply_high(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(_mm_mulhi_epu16(reinterpret_cast<__m128i>(a), reinterpret_cast<__m128i>(b)));
}
MESHTIDE_INLINE I16x8 multiply_rounded(I16x8 a, I16x8 b) {
    auto x = reinterpret_cast<__m128i>(a), y = reinterpret_cast<__m128i>(b);
#ifdef __SSSE3__
    return reinterpret_cast<I16x8>(_mm_mulhrs_epi16(x, y));
#else
    __m128i low = _mm_add_epi16(_mm_srli_epi16(_mm_mullo_epi16(x, y), 14), _mm_set1_epi16(1));
    return reinterpret_cast<I16x8>(_mm_add_epi16(_mm_slli_epi16(_mm_mulhi_epi16(x, y), 1), _mm_srli_epi16(low, 1)));
#endif
}
MESHTIDE_INLINE I16x8 add_saturated(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(_mm_adds_epi16(reinterpret_cast<__m128i>(a), reinterpret_cast<__m128i>(b)));
}
MESHTIDE_INLINE I32x4 multiply_pairs(I16x8 a, I16x8 b) {
    return reinterpret_cast<I32x4>(_mm_madd_epi16(reinterpret_cast<__m128i>(a), reinterpret_cast<__m128i>(b)));
}
MESHTIDE_INLINE I16x8 pack(I32x4 a, I32x4 b) {
    return reinterpret_cast<I16x8>(_mm_packs_epi32(reinterpret_cast<__m128i>(a), reinterpret_cast<__m128i>(b)));
}
MESHTIDE_INLINE I16x8 least(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(_mm_min_epi16(reinterpret_cast<__m128i>(a), reinterpret_cast<__m128i>(b)));
}
MESHTIDE_INLINE I16x8 greatest(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(_mm_max_epi16(reinterpret_cast<__m128i>(a), reinterpret_cast<__m128i>(b)));
}
MESHTIDE_INLINE F32x4 least(F32x4 a, F32x4 b) { return static_cast<F32x4>(_mm_min_ps(a, b)); }
MESHTIDE_INLINE F32x4 greatest(F32x4 a, F32x4 b) { return static_cast<F32x4>(_mm_max_ps(a, b)); }
MESHTIDE_INLINE F32x4 square_root(F32x4 a) { return static_cast<F32x4>(_mm_sqrt_ps(a)); }
MESHTIDE_INLINE I32x4 truncate(F32x4 a) { return reinterpret_cast<I32x4>(_mm_cvttps_epi32(a)); }
MESHTIDE_INLINE int signs(I32x4 a) { return _mm_movemask_ps(reinterpret_cast<__m128>(a)); }

#elif defined(__ARM_NEON)

MESHTIDE_INLINE I16x8 multiply_high(I16x8 a, I16x8 b) {
    auto x = reinterpret_cast<uint16x8_t>(a), y = reinterpret_cast<uint16x8_t>(b);
    uint32x4_t low = vmull_u16(vget_low_u16(x), vget_low_u16(y)), high = vmull_u16(vget_high_u16(x), vget_high_u16(y));
    return reinterpret_cast<I16x8>(vcombine_u16(vshrn_n_u32(low, 16), vshrn_n_u32(high, 16)));
}
MESHTIDE_INLINE I16x8 multiply_rounded(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(vqrdmulhq_s16(reinterpret_cast<int16x8_t>(a), reinterpret_cast<int16x8_t>(b)));
}
MESHTIDE_INLINE I16x8 add_saturated(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(vqaddq_s16(reinterpret_cast<int16x8_t>(a), reinterpret_cast<int16x8_t>(b)));
}
MESHTIDE_INLINE I32x4 multiply_pairs(I16x8 a, I16x8 b) {
    auto x = reinterpret_cast<int16x8_t>(a), y = reinterpret_cast<int16x8_t>(b);
    int32x4_t low = vmull_s16(vget_low_s16(x), vget_low_s16(y)), high = vmull_s16(vget_high_s16(x), vget_high_s16(y));
    return reinterpret_cast<I32x4>(vcombine_s32(vpadd_s32(vget_low_s32(low), vget_high_s32(low)),
                                                vpadd_s32(vget_low_s32(high), vget_high_s32(high))));
}
MESHTIDE_INLINE I16x8 pack(I32x4 a, I32x4 b) {
    return reinterpret_cast<I16x8>(
        vcombine_s16(vqmovn_s32(reinterpret_cast<int32x4_t>(a)), vqmovn_s32(reinterpret_cast<int32x4_t>(b))));
}
MESHTIDE_INLINE I16x8 least(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(vminq_s16(reinterpret_cast<int16x8_t>(a), reinterpret_cast<int16x8_t>(b)));
}
MESHTIDE_INLINE I16x8 greatest(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(vmaxq_s16(reinterpret_cast<int16x8_t>(a), reinterpret_cast<int16x8_t>(b)));
}
MESHTIDE_INLINE F32x4 least(F32x4 a, F32x4 b) { return a < b ? a : b; }
MESHTIDE_INLINE F32x4 greatest(F32x4 a, F32x4 b) { return a > b ? a : b; }
MESHTIDE_INLINE F32x4 square_root(F32x4 a) {
    return reinterpret_cast<F32x4>(vsqrtq_f32(reinterpret_cast<float32x4_t>(a)));
}
MESHTIDE_INLINE I32x4 truncate(F32x4 a) {
    return reinterpret_cast<I32x4>(vcvtq_s32_f32(reinterpret_cast<float32x4_t>(a)));
}
MESHTIDE_INLINE int signs(I32x4 a) {
    auto top = vshrq_n_u32(reinterpret_cast<uint32x4_t>(a), 31);
    return static_cast<int>(vgetq_lane_u32(top, 0) | vgetq_lane_u32(top, 1) << 1 | vgetq_lane_u32(top, 2) << 2 |
                            vgetq_lane_u32(top, 3) << 3);
}

#else // WebAssembly

MESHTIDE_INLINE I16x8 multiply_high(I16x8 a, I16x8 b) {
    auto x = reinterpret_cast<v128_t>(a), y = reinterpret_cast<v128_t>(b);
    return reinterpret_cast<I16x8>(wasm_i16x8_shuffle(wasm_u32x4_extmul_low_u16x8(x, y),
                                                      wasm_u32x4_extmul_high_u16x8(x, y), 1, 3, 5, 7, 9, 11, 13, 15));
}
MESHTIDE_INLINE I16x8 multiply_rounded(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(wasm_i16x8_q15mulr_sat(reinterpret_cast<v128_t>(a), reinterpret_cast<v128_t>(b)));
}
MESHTIDE_INLINE I16x8 add_saturated(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(wasm_i16x8_add_sat(reinterpret_cast<v128_t>(a), reinterpret_cast<v128_t>(b)));
}
MESHTIDE_INLINE I32x4 multiply_pairs(I16x8 a, I16x8 b) {
    return reinterpret_cast<I32x4>(wasm_i32x4_dot_i16x8(reinterpret_cast<v128_t>(a), reinterpret_cast<v128_t>(b)));
}
MESHTIDE_INLINE I16x8 pack(I32x4 a, I32x4 b) {
    return reinterpret_cast<I16x8>(wasm_i16x8_narrow_i32x4(reinterpret_cast<v128_t>(a), reinterpret_cast<v128_t>(b)));
}
MESHTIDE_INLINE I16x8 least(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(wasm_i16x8_min(reinterpret_cast<v128_t>(a), reinterpret_cast<v128_t>(b)));
}
MESHTIDE_INLINE I16x8 greatest(I16x8 a, I16x8 b) {
    return reinterpret_cast<I16x8>(wasm_i16x8_max(reinterpret_cast<v128_t>(a), reinterpret_cast<v128_t>(b)));
}
// pmin and pmax with the operands turned: b where neither is less, as on the other machines.
MESHTIDE_INLINE F32x4 least(F32x4 a, F32x4 b) {
    return reinterpret_cast<F32x4>(wasm_f32x4_pmin(reinterpret_cast<v128_t>(b), reinterpret_cast<v128_t>(a)));
}
MESHTIDE_INLINE F32x4 greatest(F32x4 a, F32x4 b) {
    return reinterpret_cast<F32x4>(wasm_f32x4_pmax(reinterpret_cast<v128_t>(b), reinterpret_cast<v128_t>(a)));
}
MESHTIDE_INLINE F32x4 square_root(F32x4 a) {
    return reinterpret_cast<F32x4>(wasm_f32x4_sqrt(reinterpret_cast<v128_t>(a)));
}
MESHTIDE_INLINE I32x4 truncate(F32x4 a) {
    return reinterpret_cast<I32x4>(wasm_i32x4_trunc_sat_f32x4(reinterpret_cast<v128_t>(a)));
}
MESHTIDE_INLINE int signs(I32x4 a) { return static_cast<int>(wasm_i32x4_bitmask(reinterpret_cast<v128_t>(a))); }

#endif

MESHTIDE_INLINE F32x4 to_floats(I32x4 a) { return __builtin_convertvector(a, F32x4); }
MESHTIDE_INLINE F32x4 magnitude(F32x4 a) {
    return reinterpret_cast<F32x4>(reinterpret_cast<I32x4>(a) & splat32(0x7fffffff));
}

MESHTIDE_INLINE I32x4 least32(I32x4 a, I32x4 b) { return a < b ? a : b; }
MESHTIDE_INLINE I32x4 greatest32(I32x4 a, I32x4 b) { return a > b ? a : b; }
// The greatest of the lanes, in all lanes.
MESHTIDE_INLINE I32x4 greatest_of(I32x4 a) {
    a = greatest32(a, __builtin_shufflevector(a, a, 2, 3, 0, 1));
    return greatest32(a, __builtin_shufflevector(a, a, 1, 0, 3, 2));
}

// The lower, and the upper, four lanes of both in turn.
MESHTIDE_INLINE I16x8 interleave_low(I16x8 a, I16x8 b) {
    return __builtin_shufflevector(a, b, 0, 8, 1, 9, 2, 10, 3, 11);
}
MESHTIDE_INLINE I16x8 interleave_high(I16x8 a, I16x8 b) {
    return __builtin_shufflevector(a, b, 4, 12, 5, 13, 6, 14, 7, 15);
}

// Sums of the lanes of each, modulo 2^32.
MESHTIDE_INLINE I32x4 sums(I32x4 a, I32x4 b, I32x4 c, I32x4 d) {
    auto p = reinterpret_cast<U32x4>(a), q = reinterpret_cast<U32x4>(b);
    auto r = reinterpret_cast<U32x4>(c), s = reinterpret_cast<U32x4>(d);
    U32x4 pq = __builtin_shufflevector(p, q, 0, 1, 4, 5) + __builtin_shufflevector(p, q, 2, 3, 6, 7);
    U32x4 rs = __builtin_shufflevector(r, s, 0, 1, 4, 5) + __builtin_shufflevector(r, s, 2, 3, 6, 7);
    return reinterpret_cast<I32x4>(__builtin_shufflevector(pq, rs, 0, 2, 4, 6) +
                                   __builtin_shufflevector(pq, rs, 1, 3, 5, 7));
}
MESHTIDE_INLINE int sum(I32x4 a) {
    auto b = reinterpret_cast<U32x4>(a);
    b = b + __builtin_shufflevector(b, b, 2, 3, 0, 1);
    return static_cast<int>(b[0] + b[1]);
}
// a + b, modulo 2^32.
MESHTIDE_INLINE I32x4 add32(I32x4 a, I32x4 b) {
    return reinterpret_cast<I32x4>(reinterpret_cast<U32x4>(a) + reinterpret_cast<U32x4>(b));
}

// The x, y and z products, added in this order; the fourth lane is left out.
MESHTIDE_INLINE float dot3(F32x4 a, F32x4 b) {
    F32x4 c = a * b;
    return c[0] + c[1] + c[2];
}
// The fourth lane is 0 unless it is infinite.
MESHTIDE_INLINE F32x4 cross3(F32x4 a, F32x4 b) {
    return __builtin_shufflevector(a, a, 1, 2, 0, 3) * __builtin_shufflevector(b, b, 2, 0, 1, 3) -
           __builtin_shufflevector(a, a, 2, 0, 1, 3) * __builtin_shufflevector(b, b, 1, 2, 0, 3);
}

} // namespace meshtide::inline MESHTIDE_ISA
