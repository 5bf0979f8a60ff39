#include "base/processor.hpp"

#ifdef __x86_64__
#include <cpuid.h>
#endif

namespace meshtide::inline MESHTIDE_ISA {

#ifdef __x86_64__

// Intel, Software Developer's Manual, volume 1, 14.3 and volume 2, CPUID. Asked by hand: the compilers' own question
// (__builtin_cpu_supports) needs a part of a run-time library that zig's does not have.
static bool runs_avx2() {
    constexpr unsigned OSXSAVE = 1u << 27, AVX = 1u << 28;            // leaf 1, ecx
    constexpr unsigned BMI = 1u << 3, AVX2 = 1u << 5, BMI2 = 1u << 8; // leaf 7, ebx
    unsigned a = 0, b = 0, c = 0, d = 0;
    if (__get_cpuid(1, &a, &b, &c, &d) == 0 || (c & OSXSAVE) == 0 || (c & AVX) == 0) return false;
    if (__get_cpuid_count(7, 0, &a, &b, &c, &d) == 0) return false;
    if ((b & BMI) == 0 || (b & AVX2) == 0 || (b & BMI2) == 0) return false;
    unsigned saved = 0, upper = 0; // which registers the system keeps for each thread
    __asm__("xgetbv" : "=a"(saved), "=d"(upper) : "c"(0));
    return (saved & 6) == 6; // those of SSE and of AVX
}

const char* best_kind() { return runs_avx2() ? "avx2" : "baseline"; }

#else

const char* best_kind() { return "baseline"; }

#endif

} // namespace meshtide::inline MESHTIDE_ISA
