#include "codec/compact_decoder.hpp"

#include <algorithm>
#include <utility>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

// Vertices of which the middles of known cells are given, in half finest steps, their depths in the fourth lanes.
struct Known {
    Span<F32x4> cells;
    int bits;
    Strength strength;
};

// Where they are drawn. What was known is used up.
void draw_known(const Known& level, Span<const int32_t> faces, Span<double> positions, Budget& budget) {
    Span<F32x4> known = level.cells;
    Strength strength = level.strength;
    size_t n = known.size();
    if (strength.smoothing == 0 && strength.sharpening == 0) { // in the middles, at any precision
        for (size_t v = 0; v < n; v++)
            for (size_t k = 0; k < 3; k++)
                positions[3 * v + k] = 0.5 * (static_cast<double>(known[v][static_cast<int>(k)]) - 1.0);
        return;
    }
    Array<int32_t> half_sides(budget);
    half_sides.resize(n);
    for (size_t v = 0; v < n; v++) {
        half_sides[v] = 1 << (level.bits - static_cast<int>(known[v][3]));
        known[v][3] = 0;
    }
    Rings rings(budget);
    order_rings(faces, n, rings, budget);
    Array<Vector> drawn(budget);
    draw({known, half_sides.span()}, rings, strength, drawn, budget);
    for (size_t v = 0; v < n; v++) {
        positions[3 * v] = drawn[v].x;
        positions[3 * v + 1] = drawn[v].y;
        positions[3 * v + 2] = drawn[v].z;
    }
}

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

CompactDecoder::CompactDecoder(const Header& header, const Trained& trained, Budget& budget)
    : StreamDecoder(header, budget), trained_(trained), plan_(plan_of(header)), chain_(budget, plan_),
      layers_(make_decoder_layers(header.compact.effort == 0 ? Effort::standard : Effort::high, budget, plan_,
                                  header.compact.slices.span(), trained, place_.offset)),
      waiting_(budget), slices_(budget), previews_(budget) {
    for (size_t slice = 0; slice < header.compact.slices.size(); slice++) slices_.add(budget);
}

void CompactDecoder::take(PacketPlace place, Span<const uint8_t> payload) {
    refined_ = false;
    int reached = has_base_ ? layers_->known_depth() : 0;
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
        waiting_.add(budget_, depth, payload);
        decode_levels();
        break;
    case PacketKind::diff:
        expect(place.slice < slices_.size(), "this stream has no such packet");
        slices_[place.slice].waiting.add(budget_, depth, payload);
        decode_diffs(place.slice);
        if (refined_ || (has_base_ && layers_->known_depth() > reached)) improve(std::min(place.level, coarsest()));
        break;
    case PacketKind::preview:
        decode_preview(place, payload);
        break;
    case PacketKind::param:
    case PacketKind::order:
        fail(Fault::malformed, "this stream has no such packet");
    }
    if (!has_base_) return;
    chain_.forget(layers_->known_depth() + 1, !only_finest());
    if (chain_.last().vertex_count() >= ROOMY) trim_heap();
}

uint64_t CompactDecoder::map_bytes() const { return layers_->map_bytes(); }

size_t CompactDecoder::find(const List<Waiting>& waiting, int depth) {
    size_t place = 0;
    while (place < waiting.size() && waiting[place].depth != depth) place++;
    return place;
}

// Levels as far as Map&Conn packets have come, and the Diffs that have waited for them.
void CompactDecoder::decode_levels() {
    while (has_base_ && !broken_ && chain_.known_depth() < header_.bits) {
        int depth = chain_.known_depth() + 1;
        size_t next = find(waiting_, depth);
        if (next == waiting_.size()) break;
        place_ = {PacketKind::map_conn, static_cast<uint32_t>(header_.bits - depth), 0};
        broken_ = true; // until it is decoded
        layers_->decode_next_level(waiting_[next].payload.span(), chain_);
        broken_ = false;
        waiting_.remove(next);
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
        size_t next = find(waiting, depth);
        if (next == waiting.size()) return;
        place_ = {PacketKind::diff, static_cast<uint32_t>(header_.bits - depth), static_cast<uint32_t>(slice)};
        progress.broken = true; // until it is decoded
        layers_->decode_planes(waiting[next].payload.span(), chain_, slice, depth);
        progress.broken = false;
        refined_ = refined_ || waiting[next].payload.size() > 0;
        waiting.remove(next);
        if (!watching()) continue;
        DecodedDiffs& kept = keep_diffs(place_.level, place_.slice);
        shifts().note(slice, layers_->slice(slice), chain_.at(depth), header_.bits, kept.values);
    }
}

void CompactDecoder::replace(const DecodedDiffs& decoded, Span<const double> values) {
    double scale = static_cast<double>(1 << decoded.level);
    shifts().replace(decoded.slice, depth_of(decoded.level), scale, decoded.values.span(), values);
}

uint64_t CompactDecoder::available() const {
    uint64_t levels = 0;
    for (const Preview& preview : previews_) levels |= static_cast<uint64_t>(1) << preview.level;
    if (has_base_)
        for (int depth = first_drawn(); depth <= chain_.known_depth(); depth++)
            levels |= static_cast<uint64_t>(1) << (header_.bits - depth);
    return levels;
}

uint64_t CompactDecoder::exact() const {
    uint64_t levels = 0;
    for (const Preview& preview : previews_) levels |= static_cast<uint64_t>(1) << preview.level;
    if (!has_base_) return levels;
    int reached = layers_->known_depth(), needed = 0;
    for (int depth = header_.compact.base_depth; depth <= chain_.known_depth(); depth++) {
        if ((header_.compact.diff_depths >> depth & 1) != 0) needed = depth;
        if (needed <= reached && depth >= first_drawn()) levels |= static_cast<uint64_t>(1) << (header_.bits - depth);
    }
    return levels;
}

void CompactDecoder::show(uint32_t level, Shown& shown) {
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
    for (size_t slice = 0; slice < slices_.size(); slice++) layers_->slice(slice).give_known(cells, known.span());
    canonical_faces(cells, shown.faces, budget_);
    int depth = depth_of(level) - header_.compact.base_depth;
    shown.positions.resize(3 * known.size());
    draw_known({known.span(), header_.bits, STRENGTHS[header_.compact.strengths[depth]]}, shown.faces.span(),
               shown.positions.span(), budget_);
    if (!watching()) return;
    for (size_t slice = 0; slice < slices_.size(); slice++)
        shifts().shift(slice, layers_->slice(slice), cells, header_.bits, shown.positions.span());
}

void show_truth(const Octree& octree, int depth, int known_depth, Strength strength, Span<double> positions,
                Budget& budget) {
    const Octree::Depth& cells = octree.at(depth);
    Array<F32x4> known(budget);
    known.resize(cells.cell_count());
    for (size_t v = 0; v < known.size(); v++) {
        size_t first = cells.first[v];
        int reached = cells.is_leaf(v) ? std::max(octree.leaf_depth(first), known_depth) : depth;
        int shift = octree.bits - reached;
        for (size_t k = 0; k < 3; k++) {
            int32_t cell = octree.positions[3 * first + k] >> shift;
            known[v][static_cast<int>(k)] = static_cast<float>((2 * cell + 1) << shift);
        }
        known[v][3] = static_cast<float>(reached);
    }
    draw_known({known.span(), octree.bits, strength}, cells.faces.span(), positions, budget);
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
    auto layers = make_decoder_layers(Effort::standard, budget_, plan, {whole, 1}, trained_, place_.offset);
    layers->decode_preview(reader.rest(), chain, leaf_depth);
    expect(chain.ends(), "a preview that has cells to split");

    Preview preview(budget_);
    preview.level = place.level;
    const Level& cells = chain.at(bits);
    Array<F32x4> known(budget_);
    known.resize(cells.vertex_count());
    layers->slice(0).give_known(cells, known.span());
    double scale = static_cast<double>((1 << header_.bits) - 1) / static_cast<double>((1 << bits) - 1);
    preview.shown.positions.resize(3 * known.size());
    for (size_t v = 0; v < known.size(); v++)
        for (size_t k = 0; k < 3; k++)
            preview.shown.positions[3 * v + k] =
                0.5 * (static_cast<double>(known[v][static_cast<int>(k)]) - 1.0) * scale;
    canonical_faces(cells, preview.shown.faces, budget_);
    previews_.add(std::move(preview)); // all of it is there
}

} // namespace meshtide::inline MESHTIDE_ISA
