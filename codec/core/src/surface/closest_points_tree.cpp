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
    Vector low{INFINITY, INFINITY, INFINITY}, high{-INFINITY, -INFINITY, -INFINITY};

    void add(Vector p) {
        low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
        high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    void add(const Box& box) {
        add(box.low);
        add(box.high);
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
    double longest_squared = 0;
    bool thin = false;
};

Vector middle(const Surface& surface, size_t face) {
    return (surface.at(face, 0) + surface.at(face, 1) + surface.at(face, 2)) * (1.0 / 3.0);
}

// The faces along the curve, with their keys.
void sort_faces(const Surface& surface, Array<Keyed>& keys, Budget& budget) {
    Box box;
    for (size_t f = 0; f < surface.face_count(); f++) box.add(middle(surface, f));
    Vector sides = box.high - box.low;
    double side = std::max(sides.x, std::max(sides.y, sides.z));
    double last = static_cast<double>((1 << AXIS_BITS) - 1);
    double scale = side > 0.0 ? last / side : 0.0;
    auto cell = [&](double offset) { return static_cast<uint32_t>(std::min(offset * scale, last)); };
    keys.resize(surface.face_count());
    for (size_t f = 0; f < surface.face_count(); f++) {
        Vector offset = middle(surface, f) - box.low;
        keys[f] = {morton_code(cell(offset.x), cell(offset.y), cell(offset.z)), static_cast<uint32_t>(f)};
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

    // Boxes and beams, children first.
    void enclose() {
        const Surface& surface = tree.surface_;
        for (size_t n = halves.size(); n-- > 0;) {
            Half& half = halves[n];
            if (half.second_child < 0) {
                half.longest_squared = -1.0;
                for (size_t i = half.first; i < half.end; i++) {
                    size_t face = tree.order_[i];
                    for (size_t k = 0; k < 3; k++) {
                        half.box.add(surface.at(face, k));
                        double squared = squared_edge(surface, face, k);
                        if (squared <= half.longest_squared) continue;
                        half.longest_squared = squared;
                        half.longest = static_cast<uint32_t>(3 * face + k);
                    }
                }
            } else {
                const Half &one = halves[n + 1], &other = halves[static_cast<size_t>(half.second_child)];
                half.box = one.box;
                half.box.add(other.box);
                const Half& longer = other.longest_squared > one.longest_squared ? other : one;
                half.longest = longer.longest;
                half.longest_squared = longer.longest_squared;
                if (!one.thin && !other.thin) continue;
            }
            BeamRange range{tree.order_.span(), half.first,          half.end, half.box.low, half.box.high,
                            half.longest,       half.longest_squared};
            Beam beam;
            Thinness thinness = find_beam(surface, range, beam);
            half.thin = thinness != Thinness::wide;
            if (thinness == Thinness::worth_a_beam) {
                half.beam = static_cast<int32_t>(tree.beams_.size());
                tree.beams_.push(beam);
            }
        }
    }

    // To the middle of the surface, and a power of two that takes it to floats of at most 0.5.
    void set_scale() {
        const Box& box = halves[0].box;
        tree.centre_ = box.low * 0.5 + box.high * 0.5;
        Vector sides = box.high - box.low;
        double side = std::max(sides.x, std::max(sides.y, sides.z));
        if (side > 0.0 && side < 1e300) {
            int exponent = 0;
            std::frexp(side, &exponent);
            tree.scale_ = std::ldexp(1.0, std::min(-exponent, 1000));
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

    void enclose(Node& node, size_t lane, const Box& box) const {
        Vector low = (box.low - tree.centre_) * tree.scale_, high = (box.high - tree.centre_) * tree.scale_;
        auto down = [](double value) { return static_cast<float>(value) - COORDINATE_ERROR; };
        auto up = [](double value) { return static_cast<float>(value) + COORDINATE_ERROR; };
        node.low[0][lane] = down(low.x), node.low[1][lane] = down(low.y), node.low[2][lane] = down(low.z);
        node.high[0][lane] = up(high.x), node.high[1][lane] = up(high.y), node.high[2][lane] = up(high.z);
    }

    void add_block(Half& half) {
        Block block;
        half.block = static_cast<int32_t>(tree.blocks_.size());
        for (size_t lane = 0; lane < BLOCK_SIZE; lane++) {
            size_t face = tree.order_[std::min<size_t>(half.first + lane, half.end - 1)];
            Vector corners[3];
            for (size_t k = 0; k < 3; k++) corners[k] = (tree.surface_.at(face, k) - tree.centre_) * tree.scale_;
            Vector second = corners[1] - corners[0], third = corners[2] - corners[0];
            auto put = [&](float(&to)[3][4], Vector v) {
                to[0][lane] = static_cast<float>(v.x);
                to[1][lane] = static_cast<float>(v.y);
                to[2][lane] = static_cast<float>(v.z);
            };
            put(block.first, corners[0]);
            put(block.second, second);
            put(block.third, third);
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
    for (int32_t v : surface.faces)
        if (v < 0 || static_cast<size_t>(v) >= surface.vertices.size())
            fail(Fault::argument, "a triangle names a vertex that is not there");
    Builder builder{*this, Array<Half>(budget)};
    {
        Array<Keyed> keys(budget);
        sort_faces(surface, keys, budget);
        order_.resize(faces);
        block_of_face_.resize(faces);
        for (size_t i = 0; i < faces; i++) order_[i] = keys[i].place;
        builder.halves.reserve(faces);
        halve(keys, builder.halves, budget);
    }
    sum_areas(surface_, order_.span(), areas_);
    builder.enclose();
    builder.set_scale();
    nodes_.reserve(builder.halves.size() / 3 + 1);
    blocks_.reserve(builder.halves.size() / 2 + 1);
    builder.merge(budget);
}

} // namespace meshtide::inline MESHTIDE_ISA
