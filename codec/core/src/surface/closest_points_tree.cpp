// Building of the tree: the curve, a binary tree over it with boxes and beams, and its merging into nodes of four.
#include "surface/closest_points_tree.hpp"

#include "surface/closest_points.hpp"
#include "surface/sorting.hpp"

#include <bit>
#include <limits>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr int AXIS_BITS = 15; // of the curve; triangles in the same cell are halved by their numbers
constexpr size_t BLOCK_SIZE = 4;

struct Box {
    F32x4 low = splat(INFINITY), high = splat(-INFINITY);

    void add(F32x4 p) {
        low = least(low, p);
        high = greatest(high, p);
    }
    void add(const Box& box) {
        low = least(low, box.low);
        high = greatest(high, box.high);
    }
};

// A node of the binary tree; its first child follows it.
struct Half {
    uint32_t first = 0, end = 0; // in the order
    int32_t second_child = -1;   // none: a leaf
    int32_t beam = -1;
    int32_t block = -1; // of a leaf; numbered along the curve, so that neighbours are near in memory
    Box box;
    uint32_t longest = 0;
    float longest_squared = -1;
    bool thin = false;
};

// The faces along the curve, with their keys; vertices in floats.
void sort_faces(Span<const int32_t> faces, Span<const F32x4> vertices, Array<Keyed>& keys, Budget& budget) {
    constexpr auto LAST = static_cast<float>((1 << AXIS_BITS) - 1);
    keys.resize(faces.size() / 3);
    for (size_t f = 0; f < keys.size(); f++) {
        const int32_t* corners = faces.block(3 * f, 3);
        F32x4 sum = vertices[static_cast<size_t>(corners[0])] + vertices[static_cast<size_t>(corners[1])] +
                    vertices[static_cast<size_t>(corners[2])];
        F32x4 cell = (sum * splat(1.0f / 3.0f) + splat(0.5f)) * splat(LAST);
        I32x4 at = truncate(least(greatest(cell, splat(0.0f)), splat(LAST)));
        auto coordinate = [&](size_t k) { return static_cast<uint32_t>(at[k]); };
        keys[f] = {morton_code(coordinate(0), coordinate(1), coordinate(2)), static_cast<uint32_t>(f)};
    }
    sort_keyed(keys, 3 * AXIS_BITS, budget);
}

// Where the uppermost bit changes in which the keys of a range differ; the middle if they are all the same.
size_t split(const Array<Keyed>& keys, size_t first, size_t end) {
    uint64_t difference = keys[first].key ^ keys[end - 1].key;
    if (difference == 0) return first + (end - first) / 2;
    uint64_t bit = std::bit_floor(difference);
    size_t low = first, high = end - 1;
    while (low < high) {
        size_t half = low + (high - low) / 2;
        if ((keys[half].key & bit) != 0)
            high = half;
        else
            low = half + 1;
    }
    return low;
}

// The binary tree, parents first.
void halve(const Array<Keyed>& keys, Array<Half>& halves, Budget& budget) {
    struct Range {
        size_t first, end;
        int32_t parent; // that it is the second child of
    };
    Array<Range> ranges(budget);
    ranges.push({0, keys.size(), -1});
    while (!ranges.empty()) {
        Range range = ranges.pop();
        auto number = static_cast<int32_t>(halves.size());
        if (range.parent >= 0) halves[static_cast<size_t>(range.parent)].second_child = number;
        Half made;
        made.first = static_cast<uint32_t>(range.first);
        made.end = static_cast<uint32_t>(range.end);
        halves.push(made);
        if (range.end - range.first <= BLOCK_SIZE) continue;
        size_t half = split(keys, range.first, range.end);
        ranges.push({half, range.end, number});
        ranges.push({range.first, half, -1});
    }
}

} // namespace

struct ClosestPoints::Builder {
    ClosestPoints& tree;
    Array<Half> halves;

    Array<F32x4> vertices; // in floats, about the middle

    F32x4 at(size_t face, size_t k) const { return vertices[static_cast<size_t>(tree.surface_.corner(face, k))]; }

    // To the middle of the surface, and a power of two that takes it to floats of at most 0.5.
    void scale() {
        const Surface& surface = tree.surface_;
        Vector low{INFINITY, INFINITY, INFINITY}, high{-INFINITY, -INFINITY, -INFINITY};
        for (int32_t v : surface.faces) {
            if (v < 0 || static_cast<size_t>(v) >= surface.vertices.size())
                fail(Fault::argument, "a triangle names a vertex that is not there");
            Vector p = surface.vertices[static_cast<size_t>(v)];
            low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
            high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
        }
        tree.centre_ = low * 0.5 + high * 0.5;
        Vector sides = high - low;
        double side = std::max(sides.x, std::max(sides.y, sides.z));
        if (side > 0.0 && side < 1e300) {
            int exponent = 0;
            std::frexp(side, &exponent);
            tree.scale_ = std::ldexp(1.0, std::min(-exponent, 1000));
        }
        vertices.resize(surface.vertices.size());
        for (size_t v = 0; v < vertices.size(); v++) {
            Vector p = (surface.vertices[v] - tree.centre_) * tree.scale_;
            vertices[v] = F32x4{static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z), 0.0f};
        }
    }

    // Boxes and beams, children first.
    void enclose() {
        for (size_t n = halves.size(); n-- > 0;) {
            Half& half = halves[n];
            if (half.second_child < 0) {
                for (size_t i = half.first; i < half.end; i++) enclose_face(half, tree.order_[i]);
            } else {
                const Half &one = halves[n + 1], &other = halves[static_cast<size_t>(half.second_child)];
                half.box = one.box;
                half.box.add(other.box);
                const Half& longer = other.longest_squared > one.longest_squared ? other : one;
                half.longest = longer.longest;
                half.longest_squared = longer.longest_squared;
                if (!one.thin && !other.thin) continue;
            }
            F32x4 sides = half.box.high - half.box.low;
            if (dot3(sides, sides) > 1.01f * static_cast<float>(SPANNED * SPANNED) * half.longest_squared) continue;
            double unit = 1.0 / tree.scale_;
            auto side = [&](size_t k) { return static_cast<double>(sides[k]) * unit; };
            Beam beam;
            Thinness thinness =
                find_beam(tree.surface_,
                          {tree.order_.span(), half.first, half.end, {side(0), side(1), side(2)}, half.longest}, beam);
            half.thin = thinness != Thinness::wide;
            if (thinness == Thinness::worth_a_beam) {
                half.beam = static_cast<int32_t>(tree.beams_.size());
                tree.beams_.push(beam);
            }
        }
    }
    void enclose_face(Half& half, uint32_t face) const {
        F32x4 corners[3] = {at(face, 0), at(face, 1), at(face, 2)};
        for (uint32_t k = 0; k < 3; k++) {
            half.box.add(corners[k]);
            F32x4 edge = corners[k == 2 ? 0 : k + 1] - corners[k];
            float squared = dot3(edge, edge);
            if (squared <= half.longest_squared) continue;
            half.longest_squared = squared;
            half.longest = 3 * face + k;
        }
    }

    // Opens the largest of a node's children until it has four, or all are leaves.
    size_t open(size_t root, size_t (&children)[4]) const {
        children[0] = root;
        size_t count = 1;
        while (count < 4) {
            size_t best = count;
            for (size_t i = 0; i < count; i++) {
                const Half& half = halves[children[i]];
                if (half.second_child < 0) continue;
                if (best == count || half.end - half.first > size_of(children[best])) best = i;
            }
            if (best == count) break;
            size_t opened = children[best];
            children[best] = opened + 1;
            children[count++] = static_cast<size_t>(halves[opened].second_child);
        }
        return count;
    }
    size_t size_of(size_t half) const { return halves[half].end - halves[half].first; }

    void merge(Budget& budget) {
        for (Half& half : halves)
            if (half.second_child < 0) add_block(half);
        struct Task {
            size_t half, node, lane;
        };
        Array<Task> tasks(budget);
        tasks.push({0, SIZE_MAX, 0});
        while (!tasks.empty()) {
            Task task = tasks.pop();
            size_t number = tree.nodes_.size();
            if (task.node != SIZE_MAX) tree.nodes_[task.node].children[task.lane] = static_cast<int32_t>(number);
            size_t children[4];
            size_t count = open(task.half, children);
            Node node;
            for (size_t lane = count; lane < 4; lane++) {
                for (size_t k = 0; k < 3; k++) node.low[k][lane] = node.high[k][lane] = FAR;
                node.children[lane] = ABSENT;
                node.beams[lane] = -1;
            }
            for (size_t lane = 0; lane < count; lane++) {
                const Half& half = halves[children[lane]];
                enclose(node, lane, half.box);
                node.beams[lane] = half.beam;
                if (half.second_child < 0) {
                    node.children[lane] = ~half.block;
                } else {
                    tasks.push({children[lane], number, lane});
                }
            }
            tree.nodes_.push(node);
        }
    }

    static void enclose(Node& node, size_t lane, const Box& box) {
        for (size_t k = 0; k < 3; k++) {
            node.low[k][lane] = box.low[k] - COORDINATE_ERROR;
            node.high[k][lane] = box.high[k] + COORDINATE_ERROR;
        }
    }

    void add_block(Half& half) {
        Block block;
        half.block = static_cast<int32_t>(tree.blocks_.size());
        for (size_t lane = 0; lane < BLOCK_SIZE; lane++) {
            size_t face = tree.order_[std::min<size_t>(half.first + lane, half.end - 1)];
            F32x4 first = at(face, 0), second = at(face, 1) - first, third = at(face, 2) - first;
            for (size_t k = 0; k < 3; k++) {
                block.first[k][lane] = first[k];
                block.second[k][lane] = second[k];
                block.third[k][lane] = third[k];
            }
            block.faces[lane] = static_cast<int32_t>(face);
            tree.block_of_face_[face] = static_cast<uint32_t>(tree.blocks_.size());
        }
        tree.blocks_.push(block);
    }
};

ClosestPoints::ClosestPoints(Surface surface, Budget& budget)
    : surface_(surface), order_(budget), areas_(budget), nodes_(budget), blocks_(budget), block_of_face_(budget),
      beams_(budget) {
    size_t faces = surface.face_count();
    if (faces == 0 || faces > INT32_MAX / 4) fail(Fault::argument, "a surface must have triangles, not too many");
    Builder builder{*this, Array<Half>(budget), Array<F32x4>(budget)};
    builder.scale();
    {
        Array<Keyed> keys(budget);
        sort_faces(surface.faces, builder.vertices.span(), keys, budget);
        order_.resize(faces);
        block_of_face_.resize(faces);
        for (size_t i = 0; i < faces; i++) order_[i] = keys[i].place;
        builder.halves.reserve(faces);
        halve(keys, builder.halves, budget);
    }
    sum_areas(surface_, order_.span(), areas_);
    builder.enclose();
    nodes_.reserve(builder.halves.size() / 3 + 1);
    blocks_.reserve(builder.halves.size() / 2 + 1);
    builder.merge(budget);
}

} // namespace meshtide::inline MESHTIDE_ISA
