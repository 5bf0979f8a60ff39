// The Diff layer (docs/format.md, Diff): one more bit of each coordinate for each leaf that is coarser than a depth.
#pragma once

#include "diff/questions.hpp"
#include "mesh/cell_table.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// What an encoder knows: finest positions, three coordinates each, and the first finest vertex of each cell of the
// level.
struct DiffTruth {
    Span<const int32_t> positions;
    Span<const uint32_t> first;
};

template <Effort effort>
struct DiffModel {
    using Shape = DiffShape<effort>;
    using DiffMixer = Mixer<Shape::groups, Shape::neurons, DRATE>;
    static constexpr size_t sum_of(const int* sizes, int count) {
        size_t sum = 0;
        for (int i = 0; i < count; i++) sum += static_cast<size_t>(sizes[i]);
        return sum;
    }
    static constexpr size_t context_count = sum_of(Shape::context_sizes, 4 * Shape::groups);
    static constexpr size_t neuron_count = sum_of(Shape::neuron_sizes, Shape::neurons);
    static constexpr size_t final_neuron_count = 24;
    explicit DiffModel(Budget& budget) : contexts(budget), weights(budget), final_weights(budget) {
        contexts.assign(context_count, Context{});
        weights.assign(neuron_count * DiffMixer::lanes, 0);
        for (size_t n = 0; n < neuron_count; n++)
            for (size_t i = 0; i < 16 * Shape::groups; i++)
                if ((i & 8) == 0) weights[n * DiffMixer::lanes + i] = WEIGHT_ONE / (6 * Shape::groups);
        final_weights.assign(final_neuron_count * 8, WEIGHT_ONE / Shape::neurons);
    }
    Array<Context> contexts;
    Array<int16_t> weights, final_weights;
};

template <Effort effort, class Coder>
class DiffPlane {
public:
    DiffPlane(Coder& coder, const Level& level, int depth, DiffSlice& slice, DiffModel<effort>& model, DiffTruth truth)
        : coder_(coder), level_(level), depth_(depth), slice_(slice), model_(model), truth_(truth) {}

    void code() {
        DiffSlice& s = slice_;
        typename DiffModel<effort>::DiffMixer mixer(
            MixerStates{model_.contexts.span(), model_.weights.span(), model_.final_weights.span()});
        Span<DiffRow> rows = s.rows_.span();
        size_t count = s.run_.end - s.run_.first;
        float half = static_cast<float>(1 << (s.range_.bits - depth_)), inverse = 1 / half;
        F32x4 unit = {inverse, inverse, inverse, 1};
        auto depth = static_cast<float>(depth_);
        for (size_t i = count; i < rows.size(); i++) rows[i].position[3] = depth - 1;
        if (s.mirror_.axis >= 0) find_partners(half);
#if LAP == 1
        for (size_t i = 0; i < count; i++) {
            size_t first = s.ring_starts_[i], n = s.ring_starts_[i + 1] - first;
            F32x4 sum = {};
            for (size_t k = 0; k < n; k++) sum += rows[static_cast<size_t>(s.neighbours_[first + k].member)].position;
            F32x4 lap = n ? sum * (1.0f / static_cast<float>(n)) - rows[i].position : F32x4{};
            lap[3] = rows[i].laplacian[3];
            if (s.leaf_depths_[i] < depth_) lap[3] *= ERROR_GROWTH;
            rows[i].laplacian = lap;
        }
#endif
        Surroundings seen;
        AxisQuestions<effort> axes;
        Array<float> surface_errors(s.budget_);
        if constexpr (effort == Effort::high) surface_errors.assign(rows.size(), -1);
        typename DiffModel<effort>::DiffMixer::Question question;
        for (size_t i = 0; i < count; i++) {
            if (s.leaf_depths_[i] >= depth_) continue;
            size_t first = s.ring_starts_[i], n = s.ring_starts_[i + 1] - first;
            const DiffNeighbour* neighbours = s.neighbours_.span().block(first, n);
            DiffRow own = rows[i];
            std::conditional_t<effort == Effort::high, Patch, NoPatch> patch;
            FarSight far;
            look_around(patch, rows, neighbours, static_cast<int>(n), s.ring_closed_[i] != 0, unit, own, seen);
            if constexpr (effort == Effort::high) look_far(patch, seen, own, neighbours, n, surface_errors, far);
            Reflection reflection;
            if (s.mirror_.axis >= 0) reflection = look_in_mirror(i, neighbours, n, unit, own);
            int age = depth_ - s.leaf_depths_[i];
            age = (age < 8 ? age : 8) - 1;
            ask<effort>(seen, far, reflection, age, axes);
            for (int k = 0; k < 4 * axes.groups; k += 4) {
                transpose(axes.places + k);
                transpose(axes.signs + k);
            }
            for (int k = 0; k < 8; k += 4) {
                transpose(axes.numbers + k);
                transpose(axes.neurons + k);
            }
            F32x4 steps = {};
            for (int axis = 0; axis < 3; axis++) {
                int bit = 0;
                if constexpr (Coder::encoding)
                    bit = truth_.positions[3 * truth_.first[s.run_.first + i] + static_cast<size_t>(axis)] >>
                              (s.range_.bits - depth_) & 1;
                for (int g = 0; g < axes.groups; g++) {
                    std::memcpy(question.contexts + 4 * g, &axes.places[4 * g + axis], 16);
                    question.opposed[g] = pack(axes.signs[4 * g + axis], axes.signs[4 * g + axis]);
                }
                question.numbers = pack(axes.numbers[axis], axes.numbers[4 + axis]);
                std::memcpy(question.neurons, &axes.neurons[axis], 16);
                std::memcpy(question.neurons + 4, &axes.neurons[4 + axis],
                            static_cast<size_t>(4 * (DiffShape<effort>::neurons - 4)));
                question.final_neuron = static_cast<uint32_t>(axis * 8 + age);
                bit = mixer.code(coder_, question, bit);
                steps[axis] = bit != 0 ? 1.0f : -1.0f;
            }
            if (reflection.state > 4) {
                F32x4 missed = magnitude(reflection.offset - steps);
                bool agrees = missed[0] <= 1.01f && missed[1] <= 1.01f && missed[2] <= 1.01f;
                Likeness likeness = agrees ? Likeness::agrees : Likeness::differs;
                s.likenesses_[i] = likeness;
                Likeness& other = s.likenesses_[static_cast<size_t>(s.partners_[i])];
                if (other == Likeness::undecided) other = likeness;
            }
            if constexpr (effort == Effort::high)
                surface_errors[i] = magnitude_of(dot3(steps, far.surface.normal) - far.surface.height);
            F32x4 error = magnitude(steps - seen.smoothed);
#if LAP == 0
            F32x4 laplacian = (seen.mean - steps) * half;
            laplacian[3] = (error[0] + error[1] + error[2]) * (1.0f / 3);
#else
            F32x4 laplacian = own.laplacian;
            laplacian[3] = (error[0] + error[1] + error[2]) * (1.0f / 3);
#endif
            F32x4 position = own.position + steps * half;
            position[3] = depth;
            rows[i] = {position, laplacian};
        }
        s.known_depth_ = depth_;
    }

private:
    static float magnitude_of(float x) { return x < 0 ? -x : x; }
    static MESHTIDE_INLINE void look_far(Patch& patch, const Surroundings& seen, const DiffRow& own,
                                         const DiffNeighbour* neighbours, size_t n, const Array<float>& errors,
                                         FarSight& far) {
        far.pairs = guess_pairs(seen.ring);
        far.below = far.above = splat32(0);
        F32x4 squares = {};
        for (int i = 0; i < patch.count; i++) {
            far.below -= patch.points[i] == splat(-1);
            far.above -= patch.points[i] == splat(1);
        }
        for (int i = 0; i < seen.ring.count; i++) squares += seen.ring[i] * seen.ring[i];
        far.surface = Surface{};
        far.quadric_class = ERROR_CLASSES - 1;
        if (seen.normal[0] != 0 || seen.normal[1] != 0 || seen.normal[2] != 0) {
            float scale = __builtin_sqrtf((squares[0] + squares[1] + squares[2]) / static_cast<float>(n));
            far.surface = fit_surface(patch, seen.normal, scale);
            float error = 0.5f * 0.7f * own.laplacian[3], weight = 0.5f;
            for (size_t i = 0; i < n; i++) {
                float e = errors[static_cast<size_t>(neighbours[i].member)];
                if (e >= 0) error += e, weight += 1;
            }
            int c = error_class(error / weight);
            far.quadric_class = c < ERROR_CLASSES - 2 ? c : ERROR_CLASSES - 2;
        }
        float along = far.surface.height - dot3(far.surface.normal, seen.smoothed);
        far.quadric = seen.smoothed + far.surface.normal * along;
    }

    Reflection look_in_mirror(size_t i, const DiffNeighbour* neighbours, size_t n, F32x4 unit, const DiffRow& own) {
        DiffSlice& s = slice_;
        Reflection reflection;
        reflection.axis = s.mirror_.axis;
        int32_t partner = s.partners_[i];
        if (partner < 0) return reflection;
        int agreeing = 0, differing = 0;
        size_t count = s.run_.end - s.run_.first;
        for (size_t k = 0; k < n; k++) {
            auto member = static_cast<size_t>(neighbours[k].member);
            if (member >= count) continue;
            agreeing += s.likenesses_[member] == Likeness::agrees;
            differing += s.likenesses_[member] == Likeness::differs;
        }
        int verdict = agreeing + differing == 0 ? 3 : differing > agreeing ? 0 : differing > 0 ? 1 : 2;
        F32x4 image = s.rows_[static_cast<size_t>(partner)].position;
        image[s.mirror_.axis] = static_cast<float>(2 * (s.mirror_.sum + 1)) - image[s.mirror_.axis];
        reflection.offset = (image - own.position) * unit;
        reflection.state = 1 + verdict + (reflection.offset[3] > 0 ? 4 : 0);
        return reflection;
    }

    void find_partners(float half) {
        DiffSlice& s = slice_;
        size_t count = s.run_.end - s.run_.first;
        float per_cell = 0.25f / half;
        CellTable table(s.budget_);
        table.reset(count);
        for (size_t i = 0; i < count; i++) {
            if (s.leaf_depths_[i] == NO_LEAF) continue;
            I32x4 cell = truncate(s.rows_[i].position * per_cell);
            table.put(static_cast<uint32_t>(cell[0]), static_cast<uint32_t>(cell[1]), static_cast<uint32_t>(cell[2]),
                      static_cast<uint32_t>(i));
        }
        int axis = s.mirror_.axis;
        auto plane = static_cast<float>(2 * (s.mirror_.sum + 1));
        for (size_t i = 0; i < count; i++) {
            if (s.leaf_depths_[i] >= depth_) continue;
            if (s.partners_[i] >= 0 && s.likenesses_[i] != Likeness::differs) continue;
            s.partners_[i] = NONE;
            F32x4 position = s.rows_[i].position;
            float image = plane - position[axis], nearest = 3.6f * half;
            I32x4 cell = truncate(position * per_cell);
            int middle = static_cast<int>(image * per_cell + 4) - 4;
            for (int k = middle - 1; k <= middle + 1; k++) {
                if (k < 0 || k >= 1 << (depth_ - 1)) continue;
                cell[axis] = k;
                int32_t found = table.find(static_cast<uint32_t>(cell[0]), static_cast<uint32_t>(cell[1]),
                                           static_cast<uint32_t>(cell[2]));
                if (found < 0 || static_cast<size_t>(found) == i) continue;
                float distance = s.rows_[static_cast<size_t>(found)].position[axis] - image;
                distance = distance < 0 ? -distance : distance;
                if (distance < nearest) {
                    nearest = distance;
                    s.partners_[i] = found;
                }
            }
        }
    }

    Coder& coder_;
    const Level& level_;
    int depth_;
    DiffSlice& slice_;
    DiffModel<effort>& model_;
    DiffTruth truth_;
};

template <Effort effort, class Coder>
void code_diff(Coder& coder, const Level& level, int depth, DiffSlice& slice, DiffModel<effort>& model,
               DiffTruth truth) {
    DiffPlane<effort, Coder>(coder, level, depth, slice, model, truth).code();
}

} // namespace meshtide::inline MESHTIDE_ISA
