// Building of the tree: the curve, nodes of four over it, then boxes, beams and blocks from the blocks up.
#include "surface/closest_points_tree.hpp"

#include "mesh/morton.hpp"
#include "surface/closest_points.hpp"
#include "surface/sorting.hpp"

#include <bit>
#include <limits>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr int AXIS_BITS = 15; // of the curve; triangles in the same cell are halved by their numbers
constexpr size_t BLOCK_SIZE = 4;
constexpr double MOST = 0.75; // of coordinates in floats

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

// Faces that follow each other along the curve: those of a block, or of all blocks below a node.
struct Part {
    size_t first, end; // in the order
    Box box;
    struct {
        float squared = -1, height = 0; // that of its face, squared as well
        uint32_t edge = 0;              // 3 face + corner where it begins
    } longest;
    bool thin; // a beam holds it: of a node, one of its children
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

// A place near to `half` with whole blocks between `first` and it, and something behind it.
size_t whole_blocks(size_t first, size_t half, size_t end) {
    size_t blocks = (half - first + BLOCK_SIZE / 2) / BLOCK_SIZE, most = (end - first - 1) / BLOCK_SIZE;
    return first + BLOCK_SIZE * std::clamp<size_t>(blocks, 1, most);
}

// Four points as their coordinates.
void turn(const F32x4 (&points)[4], F32x4 (&coordinates)[3]) {
    F32x4 low = __builtin_shufflevector(points[0], points[1], 0, 4, 1, 5);
    F32x4 other_low = __builtin_shufflevector(points[2], points[3], 0, 4, 1, 5);
    F32x4 high = __builtin_shufflevector(points[0], points[1], 2, 6, 3, 7);
    F32x4 other_high = __builtin_shufflevector(points[2], points[3], 2, 6, 3, 7);
    coordinates[0] = __builtin_shufflevector(low, other_low, 0, 1, 4, 5);
    coordinates[1] = __builtin_shufflevector(low, other_low, 2, 3, 6, 7);
    coordinates[2] = __builtin_shufflevector(high, other_high, 0, 1, 4, 5);
}

// About where the uppermost bit changes in which the keys of a range differ, or in the middle if they are all the same;
// whole blocks lie before it.
size_t split(const Array<Keyed>& keys, size_t first, size_t end) {
    uint64_t difference = keys[first].key ^ keys[end - 1].key;
    if (difference == 0) return whole_blocks(first, first + (end - first) / 2, end);
    uint64_t bit = std::bit_floor(difference);
    size_t low = first, high = end - 1;
    while (low < high) {
        size_t half = low + (high - low) / 2;
        if ((keys[half].key & bit) != 0)
            high = half;
        else
            low = half + 1;
    }
    return whole_blocks(first, low, end);
}

} // namespace

struct ClosestPoints::Builder {
    ClosestPoints& tree;
    Array<Keyed> keys;
    Array<F32x4> vertices;  // in floats, about the middle
    Array<Part> node_parts; // of each node

    F32x4 at(size_t face, size_t k) const { return vertices[static_cast<size_t>(tree.surface_.corner(face, k))]; }

    // To the middle of the surface, and a power of two that takes it to floats of at most 0.5; or to where another tree
    // has its surface, if that takes it to floats of at most MOST.
    void scale(const ClosestPoints* like) {
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
        if (like != nullptr) {
            Vector lowest = low - like->centre_, highest = high - like->centre_;
            double far = std::max({-lowest.x, -lowest.y, -lowest.z, highest.x, highest.y, highest.z});
            if (far * like->scale_ <= MOST) tree.centre_ = like->centre_, tree.scale_ = like->scale_;
        }
        vertices.resize(surface.vertices.size());
        for (size_t v = 0; v < vertices.size(); v++) {
            Vector p = (surface.vertices[v] - tree.centre_) * tree.scale_;
            vertices[v] = F32x4{static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z), 0.0f};
        }
    }

    // The nodes, parents first: each the largest of its parts halved until it has four, or all are blocks.
    void divide(Budget& budget) {
        struct Task {
            size_t first, end, node, lane;
        };
        Array<Task> tasks(budget);
        tasks.push({0, keys.size(), SIZE_MAX, 0});
        while (!tasks.empty()) {
            Task task = tasks.pop();
            size_t number = tree.nodes_.size();
            if (task.node != SIZE_MAX) tree.nodes_[task.node].children[task.lane] = static_cast<int32_t>(number);
            size_t first[4] = {task.first}, end[4] = {task.end}, count = 1;
            while (count < 4) {
                size_t largest = 0;
                for (size_t i = 1; i < count; i++)
                    if (end[i] - first[i] > end[largest] - first[largest]) largest = i;
                if (end[largest] - first[largest] <= BLOCK_SIZE) break;
                first[count] = split(keys, first[largest], end[largest]), end[count] = end[largest];
                end[largest] = first[count++];
            }
            Node node;
            for (size_t lane = 0; lane < 4; lane++) {
                node.beams[lane] = -1;
                node.children[lane] = ABSENT;
                if (lane >= count) continue;
                if (end[lane] - first[lane] <= BLOCK_SIZE)
                    node.children[lane] = ~static_cast<int32_t>(first[lane] / BLOCK_SIZE);
                else
                    tasks.push({first[lane], end[lane], number, lane});
            }
            tree.nodes_.push(node);
            node_parts.push({task.first, task.end, {}, {}, false});
        }
    }

    // Boxes, beams and blocks, children first.
    void enclose() {
        for (size_t n = tree.nodes_.size(); n-- > 0;) {
            Node& node = tree.nodes_[n];
            Part& all = node_parts[n];
            for (size_t lane = 0; lane < 4; lane++) {
                int32_t child = node.children[lane];
                if (child == ABSENT) {
                    for (size_t k = 0; k < 3; k++) node.low[k][lane] = node.high[k][lane] = FAR;
                    continue;
                }
                Part part =
                    child < 0 ? make_block(static_cast<size_t>(~child)) : node_parts[static_cast<size_t>(child)];
                for (size_t k = 0; k < 3; k++) {
                    node.low[k][lane] = part.box.low[k] - COORDINATE_ERROR;
                    node.high[k][lane] = part.box.high[k] + COORDINATE_ERROR;
                }
                if (child < 0 || part.thin) node.beams[lane] = find_beam_of(part);
                all.box.add(part.box);
                if (part.longest.squared > all.longest.squared) all.longest = part.longest;
                all.thin = all.thin || part.thin;
            }
        }
    }

    Part make_block(size_t number) {
        Part part{BLOCK_SIZE * number, std::min(BLOCK_SIZE * (number + 1), tree.order_.size()), {}, {}, false};
        Block& block = tree.blocks_[number];
        F32x4 first[4], second[4], third[4];
        for (size_t lane = 0; lane < BLOCK_SIZE; lane++) {
            size_t face = tree.order_[std::min(part.first + lane, part.end - 1)];
            const int32_t* corners = tree.surface_.faces.block(3 * face, 3);
            F32x4 a = vertices[static_cast<size_t>(corners[0])], b = vertices[static_cast<size_t>(corners[1])];
            F32x4 c = vertices[static_cast<size_t>(corners[2])];
            part.box.low = least(part.box.low, least(a, least(b, c)));
            part.box.high = greatest(part.box.high, greatest(a, greatest(b, c)));
            first[lane] = a, second[lane] = b - a, third[lane] = c - a;
            block.faces[lane] = static_cast<int32_t>(face);
            tree.block_of_face_[face] = static_cast<uint32_t>(number);
        }
        F32x4 a[3], b[3], c[3], along[3];
        turn(first, a), turn(second, b), turn(third, c);
        for (size_t k = 0; k < 3; k++) {
            store(block.first[k], a[k]), store(block.second[k], b[k]), store(block.third[k], c[k]);
            along[k] = c[k] - b[k];
        }
        F32x4 squares[3] = {dot(b, b), dot(along, along), dot(c, c)};
        for (size_t lane = 0; lane < BLOCK_SIZE; lane++) {
            for (uint32_t k = 0; k < 3; k++) {
                if (!(squares[k][lane] > part.longest.squared)) continue;
                part.longest = {squares[k][lane], 0, 3 * static_cast<uint32_t>(block.faces[lane]) + k};
            }
            if (part.longest.edge / 3 != static_cast<uint32_t>(block.faces[lane])) continue;
            F32x4 normal = cross3(second[lane], third[lane]);
            part.longest.height = dot3(normal, normal) / part.longest.squared;
        }
        return part;
    }

    // The number of a part's beam, or -1 if it gets none.
    int32_t find_beam_of(Part& part) const {
        part.thin = false;
        F32x4 sides = part.box.high - part.box.low;
        float diagonal = dot3(sides, sides), longest = part.longest.squared;
        if (diagonal > 1.01f * static_cast<float>(SPANNED * SPANNED) * longest) return -1;
        if (static_cast<float>(THIN * THIN) * part.longest.height > 1.01f * diagonal) return -1;
        double unit = 1.0 / tree.scale_;
        auto side = [&](size_t k) { return static_cast<double>(sides[k]) * unit; };
        Beam beam;
        Thinness thinness =
            find_beam(tree.surface_,
                      {tree.order_.span(), part.first, part.end, {side(0), side(1), side(2)}, part.longest.edge}, beam);
        part.thin = thinness != Thinness::wide;
        if (thinness != Thinness::worth_a_beam) return -1;
        tree.beams_.push(beam);
        return static_cast<int32_t>(tree.beams_.size() - 1);
    }
};

ClosestPoints::ClosestPoints(Surface surface, Budget& budget, const ClosestPoints* like)
    : surface_(surface), order_(budget), keys_(budget), nodes_(budget), blocks_(budget), block_of_face_(budget),
      beams_(budget) {
    size_t faces = surface.face_count();
    if (faces == 0 || faces > INT32_MAX / 4) fail(Fault::argument, "a surface must have triangles, not too many");
    Builder builder{*this, Array<Keyed>(budget), Array<F32x4>(budget), Array<Part>(budget)};
    builder.scale(like);
    sort_faces(surface.faces, builder.vertices.span(), builder.keys, budget);
    order_.resize(faces);
    keys_.resize(faces);
    for (size_t i = 0; i < faces; i++) order_[i] = builder.keys[i].place, keys_[i] = builder.keys[i].key;
    size_t blocks = (faces + BLOCK_SIZE - 1) / BLOCK_SIZE;
    nodes_.reserve(blocks / 2 + 1);
    builder.divide(budget);
    builder.keys.give_back();
    blocks_.resize(blocks);
    block_of_face_.resize(faces);
    builder.enclose();
    builder.vertices.give_back();
}

} // namespace meshtide::inline MESHTIDE_ISA
