// What building and searching of the tree agree on.
#pragma once

#include "base/lanes.hpp"

#include <cstddef>
#include <cstdint>

namespace meshtide::inline MESHTIDE_ISA {

constexpr int32_t ABSENT = INT32_MIN;        // a child that a node does not have
constexpr float FAR = 1e15f;                 // where its box is
constexpr float COORDINATE_ERROR = 0x1p-24f; // of floats below 1
// A node's binary tree is no deeper than keys have bits and counts have halvings; a step leaves three children behind.
constexpr size_t STACK_SIZE = 3 * (48 + 32) + 4;

// Of four pairs of vectors.
MESHTIDE_INLINE F32x4 dot(const F32x4 (&a)[3], const F32x4 (&b)[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

} // namespace meshtide::inline MESHTIDE_ISA
