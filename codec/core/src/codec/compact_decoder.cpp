#include "codec/compact_decoder.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

Plan plan_of(const Header& header) {
    Plan plan;
    plan.bits = header.bits;
    plan.vertices = checked_size(header.vertices());
    for (const StateEntry& state : header.states)
        plan.most_faces = std::max(plan.most_faces, checked_size(state.faces));
    plan.mirror = {header.compact.mirror_axis, header.compact.mirror_sum};
    return plan;
}

} // namespace

CompactDecoder::CompactDecoder(const Header& header, const Limits& limits, Budget& budget)
    : header_(header), limits_(limits), budget_(budget), plan_(plan_of(header)), chain_(budget, plan_),
      layers_(make_decoder_layers(header.compact.effort == 0 ? Effort::standard : Effort::high, budget, plan_,
                                  header.compact.slices.span())),
      slices_(header.compact.slices.size()), taken_(budget) {
    taken_.assign(header.packets.size(), 0);
}

// The place of a packet in the table; that it came is noted.
size_t CompactDecoder::entry_of(PacketPlace place) const {
    for (size_t i = 0; i < header_.packets.size(); i++) {
        const PacketEntry& entry = header_.packets[i];
        if (entry.kind == static_cast<uint8_t>(place.kind) && entry.level == place.level && entry.slice == place.slice)
            return i;
    }
    fail(Fault::malformed, "this stream has no such packet");
}

void CompactDecoder::push(PacketPlace place, Span<const uint8_t> payload) {
    place_ = place;
    size_t entry = entry_of(place);
    expect(taken_[entry] == 0, "it came twice");
    int depth = depth_of(place.level);
    switch (place.kind) {
    case PacketKind::base:
        expect(!broken_, "it is damaged");
        broken_ = true; // until it is decoded
        layers_->decode_base(payload, chain_, header_.compact.base_depth);
        broken_ = false;
        has_base_ = true;
        decode_levels();
        break;
    case PacketKind::map_conn:
        expect(place.slice == 0 && place.level < coarsest(), "this stream has no such packet");
        expect(!broken_, "the levels before it are damaged");
        waiting_.emplace_back(budget_, depth, payload);
        decode_levels();
        break;
    case PacketKind::diff:
        expect(place.slice < slices_.size(), "this stream has no such packet");
        slices_[place.slice].waiting.emplace_back(budget_, depth, payload);
        decode_diffs(place.slice);
        break;
    case PacketKind::preview:
        decode_preview(place, payload);
        break;
    case PacketKind::param:
    case PacketKind::order:
        fail(Fault::malformed, "this stream has no such packet");
    }
    taken_[entry] = 1;
}

// Levels as far as Map&Conn packets have come, and the Diffs that have waited for them.
void CompactDecoder::decode_levels() {
    while (has_base_ && !broken_ && chain_.known_depth() < header_.bits) {
        int depth = chain_.known_depth() + 1;
        auto next =
            std::find_if(waiting_.begin(), waiting_.end(), [&](const Waiting& each) { return each.depth == depth; });
        if (next == waiting_.end()) break;
        place_ = {PacketKind::map_conn, static_cast<uint32_t>(header_.bits - depth), 0};
        broken_ = true; // until it is decoded
        layers_->decode_next_level(next->payload.span(), chain_);
        broken_ = false;
        waiting_.erase(next);
    }
    expect(!has_base_ || broken_ || !chain_.ends() || waiting_.empty(), "nothing is left to split");
    for (size_t slice = 0; slice < slices_.size(); slice++) decode_diffs(slice);
}

// The Diffs of a slice as far as they and their levels have come.
void CompactDecoder::decode_diffs(size_t slice) {
    SliceProgress& progress = slices_[slice];
    if (!has_base_ || progress.broken) return;
    for (int depth = layers_->slice(slice).known_depth() + 1; depth <= chain_.known_depth(); depth++) {
        if ((header_.compact.diff_depths >> depth & 1) == 0) continue;
        auto& waiting = progress.waiting;
        auto next =
            std::find_if(waiting.begin(), waiting.end(), [&](const Waiting& each) { return each.depth == depth; });
        if (next == waiting.end()) return;
        place_ = {PacketKind::diff, static_cast<uint32_t>(header_.bits - depth), static_cast<uint32_t>(slice)};
        progress.broken = true; // until it is decoded
        layers_->decode_planes(next->payload.span(), chain_, slice, depth);
        progress.broken = false;
        waiting.erase(next);
    }
}

// The depth that the Diffs of all slices have come to.
int CompactDecoder::reached_depth() const {
    int reached = header_.bits;
    for (size_t slice = 0; slice < slices_.size(); slice++)
        reached = std::min(reached, layers_->slice(slice).known_depth());
    return reached;
}

uint64_t CompactDecoder::available() const {
    uint64_t levels = 0;
    for (const Preview& preview : previews_) levels |= static_cast<uint64_t>(1) << preview.level;
    if (has_base_)
        for (int depth = header_.compact.base_depth; depth <= chain_.known_depth(); depth++)
            levels |= static_cast<uint64_t>(1) << (header_.bits - depth);
    return levels;
}

uint64_t CompactDecoder::exact() const {
    uint64_t levels = 0;
    for (const Preview& preview : previews_) levels |= static_cast<uint64_t>(1) << preview.level;
    if (!has_base_) return levels;
    int reached = reached_depth(), needed = 0;
    for (int depth = header_.compact.base_depth; depth <= chain_.known_depth(); depth++) {
        if ((header_.compact.diff_depths >> depth & 1) != 0) needed = depth;
        if (needed <= reached) levels |= static_cast<uint64_t>(1) << (header_.bits - depth);
    }
    return levels;
}

void CompactDecoder::show(uint32_t level, Shown& shown) const {
    if (level > MOST_LEVEL || (available() >> level & 1) == 0) fail(Fault::argument, "the level is not available yet");
    for (const Preview& preview : previews_) {
        if (preview.level != level) continue;
        shown.positions.copy(preview.shown.positions.span());
        shown.faces.copy(preview.shown.faces.span());
        return;
    }
    const Level& cells = chain_.at(depth_of(level));
    Array<F32x4> known(budget_);
    known.copy(cells.centres.span());
    for (size_t v = 0; v < known.size(); v++) known[v][3] = cells.cell_depths[v];
    for (size_t slice = 0; slice < slices_.size(); slice++) layers_->slice(slice).tell(cells, known.span());
    canonical_faces(cells, shown.faces, budget_);
    int depth = depth_of(level) - header_.compact.base_depth;
    draw_known(known.span(), header_.bits, STRENGTHS[header_.compact.strengths[depth]], shown, budget_);
}

void draw_known(Span<F32x4> known, int bits, Strength strength, Shown& shown, Budget& budget) {
    size_t n = known.size();
    shown.positions.resize(3 * n);
    if (strength.smoothing == 0 && strength.sharpening == 0) { // in the middles, at any precision
        for (size_t v = 0; v < n; v++)
            for (size_t k = 0; k < 3; k++)
                shown.positions[3 * v + k] = 0.5 * (static_cast<double>(known[v][static_cast<int>(k)]) - 1.0);
        return;
    }
    Array<int32_t> half_sides(budget);
    half_sides.resize(n);
    for (size_t v = 0; v < n; v++) {
        half_sides[v] = 1 << (bits - static_cast<int>(known[v][3]));
        known[v][3] = 0;
    }
    Rings rings(budget);
    order_rings(shown.faces.span(), n, rings, budget);
    Array<Vector> drawn(budget);
    draw({known, half_sides.span()}, rings, strength, drawn, budget);
    for (size_t v = 0; v < n; v++) {
        shown.positions[3 * v] = drawn[v].x;
        shown.positions[3 * v + 1] = drawn[v].y;
        shown.positions[3 * v + 2] = drawn[v].z;
    }
}

// A mesh of its own, in a cube of its own bits: b (b + 1) / 2 + a for b bits and the depth a at which all its cells are
// leaves; then one payload with the levels and the bit planes.
void CompactDecoder::decode_preview(PacketPlace place, Span<const uint8_t> payload) {
    uint32_t number = place.level - coarsest() - 1;
    expect(place.level > coarsest() && number < header_.compact.previews, "this stream has no such packet");
    const StateEntry* state = header_.state_of(place.level);
    expect(state != nullptr, "the header has no state of this level");
    ByteReader reader(payload);
    uint64_t head = reader.number();
    int bits = LEAST_BITS;
    while (bits < header_.bits && head >= static_cast<uint64_t>((bits + 1) * (bits + 2) / 2)) bits++;
    uint64_t first = static_cast<uint64_t>(bits * (bits + 1) / 2);
    if (head < first || head - first > static_cast<uint64_t>(bits)) reader.fail_here("a preview of more than B bits");
    auto leaf_depth = static_cast<int>(head - first);

    Plan plan;
    plan.bits = bits;
    plan.vertices = checked_size(state->vertices);
    plan.most_faces = checked_size(state->faces);
    LevelChain chain(budget_, plan);
    const uint64_t whole[1] = {0};
    auto layers = make_decoder_layers(Effort::standard, budget_, plan, {whole, 1});
    layers->decode_preview(reader.rest(), chain, leaf_depth);
    expect(chain.ends(), "a preview that has cells to split");

    Preview& preview = previews_.emplace_back(budget_);
    preview.level = place.level;
    const Level& cells = chain.at(bits);
    Array<F32x4> known(budget_);
    known.resize(cells.vertex_count());
    layers->slice(0).tell(cells, known.span());
    double scale = static_cast<double>((1 << header_.bits) - 1) / static_cast<double>((1 << bits) - 1);
    preview.shown.positions.resize(3 * known.size());
    for (size_t v = 0; v < known.size(); v++)
        for (size_t k = 0; k < 3; k++)
            preview.shown.positions[3 * v + k] =
                0.5 * (static_cast<double>(known[v][static_cast<int>(k)]) - 1.0) * scale;
    canonical_faces(cells, preview.shown.faces, budget_);
}

void canonical_faces(const Level& level, Array<int32_t>& faces, Budget& budget) {
    size_t count = level.face_count(), vertices = level.vertex_count();
    Array<uint32_t> starts(budget); // by the least corner
    starts.assign(vertices + 1, 0);
    auto rotated = [&](size_t t, int32_t* corners) {
        for (size_t k = 0; k < 3; k++) corners[k] = level.corners[4 * t + k];
        while (corners[0] > corners[1] || corners[0] > corners[2]) std::rotate(corners, corners + 1, corners + 3);
    };
    int32_t face[3];
    for (size_t t = 0; t < count; t++) {
        rotated(t, face);
        starts[static_cast<size_t>(face[0]) + 1]++;
    }
    for (size_t v = 0; v < vertices; v++) starts[v + 1] += starts[v];
    Array<uint64_t> others(budget); // the two other corners
    others.resize(count);
    for (size_t t = 0; t < count; t++) {
        rotated(t, face);
        others[starts[static_cast<size_t>(face[0])]++] =
            static_cast<uint64_t>(face[1]) << 32 | static_cast<uint32_t>(face[2]);
    }
    faces.resize(3 * count);
    size_t first = 0;
    for (size_t v = 0; v < vertices; v++) {
        size_t end = starts[v];
        std::sort(others.begin() + first, others.begin() + end);
        for (; first < end; first++) {
            faces[3 * first] = static_cast<int32_t>(v);
            faces[3 * first + 1] = static_cast<int32_t>(others[first] >> 32);
            faces[3 * first + 2] = static_cast<int32_t>(others[first]);
        }
    }
}

} // namespace meshtide::inline MESHTIDE_ISA
