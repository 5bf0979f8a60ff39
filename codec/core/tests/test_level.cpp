// mesh/level.hpp: half-edges find their twins, rings go round.
#include "check.hpp"
#include "mesh/level.hpp"

#include <algorithm>
#include <array>
#include <initializer_list>
#include <vector>

namespace meshtide::testing {

namespace {

void make(Level& level, size_t vertices, std::initializer_list<int32_t> corners, Budget& budget) {
    level.centres.assign(vertices, F32x4{0, 0, 0, 0});
    level.corners.clear();
    int place = 0;
    for (int32_t corner : corners) {
        level.corners.push(corner);
        if (++place % 3 == 0) level.corners.push(0);
    }
    link(level, budget);
}

void check_twins(const Level& level) {
    for (size_t t = 0; t < level.face_count(); t++) {
        for (size_t k = 0; k < 3; k++) {
            auto h = static_cast<int32_t>(4 * t + k);
            check_equal(previous_half_edge(next_half_edge(h)), h);
            int32_t twin = level.twins[4 * t + k];
            if (twin < 0) continue;
            check_equal(level.twins[static_cast<size_t>(twin)], h);
            check_equal(level.corners[static_cast<size_t>(twin)],
                        level.corners[static_cast<size_t>(next_half_edge(h))]);
            check_equal(level.corners[static_cast<size_t>(next_half_edge(twin))], level.corners[4 * t + k]);
        }
    }
}

} // namespace

void test_level() {
    Budget budget(1 << 20);
    Level level(budget);
    Ring ring;

    make(level, 4, {0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2}, budget); // a tetrahedron
    check_twins(level);
    for (size_t v = 0; v < 4; v++) {
        walk_ring(level, v, ring);
        check(ring.closed);
        check_equal(ring.count, 3);
    }

    make(level, 5, {0, 1, 2, 0, 2, 3}, budget); // two triangles, and a vertex without any
    check_twins(level);
    check_equal(level.twins[2], 4); // 2 -> 0 of the first, 0 -> 2 of the second
    walk_ring(level, 0, ring);
    check(!ring.closed);
    check_equal(ring.count, 3);
    check_equal(ring.members[0], 1 + 2 * (ring.members[0] == 3));
    walk_ring(level, 1, ring);
    check_equal(ring.count, 2);
    walk_ring(level, 4, ring);
    check_equal(ring.count, 0);
    check_equal(level.heads[4], NONE);

    make(level, 5, {0, 1, 2, 1, 0, 3, 1, 0, 4, 0, 1, 4}, budget); // four faces at one edge: paired as they come
    check_twins(level);

    // Two hubs with very many faces at one edge, to and fro: the k-th of these half-edges pairs with the k-th of those.
    // Each list is gone through once, or this would take minutes.
    constexpr int32_t MANY = 200000;
    Budget large(1 << 26);
    Level hubs(large);
    hubs.centres.assign(MANY + 2, F32x4{0, 0, 0, 0});
    for (int32_t i = 0; i < MANY; i++)
        for (int32_t corner : {i % 2, 1 - i % 2, 2 + i, 0}) hubs.corners.push(corner);
    link(hubs, large);
    for (int32_t i = 0; i < MANY; i++) check_equal(hubs.twins[static_cast<size_t>(4 * i)], 4 * (i ^ 1));

    // A fan that is longer than a ring may be.
    level.centres.assign(101, F32x4{0, 0, 0, 0});
    level.corners.clear();
    for (int32_t i = 0; i < 100; i++)
        for (int32_t corner : {0, 1 + i, 1 + (i + 1) % 100, 0}) level.corners.push(corner);
    link(level, budget);
    check_twins(level);
    walk_ring(level, 0, ring);
    check(!ring.closed);
    check_equal(ring.count, RING_LIMIT);

    // Faces in lexicographic order, many of one least corner and few, from wherever they begin.
    std::vector<std::array<int32_t, 3>> expected;
    level.corners.clear();
    for (int32_t i = 0; i < 100; i++) {
        std::array<int32_t, 3> face{i % 30 == 29 ? 3 : 0, 4 + i * 37 % 97, 4 + i * 11 % 89};
        expected.push_back(face);
        for (size_t k = 0; k < 3; k++) level.corners.push(face[(k + static_cast<size_t>(i)) % 3]);
        level.corners.push(0);
    }
    std::sort(expected.begin(), expected.end());
    Array<int32_t> sorted(budget);
    canonical_faces(level, sorted, budget);
    check_equal(sorted.size(), 300u);
    for (size_t i = 0; i < 300; i++) check_equal(sorted[i], expected[i / 3][i % 3]);

    check_fails(Fault::internal, [&] { make(level, 2, {0, 1, 2}, budget); });
    check_fails(Fault::internal, [&] { make(level, 2, {0, 1, -1}, budget); });
    Budget small(100);
    check_fails(Fault::limit, [&] { Level(small).twins.assign(26, 0); });
}

} // namespace meshtide::testing
