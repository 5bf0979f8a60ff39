// The walk over the vertices of a slice that codes one of its bit planes.
#pragma once

#include "diff/code_diff.hpp"
#include "diff/questions.hpp"

#include <type_traits>

namespace meshtide::inline MESHTIDE_ISA {

template <Effort effort, class Coder>
class DiffPlane {
public:
    DiffPlane(Coder& coder, int depth, DiffSlice& slice, DiffModel<effort>& model, const DiffTruth& truth)
        : coder_(coder), depth_(depth), slice_(slice), truth_(truth), mixer_(model.mixer_states()),
          half_(static_cast<float>(1 << (slice.range_.bits - depth))), mirror_(slice, depth, half_),
          surface_errors_(slice.budget()) {}

    void code() {
        DiffSlice& s = slice_;
        if (depth_ != s.known_depth_ + 1 || depth_ < s.level_depth_ || depth_ > s.range_.bits)
            fail(Fault::argument, "bit planes are coded one after the other, once the slice has entered their level");
        size_t count = s.run_.count();
        for (size_t i = count; i < s.rows_.size(); i++) s.rows_[i].position[3] = static_cast<float>(depth_ - 1);
        if (s.mirror_.exists()) mirror_.find_partners(s.budget());
        if (high) surface_errors_.assign(s.rows_.size(), -1);
        for (size_t i = 0; i < count; i++)
            if (s.leaf_depths_[i] < depth_) code_vertex(i);
        s.known_depth_ = depth_;
    }

private:
    static constexpr auto high = IS_HIGH<effort>;
    using DiffMixer = typename DiffModel<effort>::DiffMixer;

    MESHTIDE_INLINE void code_vertex(size_t vertex) {
        DiffSlice& s = slice_;
        float inverse = 1 / half_;
        const DiffRow own = s.rows_[vertex];
        size_t first = s.ring_starts_[vertex];
        Span<const DiffNeighbour> neighbours = s.neighbours_.span().part(first, s.ring_starts_[vertex + 1] - first);

        Surroundings seen;
        WideView wide;
        std::conditional_t<effort == Effort::standard, NoPatch, Patch> patch;
        seen.ring.closed = s.closed_[vertex] != 0;
        look_around(s.rows_.span(), own, neighbours, F32x4{inverse, inverse, inverse, 1}, seen, patch);
        if constexpr (effort != Effort::standard)
            if (high) look_wide(seen, patch, own, neighbours, surface_errors_.span(), wide);
        Reflection reflection;
        if (s.mirror_.exists()) reflection = mirror_.look(vertex);
        int age = depth_ - s.leaf_depths_[vertex];
        Asking<effort> asking(seen, wide, reflection, s.mirror_.axis, (age < 8 ? age : 8) - 1);

        F32x4 steps = high ? code_in_turn(vertex, seen, wide, asking) : code_at_once(vertex, seen, asking);

        if (s.mirror_.exists()) mirror_.compare(vertex, reflection, steps);
        if (high) {
            float missed = dot3(steps, wide.surface.normal) - wide.surface.height;
            surface_errors_[vertex] = missed < 0 ? -missed : missed;
        }
        move(vertex, own, neighbours, steps, seen.smoothed);
    }

    MESHTIDE_INLINE F32x4 code_at_once(size_t vertex, const Surroundings& seen, Asking<effort>& asking) {
        asking.aim(seen.plane, seen.plane);
        typename DiffMixer::Question questions[3];
        int bits = 0;
        for (int axis = 0; axis < 3; axis++) {
            asking.ask(axis, questions[axis]);
            bits |= truth_bit(vertex, axis) << axis;
        }
        bits = mixer_.code(coder_, questions, bits);
        I32x4 zeros = (splat32(bits) & I32x4{1, 2, 4, 0}) == splat32(0);
        return negated(F32x4{1, 1, 1, 0}, zeros);
    }

    // The axis nearest to the normal last: by then the bits of the others have settled where on the surface the vertex is.
    MESHTIDE_INLINE F32x4 code_in_turn(size_t vertex, const Surroundings& seen, const WideView& wide,
                                       Asking<effort>& asking) {
        constexpr float SLANT = 0.15f;
        F32x4 n = seen.normal, m = wide.surface.normal, steps = {};
        F32x4 lean = n / (n * n + SLANT), surface_lean = m / (m * m + SLANT);
        int axes[3];
        for (int axis = 0; axis < 3; axis++) axes[seen.rank[axis]] = axis;
        float carried = 0, surface_carried = 0;
        for (int axis : axes) {
            asking.aim(seen.plane - lean * carried, wide.quadric - surface_lean * surface_carried);
            float step = code_axis(vertex, axis, asking);
            carried += (step - seen.plane[axis]) * n[axis];
            surface_carried += (step - wide.quadric[axis]) * m[axis];
            steps[axis] = step;
        }
        return steps;
    }

    MESHTIDE_INLINE float code_axis(size_t vertex, int axis, const Asking<effort>& asking) {
        typename DiffMixer::Question question;
        asking.ask(axis, question);
        return mixer_.code(coder_, question, truth_bit(vertex, axis)) != 0 ? 1.0f : -1.0f;
    }

    MESHTIDE_INLINE int truth_bit(size_t vertex, int axis) const {
        if constexpr (Coder::encoding) {
            size_t finest = truth_.first_vertices[slice_.run_.first + vertex];
            return truth_.positions[3 * finest + static_cast<size_t>(axis)] >> (slice_.range_.bits - depth_) & 1;
        }
        return 0;
    }

    // The vertex is where it is now, and its neighbours see it there.
    MESHTIDE_INLINE void move(size_t vertex, const DiffRow& own, Span<const DiffNeighbour> neighbours, F32x4 steps,
                              F32x4 expected) {
        DiffSlice& s = slice_;
        F32x4 error = magnitude(steps - expected), way = steps * half_, position = own.position + way;
        position[3] = static_cast<float>(depth_);
        F32x4 laplacian = own.laplacian - way;
        laplacian[3] = (error[0] + error[1] + error[2]) * (1.0f / 3);
        s.rows_[vertex] = {position, laplacian};
        Span<DiffRow> rows = s.rows_.span();
        Span<const float> shares = s.shares_.span();
        for (DiffNeighbour neighbour : neighbours) {
            auto member = static_cast<size_t>(neighbour.member);
            if (member < shares.size()) rows[member].laplacian += way * shares[member];
        }
    }

    Coder& coder_;
    int depth_;
    DiffSlice& slice_;
    const DiffTruth& truth_;
    DiffMixer mixer_;
    float half_; // half a cell of the depth, in half finest steps
    DiffMirror mirror_;
    Array<float> surface_errors_; // of each row, at effort high
};

template <Effort effort, class Coder>
void code_diff(Coder& coder, int depth, DiffSlice& slice, DiffModel<effort>& model, const DiffTruth& truth) {
    DiffPlane<effort, Coder>(coder, depth, slice, model, truth).code();
}

} // namespace meshtide::inline MESHTIDE_ISA
