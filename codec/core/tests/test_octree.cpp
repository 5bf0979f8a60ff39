// mesh/octree.hpp: cells, parents and faces of every depth.
#include "check.hpp"
#include "mesh/octree.hpp"

#include <algorithm>
#include <array>

namespace meshtide::testing {

namespace {

uint64_t morton(const int32_t* position, int bits) {
    uint64_t code = 0;
    for (int b = bits - 1; b >= 0; b--)
        for (int k = 0; k < 3; k++) code = code << 1 | static_cast<uint64_t>(position[k] >> b & 1);
    return code;
}

} // namespace

void test_octree() {
    constexpr int BITS = 6;
    Budget budget(1 << 22);
    Numbers numbers;
    std::vector<std::array<int32_t, 3>> points;
    for (int i = 0; i < 400; i++) {
        std::array<int32_t, 3> point;
        for (int32_t& x : point) x = static_cast<int32_t>(numbers.below(1 << BITS));
        points.push_back(point);
    }
    std::sort(points.begin(), points.end(),
              [](const auto& a, const auto& b) { return morton(a.data(), BITS) < morton(b.data(), BITS); });
    points.erase(std::unique(points.begin(), points.end()), points.end());
    Array<int32_t> positions(budget), faces(budget);
    for (const auto& point : points)
        for (int32_t x : point) positions.push(x);
    auto n = static_cast<uint32_t>(points.size());
    for (int i = 0; i < 700; i++) {
        uint32_t a = numbers.below(n), b = numbers.below(n), c = numbers.below(n);
        if (a == b || b == c || c == a) continue;
        for (uint32_t v : {a, b, c}) faces.push(static_cast<int32_t>(v));
    }
    Octree octree(static_cast<Span<const int32_t>>(positions.span()), static_cast<Span<const int32_t>>(faces.span()),
                  BITS, budget);
    check_equal(octree.depths[0].cell_count(), 1u);
    check_equal(octree.at(BITS).cell_count(), n);
    int last = static_cast<int>(octree.depths.size()) - 1;
    check(last <= BITS && (last == 0 || octree.at(last - 1).cell_count() < n));

    Digest digest;
    Level level(budget);
    for (int b = 0; b <= last; b++) {
        octree.make_level(b, level, budget);
        size_t cells = octree.depths[static_cast<size_t>(b)].cell_count();
        check_equal(level.vertex_count(), cells);
        if (b < last) {
            check_equal(level.first_children[0], 0u);
            check_equal(level.first_children[cells], octree.depths[static_cast<size_t>(b) + 1].cell_count());
        }
        for (size_t v = 0; v < cells; v++) {
            int shift = BITS - level.cell_depths[v];
            check(level.cell_depths[v] <= b && (level.leaves[v] != 0 || level.cell_depths[v] == b));
            const auto& point = points[octree.depths[static_cast<size_t>(b)].first[v]];
            for (size_t k = 0; k < 3; k++)
                check_equal(static_cast<int>(level.centres[v][k]), ((2 * (point[k] >> shift)) + 1) << shift);
            if (b < last) check(level.first_children[v + 1] > level.first_children[v]);
        }
        for (size_t t = 0; t < level.face_count(); t++) {
            const int32_t* c = level.corners.begin() + 4 * t;
            check(c[0] < c[1] && c[0] < c[2] && c[1] != c[2]);
            if (t > 0) check(std::lexicographical_compare(c - 4, c - 1, c, c + 3));
        }
        digest.add(level.centres.begin(), 16 * cells);
        digest.add(level.corners.begin(), 4 * level.corners.size());
        digest.add(level.twins.begin(), 4 * level.twins.size());
    }
    check_equal(digest.value, 0x435c2fcfeb472309);

    Budget small(1000);
    check_fails(Fault::limit, [&] {
        Octree(static_cast<Span<const int32_t>>(positions.span()), static_cast<Span<const int32_t>>(faces.span()), BITS,
               small);
    });
    auto refused = [&](Array<int32_t>& array, size_t place, int32_t value) {
        int32_t kept = array[place];
        array[place] = value;
        check_fails(Fault::argument, [&] {
            Octree(static_cast<Span<const int32_t>>(positions.span()), static_cast<Span<const int32_t>>(faces.span()),
                   BITS, budget);
        });
        array[place] = kept;
    };
    refused(faces, 0, static_cast<int32_t>(n));
    refused(faces, 0, -1);
    refused(faces, 0, faces[1]);
    refused(positions, 0, 1 << BITS);
    refused(positions, 0, -1);
    refused(positions, 3 * n - 3, 0);
}

} // namespace meshtide::testing
