// What a decision of the Diff is mixed from: contexts, numbers and neurons (docs/format.md, Diff).
//
// They are made for the three axes at once, one in each lane, and then transposed. Contexts come in groups of four. A
// context speaks of the direction that its guess points to: it has this guess' sign, and nothing in it depends on the
// sign otherwise.
#pragma once

#include "diff/mirror.hpp"
#include "diff/model.hpp"
#include "diff/surface.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// Integers of at most 15 bits in each lane.
MESHTIDE_INLINE I32x4 times(I32x4 a, int b) {
    return multiply_pairs(reinterpret_cast<I16x8>(a), reinterpret_cast<I16x8>(splat32(b)));
}
MESHTIDE_INLINE I32x4 least(I32x4 a, I32x4 b) {
    return reinterpret_cast<I32x4>(least(reinterpret_cast<I16x8>(a), reinterpret_cast<I16x8>(b)));
}
MESHTIDE_INLINE I32x4 least(I32x4 a, int b) { return least(a, splat32(b)); }
MESHTIDE_INLINE I32x4 greatest(I32x4 a, I32x4 b) {
    return reinterpret_cast<I32x4>(greatest(reinterpret_cast<I16x8>(a), reinterpret_cast<I16x8>(b)));
}
MESHTIDE_INLINE I32x4 choose(I32x4 mask, I32x4 a, I32x4 b) { return (a & mask) | (b & ~mask); }
MESHTIDE_INLINE I32x4 is_negative(F32x4 a) { return a < splat(0); }
MESHTIDE_INLINE F32x4 negated(F32x4 a, I32x4 mask) {
    return reinterpret_cast<F32x4>(reinterpret_cast<I32x4>(a) ^ (mask & splat32(INT32_MIN)));
}
MESHTIDE_INLINE I32x4 clamped(F32x4 a, float low, float high) {
    return truncate(greatest(least(a, splat(high)), splat(low)));
}

// A place in a table, by what it is made of, each with how many values it has; the first one counts most.
class Place {
public:
    MESHTIDE_INLINE Place& add(I32x4 value, int values) {
        places_ = times(places_, values) + value;
        return *this;
    }
    MESHTIDE_INLINE Place& add(int value, int values) { return add(splat32(value), values); }
    MESHTIDE_INLINE I32x4 operator+(int offset) const { return places_ + splat32(offset); }

private:
    I32x4 places_ = {};
};

// `count` classes of magnitudes, ever wider; half of them below `half`.
MESHTIDE_INLINE I32x4 magnitude_class(F32x4 a, int count, float half = 1) {
    F32x4 m = magnitude(a);
    return truncate(least(m * static_cast<float>(count) / (m + half), splat(static_cast<float>(count - 1))));
}
// 2 reach + 1 classes of half a half cell, the middle one around 0.
MESHTIDE_INLINE I32x4 step_class(F32x4 a, int reach) {
    auto r = static_cast<float>(reach);
    return clamped(a * 2.0f + (r + 0.5f), 0, 2 * r);
}
// Nine classes, ever wider to both sides of 0.
MESHTIDE_ONCE I32x4 signed_class(F32x4 a) {
    I32x4 distance = times(magnitude_class(a, 12), 6) >> 4; // 0 to 4
    return choose(is_negative(a), splat32(4) - distance, splat32(4) + distance);
}
MESHTIDE_INLINE I32x4 number(F32x4 a) { return clamped(a * 256.0f, -2047, 2047); }

// One group of four contexts: a lane for each axis, or, transposed, a vector for each axis with a lane for each
// context.
struct Group {
    I32x4 places[4], signs[4];

    MESHTIDE_INLINE void set(int which, I32x4 sign, I32x4 place) {
        signs[which] = sign;
        places[which] = place;
    }
};
MESHTIDE_ONCE void transpose(I32x4* rows) {
    auto a = reinterpret_cast<F32x4>(rows[0]), b = reinterpret_cast<F32x4>(rows[1]);
    auto c = reinterpret_cast<F32x4>(rows[2]), d = reinterpret_cast<F32x4>(rows[3]);
    transpose(a, b, c, d);
    rows[0] = reinterpret_cast<I32x4>(a), rows[1] = reinterpret_cast<I32x4>(b);
    rows[2] = reinterpret_cast<I32x4>(c), rows[3] = reinterpret_cast<I32x4>(d);
}
MESHTIDE_ONCE Group transposed(Group group) {
    transpose(group.places);
    transpose(group.signs);
    return group;
}

// Members beside the two coordinates that a bit can choose, as seen from a direction: at most `limit` of those on its
// side, and of those on the other.
struct Sides {
    I32x4 agreeing, opposing;
    MESHTIDE_INLINE Sides(I32x4 below, I32x4 above, I32x4 sign, int limit) {
        below = least(below, limit), above = least(above, limit);
        agreeing = choose(sign, below, above);
        opposing = choose(sign, above, below);
    }
};

// The questions about one owner. What depends on `plane` and `quadric` is made apart: effort high makes it anew for
// each axis, since the bits of the axes before have moved the vertex.
template <Effort effort>
class Asking {
public:
    using Shape = DiffShape<effort>;
    static constexpr auto high = IS_HIGH<effort>;
    static constexpr bool perhaps_high = effort != Effort::standard;

    MESHTIDE_INLINE Asking(const Surroundings& seen, const WideView& wide, const Reflection& reflection,
                           int mirror_axis, int age)
        : seen_(seen), wide_(wide), reflection_(reflection), mirror_axis_(mirror_axis), age_(age) {
        steep_ = truncate(magnitude(seen.normal) * 3.999f);
        if (high) slope_ = truncate(magnitude(wide.surface.normal) * 3.999f);
        set_experts();
        if constexpr (perhaps_high)
            if (high) {
                set_more();
                set_pairs();
            }
        set_numbers();
        set_neurons();
    }

    // Contexts 0, 1, 5 and those of the surface, and two of the numbers.
    MESHTIDE_INLINE void aim(F32x4 plane, F32x4 quadric) {
        Group group = first_;
        set_plane(group, plane);
        if (reflection_.state == 0)
            set_joint(group, plane);
        else
            set_mirrored(group);
        groups_[0] = transposed(group);
        numbers_[0] = number(plane);
        if constexpr (perhaps_high)
            if (high) {
                group = second_;
                set_across(group, plane);
                groups_[1] = transposed(group);
                set_surface(plane, quadric);
                numbers_[7] = number(quadric);
            }
        for (int k = 0; k < 8; k++) by_axis_[k] = numbers_[k];
        transpose(by_axis_);
        transpose(by_axis_ + 4);
    }

    MESHTIDE_INLINE void ask(int axis, typename DiffModel<effort>::DiffMixer::Question& question) const {
        for (int g = 0; g < Shape::groups; g++) {
            store(question.contexts + 4 * g, groups_[g].places[axis]);
            question.opposed[g] = pack(groups_[g].signs[axis], groups_[g].signs[axis]);
        }
        question.numbers = pack(by_axis_[axis], by_axis_[4 + axis]);
        for (int j = 0; j < DiffModel<effort>::DiffMixer::rows; j += 4) store(question.neurons + j, neurons_[j + axis]);
        question.final_neuron = static_cast<uint32_t>(seen_.rank[axis] * 8 + age_);
    }

private:
    static constexpr int place(int context) { return Shape::first_place(context); }

    MESHTIDE_INLINE void set_plane(Group& group, F32x4 plane) const {
        I32x4 alike = (plane * seen_.far_mean > splat(0)) & splat32(1);
        Place places;
        places.add(magnitude_class(plane, 12), 12).add(magnitude_class(seen_.far_mean, 10, 1.5f), 10).add(alike, 2);
        group.set(0, is_negative(plane), places.add(seen_.error_class >> 2, 6) + place(0));
    }
    MESHTIDE_INLINE void set_joint(Group& group, F32x4 plane) const {
        const Expert &midpoint = seen_.midpoint, &ring = seen_.in_ring;
        F32x4 guess = midpoint.trust != 0 ? midpoint.offset : ring.trust != 0 ? ring.offset : plane;
        I32x4 sign = is_negative(guess);
        Sides sides(seen_.below, seen_.above, sign, 3);
        Place places;
        places.add(sides.agreeing, 4).add(sides.opposing, 4).add(step_class(negated(plane, sign), 3), 7);
        places.add(magnitude_class(guess, 8), 8).add(midpoint.trust < 4 ? midpoint.trust : 4, 5);
        group.set(1, sign, places + place(1));
    }
    MESHTIDE_INLINE void set_mirrored(Group& group) const {
        F32x4 mirrored = reflection_.offset;
        I32x4 on_axis = (I32x4{0, 1, 2, 3} == splat32(mirror_axis_)) & splat32(1);
        Place places;
        places.add(clamped(magnitude(mirrored) * 2.0f + 0.5f, 0, 7), 8).add(reflection_.state, Reflection::STATES);
        group.set(1, is_negative(mirrored), places.add(on_axis, 2) + (place(1) + Shape::JOINT_PLACES));
    }

    MESHTIDE_INLINE void set_experts() {
        F32x4 ring = seen_.in_ring.offset, midpoint = seen_.midpoint.offset, across = seen_.across.offset;
        I32x4 sign = is_negative(ring);
        Sides sides(seen_.below, seen_.above, sign, 2);
        Place in_ring, all;
        in_ring.add(sides.agreeing, 3).add(sides.opposing, 3);
        first_.set(2, sign, in_ring.add(magnitude_class(ring, 16), 16).add(seen_.in_ring.trust, 8) + place(2));
        sign = is_negative(across);
        all.add(magnitude_class(across, 16), 16);
        all.add(step_class(negated(ring, sign), 3), 7).add(step_class(negated(midpoint, sign), 3), 7);
        first_.set(3, sign, all + place(3));
    }

    // How the members line up with the two coordinates, and what the midpoints say.
    MESHTIDE_INLINE void set_more() {
        I32x4 below = seen_.below, above = seen_.above;
        I32x4 sign = (above < below) | ((above == below) & is_negative(seen_.smoothed));
        I32x4 alike = (negated(seen_.smoothed, sign) > splat(0)) & splat32(1);
        Place aligned, alone, with_across;
        aligned.add(least(greatest(above, below), 4), 5).add(least(least(above, below), 3), 4);
        aligned.add(least(seen_.level, 2), 3).add(magnitude_class(seen_.smoothed, 4), 4).add(alike, 2);
        second_.set(0, sign, aligned + place(4));
        F32x4 midpoint = seen_.midpoint.offset;
        sign = is_negative(midpoint);
        alone.add(magnitude_class(midpoint, 16), 16).add(seen_.midpoint.trust, 8);
        second_.set(2, sign, alone.add(steep_, 4).add(seen_.known_class, 4) + place(6));
        with_across.add(magnitude_class(midpoint, 12), 12).add(step_class(negated(seen_.across_mean, sign), 4), 9);
        second_.set(3, sign, with_across.add(age_, 8).add(seen_.midpoint.trust, 8) + place(7));
    }
    MESHTIDE_INLINE void set_across(Group& group, F32x4 plane) const {
        F32x4 across = seen_.across.offset;
        I32x4 sign = is_negative(across), ahead = clamped(negated(plane, sign) * 2.0f + 2.5f, 0, 4);
        Sides sides(seen_.below, seen_.above, sign, 2);
        Place places;
        places.add(magnitude_class(across, 10), 10).add(seen_.across.trust, 8);
        group.set(1, sign, places.add(sides.agreeing, 3).add(sides.opposing, 3).add(ahead, 5) + place(5));
    }
    MESHTIDE_INLINE void set_surface(F32x4 plane, F32x4 quadric) {
        I32x4 sign = is_negative(quadric), below = wide_.below, above = wide_.above;
        Group group;
        Place alone, with_others;
        alone.add(magnitude_class(quadric, 24), 24).add(slope_, 4).add(wide_.surface_class, ERROR_CLASSES);
        group.set(0, sign, alone + place(8));
        with_others.add(magnitude_class(quadric, 12), 12).add(step_class(negated(plane, sign), 4), 9);
        with_others.add(step_class(negated(seen_.midpoint.offset, sign), 4), 9).add(slope_, 4);
        group.set(1, sign, with_others + place(9));

        I32x4 aligned_sign = (above < below) | ((above == below) & sign);
        I32x4 nearing = (negated(quadric, aligned_sign) > splat(0)) & magnitude_class(quadric, 4);
        Sides sides(seen_.below, seen_.above, aligned_sign, 2);
        Place aligned;
        aligned.add(least(greatest(above, below), 4), 5).add(least(least(above, below), 4), 5);
        aligned.add(sides.agreeing, 3).add(sides.opposing, 3).add(nearing, 4);
        group.set(2, aligned_sign, aligned + place(10));

        F32x4 across = seen_.across.offset;
        sign = is_negative(across);
        Place with_across;
        with_across.add(magnitude_class(across, 16), 16);
        with_across.add(signed_class(negated(quadric, sign)), 9)
            .add(signed_class(negated(wide_.pairs.offset, sign)), 9);
        group.set(3, sign, with_across + place(11));
        groups_[2] = transposed(group);
    }
    MESHTIDE_INLINE void set_pairs() {
        F32x4 pairs = wide_.pairs.offset, ring = seen_.in_ring.offset;
        I32x4 sign = is_negative(pairs), ring_sign = is_negative(ring), far_sign = is_negative(seen_.far_mean);
        Group group;
        Place alone, with_ring, in_ring, far;
        alone.add(magnitude_class(pairs, 16), 16).add(wide_.pairs.trust, 8);
        group.set(0, sign, alone.add(slope_, 4).add(seen_.known_class, 4) + place(12));
        with_ring.add(magnitude_class(pairs, 12), 12).add(signed_class(negated(ring, sign)), 9);
        group.set(1, sign, with_ring.add(age_, 8).add(seen_.midpoint.trust, 8) + place(13));
        in_ring.add(magnitude_class(ring, 16), 16).add(seen_.in_ring.trust, 8);
        group.set(2, ring_sign, in_ring.add(steep_, 4).add(seen_.known_class, 4) + place(14));
        far.add(magnitude_class(seen_.far_mean, 12), 12).add(step_class(negated(seen_.across_mean, far_sign), 4), 9);
        group.set(3, far_sign, far.add(steep_, 4).add(seen_.known_class, 4) + place(15));
        groups_[3] = transposed(group);
    }

    // numbers_[0], and at effort high numbers_[7], are set by aim().
    MESHTIDE_INLINE void set_numbers() {
        numbers_[1] = number(seen_.far_mean);
        numbers_[2] = number(seen_.across_mean);
        numbers_[3] = number(seen_.across_spread);
        numbers_[4] = number(seen_.midpoint.offset);
        numbers_[5] = number(seen_.across.offset);
        numbers_[6] = number(high && reflection_.state == 0 ? wide_.pairs.offset : reflection_.offset);
        numbers_[7] = number(seen_.smoothed);
    }

    MESHTIDE_INLINE void set_neurons() {
        I32x4 below = least(seen_.below, 2), above = least(seen_.above, 2);
        Place by_alignment;
        by_alignment.add(reflection_.state, Reflection::STATES).add(above, 3).add(below, 3);
        neurons_[0] = splat32(seen_.error_class * 4 + seen_.known_class + Shape::first_neuron(0));
        neurons_[1] = by_alignment + Shape::first_neuron(1);
        neurons_[2] = neurons_[3] = splat32(0);
        if constexpr (perhaps_high)
            if (high) {
                int members = seen_.ring.count < 15 ? seen_.ring.count : 15;
                neurons_[2] = splat32(seen_.in_ring.trust * 8 + seen_.midpoint.trust + Shape::first_neuron(2));
                neurons_[3] = seen_.rank + splat32(members * 3 + Shape::first_neuron(3));
                int trust = reflection_.state == 0 ? 0 : reflection_.state >= Reflection::TRUSTED ? 2 : 1;
                Place by_age, by_far;
                by_age.add(seen_.rank, 3).add(age_, 8).add(trust, 3);
                by_far.add(least(wide_.below, 4), 5).add(least(wide_.above, 4), 5).add(seen_.rank, 3);
                neurons_[4] = by_age + Shape::first_neuron(4);
                neurons_[5] = slope_ + splat32(wide_.surface_class * 4 + Shape::first_neuron(5));
                neurons_[6] = splat32(wide_.pairs.trust * 8 + seen_.across.trust + Shape::first_neuron(6));
                neurons_[7] = by_far + Shape::first_neuron(7);
                transpose(neurons_ + 4);
            }
        transpose(neurons_);
    }

    const Surroundings& seen_;
    const WideView& wide_;
    const Reflection& reflection_;
    int mirror_axis_, age_;
    I32x4 steep_, slope_ = {};       // classes of the normals' components
    Group first_ = {}, second_ = {}; // not transposed, what does not depend on the plane
    Group groups_[Shape::most_groups];
    I32x4 numbers_[8], by_axis_[8], neurons_[DiffModel<effort>::DiffMixer::most_rows];
};

} // namespace meshtide::inline MESHTIDE_ISA
