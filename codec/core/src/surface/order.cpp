#include "surface/order.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr const char* DAMAGED = "an order that names what is not there";

struct OrderContexts {
    Context steps[SIGNED_CONTEXTS], key[SIGNED_CONTEXTS], rank[SIGNED_CONTEXTS];
    Context twin_behind[SIGNED_CONTEXTS], twin_before[SIGNED_CONTEXTS]; // of a corner behind, or before, the key
    Context other[SIGNED_CONTEXTS];
    Context vanished;
    Context place[3][2]; // of the key, by that of the face before
};

template <class Coder>
int64_t code_step(Coder& coder, Context (&contexts)[SIGNED_CONTEXTS], int64_t step) {
    return code_signed(coder, Span<Context>(contexts, SIGNED_CONTEXTS), static_cast<int32_t>(step));
}

// Lists of numbers, one for each of some others.
struct Groups {
    explicit Groups(Budget& budget) : starts(budget), members(budget) {}
    // The places of each value below `count`, ascending.
    template <class ValueAt>
    void fill(size_t size, size_t count, ValueAt value_at) {
        starts.assign(count + 1, 0);
        members.resize(size);
        for (size_t i = 0; i < size; i++) starts[value_at(i) + 1]++;
        for (size_t v = 0; v < count; v++) starts[v + 1] += starts[v];
        for (size_t i = 0; i < size; i++) members[starts[value_at(i)]++] = static_cast<uint32_t>(i);
        for (size_t v = count; v > 0; v--) starts[v] = starts[v - 1];
        starts[0] = 0;
    }
    Span<const uint32_t> of(size_t value) const {
        return members.span().part(starts[value], starts[value + 1] - starts[value]);
    }

    Array<uint32_t> starts, members;
};

size_t first_from(Span<const uint32_t> values, int64_t least) {
    const uint32_t* found =
        std::lower_bound(values.begin(), values.end(), least, [](uint32_t a, int64_t b) { return a < b; });
    return static_cast<size_t>(found - values.begin());
}

// Codes the faces of an order whose vertices are known.
class FaceCoder {
public:
    FaceCoder(InputOrder& order, const StreamMesh& mesh, bool by_row, Budget& budget)
        : order_(order), by_row_(by_row), faces_(budget), by_key_(budget), twins_(budget), expected_(budget) {
        const Array<uint32_t>& vertices = order.vertices;
        twins_.fill(vertices.size(), mesh.vertices, [&](size_t i) { return static_cast<size_t>(vertices[i]); });
        faces_.resize(mesh.faces.size());
        for (size_t t = 0; t + 2 < mesh.faces.size(); t += 3) {
            size_t key = by_row ? 0 : key_corner(mesh.faces.part(t, 3));
            for (size_t k = 0; k < 3; k++) faces_[t + k] = mesh.faces[t + (key + k) % 3];
        }
        if (by_row) return;
        by_key_.fill(faces_.size() / 3, mesh.vertices, [&](size_t t) { return static_cast<size_t>(faces_[3 * t]); });
        expected_.assign(mesh.vertices, 0);
    }

    // An encoder knows the row of each face among the stream's, or NO_ROW.
    template <class Coder>
    void code(Coder& coder, OrderContexts& contexts, Span<const int64_t> rows) {
        auto end = static_cast<int64_t>(order_.vertices.size());
        int64_t before = 0, next_row = 0;
        size_t place = 0;
        for (size_t f = 0; f < order_.faces.size() / 3; f++) {
            int64_t row = Coder::encoding ? rows[f] : 0;
            uint32_t* corners = order_.faces.span().block(3 * f, 3);
            if (code_bit(coder, contexts.vanished, row == NO_ROW) != 0) {
                for (size_t k = 0; k < 3; k++) {
                    before += code_step(coder, contexts.other, corners[k] - before);
                    expect(before >= 0 && before < end, DAMAGED);
                    corners[k] = static_cast<uint32_t>(before);
                }
                continue;
            }
            size_t key_place = 0;
            if (Coder::encoding) key_place = place_of_key(corners, row);
            place = code_place(coder, contexts.place[place], place, key_place);
            int64_t key;
            if (by_row_) {
                row = next_row + code_step(coder, contexts.rank, row - next_row);
                expect(row >= 0 && row < static_cast<int64_t>(faces_.size() / 3), DAMAGED);
                next_row = row + 1;
                key = code_twin(coder, contexts.key, stream_corner(row, 0), before, corners[place]);
            } else {
                key = before + code_step(coder, contexts.key, corners[place] - before);
                expect(key >= 0 && key < end, DAMAGED);
                row = code_rank(coder, contexts.rank, order_.vertices[static_cast<size_t>(key)], row);
            }
            before = key;
            corners[place] = static_cast<uint32_t>(key);
            for (size_t step = 1; step < 3; step++) {
                size_t corner = (place + step) % 3;
                auto& twin = corner < place ? contexts.twin_before : contexts.twin_behind;
                corners[corner] = code_twin(coder, twin, stream_corner(row, step), key, corners[corner]);
            }
        }
    }

    static constexpr int64_t NO_ROW = -1;

private:
    size_t stream_corner(int64_t row, size_t k) const {
        return static_cast<size_t>(faces_[3 * static_cast<size_t>(row) + k]);
    }

    // The corner whose vertex has the greatest first input vertex.
    size_t key_corner(Span<const int32_t> face) const {
        size_t key = 0;
        int64_t greatest = 0;
        for (size_t k = 0; k < 3; k++) {
            Span<const uint32_t> twins = twins_.of(static_cast<size_t>(face[k]));
            int64_t label = twins.size() > 0 ? static_cast<int64_t>(twins[0]) : -1;
            if (k == 0 || label > greatest) key = k, greatest = label;
        }
        return key;
    }

    // Where the key of the stream's face stands in the input's.
    size_t place_of_key(const uint32_t* corners, int64_t row) const {
        for (size_t k = 0; k < 3; k++)
            if (order_.vertices[corners[k]] == stream_corner(row, 0)) return k;
        fail(Fault::argument, "an input face that is not the stream's");
    }

    template <class Coder>
    static size_t code_place(Coder& coder, Context (&contexts)[2], size_t before, size_t place) {
        if (code_bit(coder, contexts[0], place == before) != 0) return before;
        size_t following = (before + 1) % 3;
        return code_bit(coder, contexts[1], place == following) != 0 ? following : (before + 2) % 3;
    }

    // Which of the faces with the same key it is, as a step from one more than the one coded there before.
    template <class Coder>
    int64_t code_rank(Coder& coder, Context (&contexts)[SIGNED_CONTEXTS], size_t key, int64_t row) {
        Span<const uint32_t> faces = by_key_.of(key);
        int64_t expected = expected_[key], step = 0;
        if (Coder::encoding) step = static_cast<int64_t>(first_from(faces, row)) - expected;
        int64_t rank = expected + code_step(coder, contexts, step);
        expect(rank >= 0 && rank < static_cast<int64_t>(faces.size()), DAMAGED);
        expected_[key] = static_cast<uint32_t>(rank + 1);
        return faces[static_cast<size_t>(rank)];
    }

    // Which input vertex stands at a stream vertex: the first one after the key is expected.
    template <class Coder>
    uint32_t code_twin(Coder& coder, Context (&contexts)[SIGNED_CONTEXTS], size_t vertex, int64_t key, uint32_t value) {
        Span<const uint32_t> twins = twins_.of(vertex);
        expect(twins.size() > 0, DAMAGED);
        if (twins.size() == 1) return twins[0];
        auto expected = static_cast<int64_t>(first_from(twins, key + 1));
        int64_t step = Coder::encoding ? static_cast<int64_t>(first_from(twins, value)) - expected : 0;
        int64_t place = expected + code_step(coder, contexts, step);
        expect(place >= 0 && place < static_cast<int64_t>(twins.size()), DAMAGED);
        return twins[static_cast<size_t>(place)];
    }

    InputOrder& order_;
    bool by_row_;
    Array<int32_t> faces_; // of the stream, turned so that their keys stand first
    Groups by_key_;        // rows of those
    Groups twins_;         // input vertices of each vertex
    Array<uint32_t> expected_;
};

template <class Coder>
void code_vertices(Coder& coder, OrderContexts& contexts, size_t end, Array<uint32_t>& vertices) {
    int64_t expected = 0;
    for (uint32_t& vertex : vertices) {
        int64_t value = expected + code_step(coder, contexts.steps, vertex - expected);
        expect(value >= 0 && value < static_cast<int64_t>(end), DAMAGED);
        vertex = static_cast<uint32_t>(value);
        expected = value + 1;
    }
}

// The row of each input face among the stream's.
void find_rows(const InputOrder& order, const StreamMesh& mesh, Array<int64_t>& rows, Budget& budget) {
    Groups by_first(budget);
    by_first.fill(mesh.faces.size() / 3, mesh.vertices,
                  [&](size_t t) { return static_cast<size_t>(mesh.faces[3 * t]); });
    rows.assign(order.faces.size() / 3, FaceCoder::NO_ROW);
    for (size_t f = 0; f < rows.size(); f++) {
        int64_t v[3];
        for (size_t k = 0; k < 3; k++) v[k] = order.vertices[order.faces[3 * f + k]];
        if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
        std::rotate(v, std::min_element(v, v + 3), v + 3);
        Span<const uint32_t> candidates = by_first.of(static_cast<size_t>(v[0]));
        const uint32_t* found =
            std::lower_bound(candidates.begin(), candidates.end(), v, [&](uint32_t row, const int64_t* wanted) {
                int64_t b = mesh.faces[3 * row + 1], c = mesh.faces[3 * row + 2];
                return b != wanted[1] ? b < wanted[1] : c < wanted[2];
            });
        if (found == candidates.end() || mesh.faces[3 * *found + 1] != v[1] || mesh.faces[3 * *found + 2] != v[2])
            fail(Fault::argument, "an input face that the stream does not have");
        rows[f] = *found;
    }
}

} // namespace

void encode_order(const InputOrder& order, const StreamMesh& mesh, Array<uint8_t>& payload, Budget& budget) {
    Array<int64_t> rows(budget);
    for (uint32_t v : order.vertices)
        if (v >= mesh.vertices) fail(Fault::argument, "an input vertex that the stream does not have");
    for (uint32_t v : order.faces)
        if (v >= order.vertices.size()) fail(Fault::argument, "an input face names a vertex that is not there");
    find_rows(order, mesh, rows, budget);
    InputOrder copy(budget); // coders write what they read
    copy.vertices.copy(order.vertices.span());
    copy.faces.copy(order.faces.span());
    Array<uint8_t> best(budget), coded(budget);
    uint64_t best_way = 0;
    for (uint64_t by_row : {0u, 1u}) {
        OrderContexts contexts;
        RangeEncoder coder(coded);
        code_vertices(coder, contexts, mesh.vertices, copy.vertices);
        FaceCoder(copy, mesh, by_row != 0, budget).code(coder, contexts, rows.span());
        coder.finish();
        if (by_row != 0 && coded.size() >= best.size()) continue;
        best.swap(coded);
        best_way = by_row;
    }
    payload.clear();
    write_number(payload, order.vertices.size());
    write_number(payload, order.faces.size() / 3);
    write_number(payload, best_way);
    for (uint8_t byte : best) payload.push(byte);
}

void decode_order(const OrderPacket& packet, const StreamMesh& mesh, const Limits& limits, InputOrder& order,
                  Budget& budget) {
    ByteReader reader(packet.payload);
    uint64_t vertices = reader.number(), faces = reader.number(), by_row = reader.number();
    expect(by_row <= 1, "an order of no known form");
    expect_at_most(vertices, std::min<uint64_t>(limits.vertices, INT32_MAX), "vertices");
    expect_at_most(faces, std::min<uint64_t>(limits.faces, INT32_MAX), "faces");
    check_share(vertices, faces, packet.other_bytes + packet.payload.size(), limits);
    order.vertices.assign(static_cast<size_t>(vertices), 0);
    order.faces.assign(3 * static_cast<size_t>(faces), 0);
    OrderContexts contexts;
    RangeDecoder coder(reader.rest());
    code_vertices(coder, contexts, mesh.vertices, order.vertices);
    FaceCoder(order, mesh, by_row != 0, budget).code(coder, contexts, {});
    coder.finish();
}

} // namespace meshtide::inline MESHTIDE_ISA
