#include "surface/closest_points.hpp"

#include "surface/closest_points_tree.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr double WELL_SHAPED = 1e-10;  // (sine of a corner)^2 below which the sides have a say in any case
constexpr size_t PROBES = 32;          // searches that show how long all of them would take
constexpr double ORDINARY = 40.0;      // visited nodes of a search that is no reason to look at fewer points
constexpr double VISITS_ALLOWED = 3e5; // nodes visited in all before fewer points are looked at

double clamped(double value) { return value < 0.0 ? 0.0 : value > 1.0 ? 1.0 : value; }

// Squared distance of a point from segments: `offset` is from their start to it, `along` their extent.
MESHTIDE_INLINE F32x4 squared_from_segments(const F32x4 (&offset)[3], const F32x4 (&along)[3]) {
    F32x4 share = dot(offset, along) / greatest(dot(along, along), splat(1e-37f));
    share = least(greatest(share, splat(0.0f)), splat(1.0f));
    F32x4 off[3];
    for (int k = 0; k < 3; k++) off[k] = offset[k] - share * along[k];
    return dot(off, off);
}

MESHTIDE_INLINE F32x4 select(I32x4 mask, F32x4 yes, F32x4 no) {
    return reinterpret_cast<F32x4>((reinterpret_cast<I32x4>(yes) & mask) | (reinterpret_cast<I32x4>(no) & ~mask));
}

} // namespace

Closest closest_on_face(const Surface& surface, size_t face, Vector point) {
    Vector a = surface.at(face, 0);
    Vector b = surface.at(face, 1) - a, c = surface.at(face, 2) - a, p = point - a;
    double bb = dot(b, b), bc = dot(b, c), cc = dot(c, c);
    double pb = dot(p, b), pc = dot(p, c);
    double best = INFINITY, second = 0.0, third = 0.0;
    auto number = static_cast<int32_t>(face);
    double determinant = bb * cc - bc * bc;
    if (determinant > 0.0) {
        double v = (cc * pb - bc * pc) / determinant, w = (bb * pc - bc * pb) / determinant;
        if (v >= 0.0 && w >= 0.0 && v + w <= 1.0) {
            Vector off = p - b * v - c * w;
            best = dot(off, off), second = v, third = w;
            if (determinant > WELL_SHAPED * bb * cc) return {best, {number, second, third}};
        }
    }
    double along = bb > 0.0 ? clamped(pb / bb) : 0.0;
    Vector off = p - b * along;
    double squared = dot(off, off);
    if (squared < best) best = squared, second = along, third = 0.0;
    along = cc > 0.0 ? clamped(pc / cc) : 0.0;
    off = p - c * along;
    squared = dot(off, off);
    if (squared < best) best = squared, second = 0.0, third = along;
    Vector e = c - b, q = p - b;
    double ee = dot(e, e);
    along = ee > 0.0 ? clamped(dot(q, e) / ee) : 0.0;
    off = q - e * along;
    squared = dot(off, off);
    if (squared < best) best = squared, second = 1.0 - along, third = along;
    return {best, {number, second, third}};
}

MESHTIDE_INLINE F32x4 ClosestPoints::squared_distances(const Node& node, const Point& point) {
    F32x4 zero = splat(0.0f);
    F32x4 off[3];
    for (int k = 0; k < 3; k++)
        off[k] =
            greatest(greatest(load<F32x4>(node.low[k]) - point.at[k], point.at[k] - load<F32x4>(node.high[k])), zero);
    return dot(off, off);
}

// From the plane where the point is over the triangle, otherwise from the nearest side. Whether it is over the triangle
// is decided by products with the normal, which stay right for slivers.
MESHTIDE_INLINE F32x4 ClosestPoints::squared_distances(const Block& block, const Point& point) {
    F32x4 p[3], b[3], c[3], q[3], e[3]; // from the first corner, but for q, from the second
    for (int k = 0; k < 3; k++) {
        p[k] = point.at[k] - load<F32x4>(block.first[k]);
        b[k] = load<F32x4>(block.second[k]);
        c[k] = load<F32x4>(block.third[k]);
        q[k] = p[k] - b[k];
        e[k] = c[k] - b[k];
    }
    F32x4 sides = least(squared_from_segments(p, b), least(squared_from_segments(p, c), squared_from_segments(q, e)));

    F32x4 normal[3] = {b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]};
    F32x4 turned[3] = {normal[1] * p[2] - normal[2] * p[1], normal[2] * p[0] - normal[0] * p[2],
                       normal[0] * p[1] - normal[1] * p[0]};
    F32x4 square = dot(normal, normal), height = dot(normal, p);
    // Each is negative outside of one side.
    F32x4 inner = least(least(dot(c, turned), F32x4{} - dot(b, turned)), square - dot(e, turned));
    I32x4 over = (inner >= splat(0.0f)) & (square > splat(0.0f));
    F32x4 plane = height * height / greatest(square, splat(1e-37f));
    return select(over, least(plane, sides), sides);
}

// Triangles that may be the closest, by their distances in floats.
struct ClosestPoints::Contest {
    static constexpr size_t ROOM = 16;
    struct Entry {
        int32_t face;
        float squared;
    };
    Contest(const ClosestPoints& tree_, Vector at_, float error_) : tree(tree_), at(at_), error(error_) {}

    const ClosestPoints& tree;
    Vector at;
    float error; // by which two distances in floats may be wrong
    float least_squared = FAR * FAR;
    float limit = FAR * FAR; // none beyond it can win
    size_t count = 0;
    Closest best{INFINITY, {}}; // of those that have been measured in doubles
    Entry entries[ROOM];

    MESHTIDE_INLINE void enter(const Block& block, const Point& point) {
        F32x4 squared = squared_distances(block, point);
        int near = ~signs(squared > splat(limit)) & 15;
        for (; near != 0; near &= near - 1) {
            auto lane = static_cast<size_t>(__builtin_ctz(static_cast<unsigned>(near)));
            if (squared[lane] > limit) continue;
            if (count == ROOM) [[unlikely]]
                measure();
            entries[count++] = {block.faces[lane], squared[lane]};
            lower_limit(squared[lane]);
        }
    }
    void lower_limit(float squared) {
        if (!(squared < least_squared)) return;
        least_squared = squared;
        float reach = std::sqrt(squared) + error;
        limit = reach * reach;
    }
    // In doubles, which leaves none.
    void measure() {
        for (size_t i = 0; i < count; i++) {
            if (entries[i].squared > limit) continue;
            Closest found = closest_on_face(tree.surface_, static_cast<size_t>(entries[i].face), at);
            if (found.squared < best.squared || best.foot.face < 0) best = found;
        }
        count = 0;
        lower_limit(static_cast<float>(best.squared * tree.scale_ * tree.scale_));
    }
};

// What is visited next is not always in the cache: most time would be spent on waiting for it.
MESHTIDE_INLINE void ClosestPoints::prefetch(int32_t child) const {
    auto start = child < 0 ? reinterpret_cast<const char*>(blocks_.begin() + ~child)
                           : reinterpret_cast<const char*>(nodes_.begin() + child);
    size_t size = child < 0 ? sizeof(Block) : sizeof(Node);
    for (size_t at = 0; at < size; at += 64) __builtin_prefetch(start + at);
}

Closest ClosestPoints::search(Vector at, size_t hint, double enough, size_t& visits) const {
    Vector scaled = (at - centre_) * scale_;
    Point point{{splat(static_cast<float>(scaled.x)), splat(static_cast<float>(scaled.y)),
                 splat(static_cast<float>(scaled.z))}};
    float reach = std::abs(point.at[0][0]) + std::abs(point.at[1][0]) + std::abs(point.at[2][0]);
    Contest contest(*this, at, 1.2e-6f * (1.0f + reach));
    int32_t first = ~static_cast<int32_t>(block_of_face_[hint]);
    contest.enter(blocks_[block_of_face_[hint]], point);
    double enough_scaled = enough * scale_ * scale_;

    struct Pending {
        int32_t child;
        float squared;
    };
    Pending pending[STACK_SIZE];
    size_t height = 0;
    int32_t child = 0;
    while (static_cast<double>(contest.limit) > enough_scaled) {
        if (child >= 0) {
            const Node& node = nodes_[static_cast<size_t>(child)];
            visits++;
            F32x4 squared = squared_distances(node, point);
            int near =
                ~signs(squared > splat(contest.limit)) & ~signs(load<I32x4>(node.children) == splat32(ABSENT)) & 15;
            int32_t nearest = ABSENT;
            float least_squared = 0.0f;
            for (; near != 0; near &= near - 1) {
                auto lane = static_cast<size_t>(__builtin_ctz(static_cast<unsigned>(near)));
                Pending found{node.children[lane], squared[lane]};
                if (found.child == first) continue;
                prefetch(found.child);
                if (node.beams[lane] >= 0) [[unlikely]] {
                    double apart = beams_[static_cast<size_t>(node.beams[lane])].squared_distance(at);
                    if (apart * scale_ * scale_ > static_cast<double>(contest.limit)) continue;
                }
                if (nearest == ABSENT) {
                    nearest = found.child, least_squared = found.squared;
                    continue;
                }
                if (found.squared < least_squared) {
                    std::swap(found.child, nearest);
                    std::swap(found.squared, least_squared);
                }
                pending[height++] = found;
            }
            if (nearest != ABSENT) {
                child = nearest;
                continue;
            }
        } else {
            contest.enter(blocks_[static_cast<size_t>(~child)], point);
        }
        bool found = false;
        while (!found && height > 0) found = !(pending[--height].squared > contest.limit);
        if (!found) break;
        child = pending[height].child;
    }
    if (enough > 0.0 && static_cast<double>(contest.limit) <= enough_scaled) return {0.0, {}};
    contest.measure();
    return contest.best;
}

Closest ClosestPoints::closest(Vector point, size_t hint, double enough) const {
    size_t visits = 0;
    return search(point, hint, enough, visits);
}

void ClosestPoints::closest(Span<const Vector> points, Span<Foot> feet) const {
    size_t hint = order_[0];
    for (size_t i = 0; i < points.size(); i++) {
        if (feet[i].face >= 0) hint = static_cast<size_t>(feet[i].face);
        Closest found = closest(points[i], hint);
        feet[i] = found.foot;
        hint = static_cast<size_t>(found.foot.face);
    }
}

double ClosestPoints::visits_per_search(Span<const Vector> points) const {
    size_t visits = 0, probes = points.size() < PROBES ? points.size() : PROBES;
    for (size_t i = 0; i < probes; i++) search(points[i * points.size() / probes], order_[0], 0.0, visits);
    return probes == 0 ? 0.0 : static_cast<double>(visits) / static_cast<double>(probes);
}

// Which of the points to look at: every one, or so many fewer that the search ends in reasonable time.
size_t ClosestPoints::stride(Span<const Vector> points) const {
    auto count = static_cast<double>(points.size());
    double allowed = ORDINARY * count > VISITS_ALLOWED ? ORDINARY * count : VISITS_ALLOWED;
    return 1 + static_cast<size_t>(visits_per_search(points) * count / allowed);
}

// The first place from `place` on whose key is not below `key`, or the last one: keys come in ascending order, if both
// surfaces have the same curve.
size_t ClosestPoints::follow(size_t place, uint64_t key) const {
    size_t size = keys_.size(), step = 1;
    if (place > 0 && keys_[place - 1] >= key) place = 0;
    while (place + step < size && keys_[place + step - 1] < key) place += step, step *= 2;
    const uint64_t* keys = keys_.begin();
    const uint64_t* end = keys + std::min(place + step, size - 1);
    return static_cast<size_t>(std::lower_bound(keys + place, end, key) - keys);
}

Spread ClosestPoints::spread(const CurvePoints& points) const {
    Spread spread;
    size_t place = 0, done = 0, step = stride(points.at.span());
    for (size_t i = 0; i < points.at.size(); i += step, done++) {
        place = follow(place, points.keys[i]);
        Closest found = closest(points.at[i], order_[place]);
        spread.mean += found.squared;
        if (found.squared > spread.largest) spread.largest = found.squared;
    }
    if (done > 0) spread.mean /= static_cast<double>(done);
    return spread;
}

double ClosestPoints::largest(const CurvePoints& points, double floor) const {
    size_t place = 0, step = stride(points.at.span());
    for (size_t i = 0; i < points.at.size(); i += step) {
        place = follow(place, points.keys[i]);
        Closest found = closest(points.at[i], order_[place], floor);
        if (found.squared > floor) floor = found.squared;
    }
    return floor;
}

void ClosestPoints::sampled(size_t count, uint64_t seed, CurvePoints& points, Budget& budget) const {
    Array<Foot> feet(budget);
    feet.resize(count);
    sample(seed, feet.span(), budget);
    points.at.clear();
    points.keys.clear();
    size_t place = 0;
    for (const Foot& foot : feet) {
        while (order_[place] != static_cast<uint32_t>(foot.face)) place++;
        points.at.push(foot.on(surface_));
        points.keys.push(keys_[place]);
    }
}

void ClosestPoints::used_vertices(size_t limit, CurvePoints& points, Budget& budget) const {
    Array<UsedVertex> used(budget);
    meshtide::used_vertices(surface_, order_.span(), limit, used, budget);
    points.at.clear();
    points.keys.clear();
    for (const UsedVertex& one : used) {
        points.at.push(surface_.vertices[static_cast<size_t>(one.vertex)]);
        points.keys.push(keys_[one.place]);
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
