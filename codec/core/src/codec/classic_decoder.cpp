#include "codec/classic_decoder.hpp"

#include "classic/coders.hpp"
#include "classic/geometry.hpp"

#include <bit>

namespace meshtide::inline MESHTIDE_ISA {

Filter filter_of(const ClassicOptions& options) {
    Filter filter;
    filter.kind = options.filter;
    filter.basis = options.chebyshev != 0 ? FilterBasis::chebyshev : FilterBasis::power;
    filter.degree = options.degree;
    filter.denominator_degree = options.denominator_degree;
    filter.taubin_lambda = options.taubin_lambda;
    filter.taubin_mu = options.taubin_mu;
    return filter;
}

ClassicDecoder::ClassicDecoder(const Header& header, const Trained& trained, Budget& budget)
    : StreamDecoder(header, budget), filter_(filter_of(header.classic)), levels_(budget),
      connectivity_(budget, trained.of_classic()), next_(header.classic.levels) {
    for (uint32_t number = 0; number < header.classic.levels; number++) {
        const StateEntry* state = header.state_of(number);
        if (state == nullptr) fail(Fault::argument, "a header without a state for each level");
        ClassicLevel& level = levels_.add(budget);
        level.vertex_count = checked_size(state->vertices);
        level.face_count = checked_size(state->faces);
    }
}

void ClassicDecoder::take(PacketPlace place, Span<const uint8_t> payload) {
    uint32_t number = place.level;
    bool predicted = number < coarsest();
    if (place.slice == 0 && number <= coarsest()) {
        ClassicLevel& level = levels_[number];
        if (place.kind == PacketKind::base && !predicted) {
            decode_base(payload);
            return decode_levels();
        }
        if (place.kind == PacketKind::map_conn && predicted) {
            expect(!broken_, "the levels before it are damaged");
            level.waiting.copy(payload);
            level.has_waiting = true;
            return decode_levels();
        }
        if (place.kind == PacketKind::param && predicted && filter_.coefficient_count() != 0)
            return decode_coefficients(level, payload);
        if (place.kind == PacketKind::diff && (header_.classic.diffs >> number & 1) != 0)
            return decode_diff(number, payload);
    }
    fail(Fault::malformed, "this stream has no such packet");
}

void ClassicDecoder::decode_base(Span<const uint8_t> payload) {
    expect(!broken_, "it is damaged");
    broken_ = true; // until it is decoded
    ClassicLevel& level = levels_[coarsest()];
    ClassicGrid grid{header_.bits, shift_of(coarsest())};
    int cell_bits = grid.bits - grid.shift;
    PayloadDecoder decoder(payload, place_.offset);
    RangeDecoder& coder = decoder.coder;
    Array<uint64_t> codes(budget_);
    codes.assign(level.vertex_count, 0);
    code_cells(coder, codes.span(), cell_bits, budget_);
    map_bytes_ += coder.offset();
    const auto children = static_cast<uint32_t>(level.vertex_count);
    connectivity_.code_next(coder, {&children, 1}, level.face_count);
    coder.finish();
    connectivity_.tell_faces(level.faces);
    level.geometry.clear();
    for (uint64_t code : codes) {
        uint32_t cell[3] = {};
        for (int i = cell_bits - 1; i >= 0; i--)
            for (int k = 0; k < 3; k++) cell[k] = cell[k] << 1 | static_cast<uint32_t>(code >> (3 * i + 2 - k) & 1);
        level.geometry.push({grid.middle(cell[0]), grid.middle(cell[1]), grid.middle(cell[2])});
    }
    level.has_geometry = level.has_faces = true;
    broken_ = false;
    next_--;
}

// Faces as far as Map&Conn packets have come.
void ClassicDecoder::decode_levels() {
    Array<uint32_t> children(budget_);
    while (!broken_ && next_ <= coarsest() && next_ > 0 && levels_[next_ - 1].has_waiting) {
        uint32_t number = next_ - 1;
        ClassicLevel& level = levels_[number];
        place_ = {PacketKind::map_conn, number, 0};
        broken_ = true; // until it is decoded
        PayloadDecoder decoder(level.waiting.span(), place_.offset);
        RangeDecoder& coder = decoder.coder;
        children.assign(connectivity_.vertex_count(), 0);
        code_children(coder, children.span(), level.vertex_count, budget_);
        map_bytes_ += coder.offset();
        connectivity_.code_next(coder, children.span(), level.face_count);
        coder.finish();
        level.parents.copy(connectivity_.parents());
        connectivity_.tell_faces(level.faces);
        Array<uint8_t>(budget_).swap(level.waiting);
        level.has_waiting = false;
        level.has_faces = true;
        broken_ = false;
        next_--;
    }
}

void ClassicDecoder::decode_coefficients(ClassicLevel& level, Span<const uint8_t> payload) {
    size_t count = filter_.coefficient_count();
    expect(payload.size() == 12 * count, "another number of coefficients than the filter has");
    level.coefficients.clear();
    for (size_t i = 0; i < payload.size(); i += 4) {
        uint32_t bits = 0;
        for (size_t k = 4; k-- > 0;) bits = bits << 8 | payload[i + k];
        level.coefficients.push(std::bit_cast<float>(bits));
    }
    check_coefficients(filter_, level.coefficients.span());
    level.has_coefficients = true;
}

void ClassicDecoder::decode_diff(uint32_t number, Span<const uint8_t> payload) {
    ClassicLevel& level = levels_[number];
    level.differences.assign(3 * level.vertex_count, 0);
    PayloadDecoder decoder(payload, place_.offset);
    code_differences(decoder.coder, level.differences.span(), budget_);
    decoder.coder.finish();
    level.has_differences = true;
    improve(number);
    forget_geometry(number);
    if (!watching()) return;
    DecodedDiffs& kept = keep_diffs(number, 0);
    for (int32_t difference : level.differences) kept.values.push(difference);
}

void ClassicDecoder::replace(const DecodedDiffs& decoded, Span<const double> values) {
    levels_[decoded.level].others.copy(values);
    forget_geometry(decoded.level);
}

// A level has changed, and with it all finer ones.
void ClassicDecoder::forget_geometry(uint32_t number) {
    for (uint32_t finer = 0; finer <= number; finer++) levels_[finer].has_geometry = false;
}

uint64_t ClassicDecoder::available() const {
    uint64_t available = 0;
    for (uint32_t number = levels_.size() == 0 ? 0 : coarsest() + 1; number-- > next_;) {
        bool predictable = number == coarsest() || filter_.coefficient_count() == 0 || levels_[number].has_coefficients;
        if (!predictable) break;
        available |= static_cast<uint64_t>(1) << number;
    }
    return available;
}

uint64_t ClassicDecoder::exact() const {
    uint64_t levels = available();
    for (uint32_t number = 0; number <= coarsest(); number++)
        if ((header_.classic.diffs >> number & 1) != 0 && !levels_[number].has_differences)
            levels &= ~((static_cast<uint64_t>(2) << number) - 1);
    return levels;
}

void ClassicDecoder::show(uint32_t number, Shown& shown) {
    if (number > MOST_LEVEL || (available() >> number & 1) == 0)
        fail(Fault::argument, "the level is not available yet");
    uint32_t known = number; // the finest one not below it whose geometry is there
    while (!levels_[known].has_geometry) known++;
    while (known > number) reconstruct(--known);
    const ClassicLevel& level = levels_[number];
    shown.positions.clear();
    for (const Vector& position : level.geometry)
        for (double coordinate : {position.x, position.y, position.z}) shown.positions.push(coordinate);
    shown.faces.copy(level.faces.span());
}

void ClassicDecoder::reconstruct(uint32_t number) {
    ClassicLevel& level = levels_[number];
    const ClassicLevel& coarser = levels_[number + 1];
    size_t n = level.vertex_count;
    if (!level.has_graph) {
        build_graph(level.faces.span(), n, level.graph, budget_);
        level.has_graph = true;
    }
    Array<Vector> extension(budget_);
    extension.resize(n);
    for (size_t v = 0; v < n; v++) extension[v] = coarser.geometry[level.parents[v]];
    level.geometry.resize(n);
    predict(level.graph, filter_, level.coefficients.span(), extension.span(), level.geometry.span(), budget_);
    ClassicGrid grid{header_.bits, shift_of(number)};
    for (size_t v = 0; v < n; v++) {
        Vector& position = level.geometry[v];
        position = grid.within(position);
        if (!level.has_differences) continue;
        double differences[3];
        for (size_t k = 0; k < 3; k++)
            differences[k] = level.others.empty() ? level.differences[3 * v + k] : level.others[3 * v + k];
        position = grid.moved(position, differences);
    }
    level.has_geometry = true;
}

} // namespace meshtide::inline MESHTIDE_ISA
