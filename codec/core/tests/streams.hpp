// Random meshes, and streams of them, for tests: of any shape, with any faces, cut into packets at random.
#pragma once

#include "check.hpp"
#include "codec/compact_decoder.hpp"

#include <algorithm>
#include <array>

namespace meshtide::testing {

struct RandomMesh {
    int bits = 4;
    std::vector<int32_t> positions, faces; // as an encoder takes them
    Span<const int32_t> position_span() const { return {positions.data(), positions.size()}; }
    Span<const int32_t> face_span() const { return {faces.data(), faces.size()}; }
    size_t vertex_count() const { return positions.size() / 3; }
};

inline uint64_t morton_code(const int32_t* position, int bits) {
    uint64_t code = 0;
    for (int b = bits - 1; b >= 0; b--)
        for (int k = 0; k < 3; k++) code = code << 1 | static_cast<uint64_t>(position[k] >> b & 1);
    return code;
}

// Points in the cube, in two planes, or over a grid; faces between any vertices or between near ones, in one
// orientation or in both. At most `most` vertices.
inline RandomMesh random_mesh(Numbers& numbers, uint32_t most) {
    typedef std::array<int32_t, 3> Triple;
    RandomMesh mesh;
    mesh.bits = numbers.between(LEAST_BITS, MOST_BITS);
    uint32_t wanted = 1 + numbers.below(most), shape = numbers.below(4);
    uint32_t range = std::min(1u << mesh.bits, 2u << numbers.below(static_cast<uint32_t>(mesh.bits)));
    uint32_t side = 2;
    while (side * side < wanted) side++;
    std::vector<std::pair<uint64_t, Triple>> points;
    for (uint32_t i = 0; i < wanted; i++) {
        auto any = [&] { return static_cast<int32_t>(numbers.below(range)); };
        auto on_grid = [&](uint32_t place) { return static_cast<int32_t>(place % side * (range - 1) / side); };
        Triple point = {any(), any(), any()};
        if (shape == 1) point[2] &= 1;
        if (shape >= 2) point = {on_grid(i), on_grid(i / side), shape == 2 ? point[2] & 1 : point[2]};
        points.emplace_back(morton_code(point.data(), mesh.bits), point);
    }
    std::sort(points.begin(), points.end());
    points.erase(std::unique(points.begin(), points.end()), points.end());
    for (const auto& point : points)
        mesh.positions.insert(mesh.positions.end(), point.second.begin(), point.second.end());

    auto n = static_cast<uint32_t>(points.size());
    std::vector<Triple> faces;
    uint32_t kind = numbers.below(3);
    for (uint32_t i = n < 3 ? 0 : numbers.below(3 * n); i > 0; i--) {
        uint32_t a = numbers.below(n), b = numbers.below(n), c = numbers.below(n);
        if (kind > 0) {
            b = std::min(n - 1, a + 1 + numbers.below(4));
            c = std::min(n - 1, b + 1 + numbers.below(9));
        }
        if (kind == 2 && numbers.below(2) != 0) std::swap(b, c);
        if (a == b || b == c || c == a) continue;
        Triple face = {static_cast<int32_t>(a), static_cast<int32_t>(b), static_cast<int32_t>(c)};
        std::rotate(face.begin(), std::min_element(face.begin(), face.end()), face.end());
        faces.push_back(face);
    }
    std::sort(faces.begin(), faces.end());
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    for (const Triple& face : faces) mesh.faces.insert(mesh.faces.end(), face.begin(), face.end());
    return mesh;
}

// States as if there had been no training.
inline const Trained& untrained() {
    static Budget budget(UINT64_MAX);
    static const Trained trained = [] {
        Trained made;
        choose(Effort::standard);
        made.standard = std::make_unique<TrainedLayers<COMPILED<Effort::standard>>>(budget);
        choose(Effort::high);
        made.high = std::make_unique<TrainedLayers<COMPILED<Effort::high>>>(budget);
        made.classic = std::make_unique<ClassicFacesModel>(budget);
        return made;
    }();
    return trained;
}

// A compact stream: its header, and the payloads of its packets.
struct RandomStream {
    explicit RandomStream(Budget& budget) : header(budget) {}
    Header header;
    std::vector<std::vector<uint8_t>> payloads;
    Span<const uint8_t> payload(size_t i) const { return {payloads[i].data(), payloads[i].size()}; }
    PacketPlace place(size_t i) const {
        const PacketEntry& entry = header.packets[i];
        return {static_cast<PacketKind>(entry.kind), entry.level, entry.slice};
    }
};

inline void add_packet(RandomStream& stream, PacketPlace place, const Array<uint8_t>& payload) {
    stream.payloads.emplace_back(payload.begin(), payload.end());
    PacketEntry entry{};
    entry.kind = static_cast<uint8_t>(place.kind);
    entry.level = static_cast<uint8_t>(place.level);
    entry.slice = static_cast<uint16_t>(place.slice);
    entry.length = payload.size();
    stream.header.packets.push(entry);
}

// Of any effort, base depth, mirror plane, slices and depths of Diffs; all Diffs are there.
inline void encode_stream(const RandomMesh& mesh, Numbers& numbers, RandomStream& stream, Budget& budget) {
    Header& header = stream.header;
    CompactOptions& options = header.compact;
    header.bits = mesh.bits;
    options.effort = static_cast<int32_t>(numbers.below(2));
    if (numbers.below(2) != 0) {
        options.mirror_axis = numbers.between(0, 2);
        options.mirror_sum = static_cast<int32_t>(numbers.below(2u << mesh.bits));
    }
    options.slices.push(0);
    for (uint32_t i = numbers.below(3); i > 0; i--) {
        size_t vertex = numbers.below(static_cast<uint32_t>(mesh.vertex_count()));
        uint64_t code = morton_code(mesh.positions.data() + 3 * vertex, mesh.bits);
        if (code > options.slices.back()) options.slices.push(code);
    }
    Octree octree(mesh.position_span(), mesh.face_span(), mesh.bits, budget);
    auto leaf_depth = static_cast<uint32_t>(octree.depths.size() - 1);
    options.base_depth = static_cast<int32_t>(numbers.below(leaf_depth + 1));
    auto layers = make_encoder_layers(options.effort == 0 ? Effort::standard : Effort::high, budget, octree,
                                      {options.mirror_axis, options.mirror_sum}, options.slices.span(), untrained());
    Array<uint8_t> payload(budget);
    for (int depth = options.base_depth; depth <= mesh.bits; depth++) {
        auto level = static_cast<uint32_t>(mesh.bits - depth);
        if (depth == options.base_depth) {
            layers->encode_base(depth, payload);
            add_packet(stream, {PacketKind::base, level, 0}, payload);
        } else if (!layers->chain().ends()) {
            layers->encode_next_level(payload);
            add_packet(stream, {PacketKind::map_conn, level, 0}, payload);
        }
        if (depth == mesh.bits || numbers.below(2) != 0) {
            options.diff_depths |= 1u << depth;
            for (size_t slice = 0; slice < options.slices.size(); slice++) {
                layers->add_planes(slice, depth);
                layers->take_planes(slice, payload);
                add_packet(stream, {PacketKind::diff, level, static_cast<uint32_t>(slice)}, payload);
            }
        }
        options.strengths[depth - options.base_depth] = static_cast<uint8_t>(numbers.below(STRENGTH_COUNT));
        const Octree::Depth& cells = octree.at(depth);
        header.states.push(
            {cells.cell_count(), cells.faces.size() / 3, {}, static_cast<uint32_t>(header.packets.size()), level});
    }
}

// 0, 1, ... in any order.
inline std::vector<size_t> shuffled(size_t count, Numbers& numbers) {
    std::vector<size_t> order(count);
    for (size_t i = 0; i < count; i++) order[i] = i;
    for (size_t i = count; i > 1; i--) std::swap(order[i - 1], order[numbers.below(static_cast<uint32_t>(i))]);
    return order;
}

// Cuts a payload that is not empty, or turns a few of its bits.
inline void damage(std::vector<uint8_t>& payload, Numbers& numbers) {
    auto length = static_cast<uint32_t>(payload.size());
    if (numbers.below(3) == 0)
        payload.resize(numbers.below(length));
    else
        for (uint32_t i = 1 + numbers.below(4); i > 0; i--)
            payload[numbers.below(length)] ^= static_cast<uint8_t>(1u << numbers.below(8));
}

// Every level that is there.
inline void show_all(StreamDecoder& decoder, Shown& shown) {
    for (uint32_t level = 0; level <= MOST_LEVEL; level++)
        if ((decoder.available() >> level & 1) != 0) decoder.show(level, shown);
}

} // namespace meshtide::testing
