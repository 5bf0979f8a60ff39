// The encoder's choice of the display filter's strengths. All of them are tried at once: the lanes of a vector are
// strengths, and the rings are gone through twice only, since K x is the same for all of them. In floats.
#include "surface/display_filter.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

// The first step has eight strengths but 0, in two vectors; the second step gives four vectors, of which the first
// and the third go on from the lanes as they are, the others from some of them.
constexpr F32x4 SMOOTHING[2] = {{13, 26, 38, 64}, {77, 96, 115, 51}};
constexpr F32x4 SHARPENING[4] = {{13, 26, 26, 26}, {38, 51, 64, 0}, {51, 51, 64, 0}, {64, 64, 0, 0}};
// Which of STRENGTHS each lane of the second step is: f = 13 26 38 64, 64 64 64 0, 77 96 115 51, 77 96 96 115.
constexpr uint8_t NAMES[4][4] = {{1, 2, 3, 5}, {6, 7, 8, 0}, {9, 12, 15, 4}, {10, 13, 11, 14}};

constexpr size_t RUN = 128; // faces one after the other whose costs are summed up in floats
// Faces of a level that are enough to look at: of more, every second run, every third, ...
constexpr size_t FACES = 10000;

// What a vertex is needed for: to be drawn, or as the neighbour of one that is.
enum Need : uint8_t { NOTHING, NEIGHBOUR, CORNER };

struct Smoothed {
    F32x4 along[3][2]; // of each axis, by SMOOTHING
};
struct Apart {
    F32x4 of[4]; // distance from the plane, by SHARPENING
};
// The true surface near a vertex, as a plane.
struct Plane {
    float point[3], normal[3];
};

MESHTIDE_INLINE F32x4 clamp_lanes(F32x4 value, F32x4 middle, F32x4 side) {
    return least(greatest(value, middle - side), middle + side);
}

class Chooser {
public:
    Chooser(const Octree& octree, Budget& budget)
        : octree_(octree), budget_(budget), normals_(budget), middles_(budget), planes_(budget), smoothed_(budget),
          apart_(budget), rings_(budget), needs_(budget) {
        // Area-weighted normals of the finest vertices.
        normals_.assign(octree.positions.size() / 3, splat(0.0f));
        const Array<int32_t>& faces = octree.depths.back().faces;
        for (size_t t = 0; t + 2 < faces.size(); t += 3) {
            F32x4 a = finest(faces[t]), b = finest(faces[t + 1]), c = finest(faces[t + 2]);
            F32x4 normal = cross3(b - a, c - a);
            for (size_t k = 0; k < 3; k++) {
                F32x4& at = normals_[static_cast<size_t>(faces[t + k])];
                at = at + normal;
            }
        }
    }

    uint8_t choose(int depth) {
        const Octree::Depth& level = octree_.at(depth);
        if (level.faces.empty() || depth == octree_.bits) return 0;
        // Levels of as many vertices have the same faces.
        if (rings_.vertex_count() != level.cell_count() || members_of_ != level.faces.size()) {
            order_rings(level.faces.span(), level.cell_count(), rings_, budget_);
            members_of_ = level.faces.size();
            find_needs(level.faces.span());
        }
        find_planes(level, octree_.bits - depth);
        auto side = static_cast<float>(1 << (octree_.bits - depth));
        smooth(side);
        sharpen(side);
        return best(level.faces.span());
    }

private:
    F32x4 finest(int32_t vertex) const {
        const int32_t* at = octree_.positions.block(3 * static_cast<size_t>(vertex), 3);
        return F32x4{static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2]), 0.0f};
    }

    // Calls run(first, end) for all that are looked at: places in `faces`.
    template <class Run>
    static void each_run(Span<const int32_t> faces, Run run) {
        size_t stride = 1 + (faces.size() / 3 - 1) / FACES;
        for (size_t first = 0; first < faces.size(); first += 3 * RUN * stride)
            run(first, std::min(first + 3 * RUN, faces.size()));
    }
    void find_needs(Span<const int32_t> faces) {
        needs_.assign(rings_.vertex_count(), NOTHING);
        each_run(faces, [&](size_t first, size_t end) {
            for (size_t i = first; i < end; i++) needs_[static_cast<size_t>(faces[i])] = CORNER;
        });
        for (size_t v = 0; v < needs_.size(); v++) {
            if (needs_[v] != CORNER) continue;
            for (size_t i = rings_.starts[v]; i < rings_.starts[v + 1]; i++) {
                uint8_t& need = needs_[static_cast<size_t>(rings_.members[i])];
                if (need == NOTHING) need = NEIGHBOUR;
            }
        }
    }

    void find_planes(const Octree::Depth& level, int shift) {
        size_t n = level.cell_count();
        middles_.resize(n);
        planes_.resize(n);
        for (size_t v = 0; v < n; v++) {
            const int32_t* at = octree_.positions.block(3 * static_cast<size_t>(level.first[v]), 3);
            for (size_t k = 0; k < 3; k++) middles_[v][k] = static_cast<float>((2 * (at[k] >> shift) + 1) << shift);
            middles_[v][3] = 0.0f;
            if (needs_[v] != CORNER) continue;
            F32x4 point = splat(0.0f), normal = splat(0.0f);
            for (size_t i = level.first[v]; i < level.first[v + 1]; i++) {
                point = point + finest(static_cast<int32_t>(i));
                normal = normal + normals_[i];
            }
            float size = std::sqrt(dot3(normal, normal));
            if (size > 0.0f) normal = normal / splat(size);
            point = point * splat(2.0f / static_cast<float>(level.first[v + 1] - level.first[v])) + splat(1.0f);
            for (size_t k = 0; k < 3; k++) {
                planes_[v].point[k] = point[k];
                planes_[v].normal[k] = normal[k];
            }
        }
    }

    void smooth(float side) {
        smoothed_.resize(middles_.size());
        for (size_t v = 0; v < middles_.size(); v++) {
            if (needs_[v] == NOTHING) continue;
            size_t first = rings_.starts[v], last = rings_.starts[v + 1];
            F32x4 total = splat(0.0f), middle = middles_[v];
            for (size_t i = first; i < last; i++) total = total + middles_[static_cast<size_t>(rings_.members[i])];
            F32x4 off = splat(0.0f);
            if (last > first) off = (middle - total / splat(static_cast<float>(last - first))) * splat(1.0f / 128);
            for (size_t k = 0; k < 3; k++)
                for (size_t i = 0; i < 2; i++)
                    smoothed_[v].along[k][i] =
                        clamp_lanes(splat(middle[k]) - SMOOTHING[i] * splat(off[k]), splat(middle[k]), splat(side));
        }
    }

    void sharpen(float side) {
        apart_.resize(middles_.size());
        for (size_t v = 0; v < middles_.size(); v++) {
            if (needs_[v] != CORNER) continue;
            size_t first = rings_.starts[v], last = rings_.starts[v + 1];
            Smoothed total{};
            for (size_t i = first; i < last; i++) {
                const Smoothed& member = smoothed_[static_cast<size_t>(rings_.members[i])];
                for (size_t k = 0; k < 3; k++)
                    for (size_t j = 0; j < 2; j++) total.along[k][j] = total.along[k][j] + member.along[k][j];
            }
            F32x4 share = splat(last > first ? 1.0f / static_cast<float>(last - first) : 0.0f);
            F32x4 unit = splat(last > first ? 1.0f / 128 : 0.0f);
            Apart apart{};
            for (size_t k = 0; k < 3; k++) {
                F32x4 middle = splat(middles_[v][k]), limit = splat(side);
                const F32x4(&at)[2] = smoothed_[v].along[k];
                F32x4 off[2];
                for (size_t j = 0; j < 2; j++) off[j] = (at[j] - total.along[k][j] * share) * unit;
                F32x4 from[4] = {at[0], __builtin_shufflevector(at[0], middle, 3, 3, 3, 4), at[1],
                                 __builtin_shufflevector(at[1], at[1], 0, 1, 1, 2)};
                F32x4 by[4] = {off[0], __builtin_shufflevector(off[0], off[0], 3, 3, 3, 3), off[1],
                               __builtin_shufflevector(off[1], off[1], 0, 1, 1, 2)};
                for (size_t g = 0; g < 4; g++) {
                    F32x4 drawn = clamp_lanes(from[g] + SHARPENING[g] * by[g], middle, limit);
                    apart.of[g] = apart.of[g] + (drawn - splat(planes_[v].point[k])) * splat(planes_[v].normal[k]);
                }
            }
            apart_[v] = apart;
        }
    }

    // Sum over faces of area times the square of how far the middle is off, on average of its corners.
    uint8_t best(Span<const int32_t> faces) const {
        double costs[4][4] = {};
        each_run(faces, [&](size_t start, size_t end) {
            F32x4 sums[4] = {};
            for (size_t t = start; t < end; t += 3) {
                auto a = static_cast<size_t>(faces[t]), b = static_cast<size_t>(faces[t + 1]);
                auto c = static_cast<size_t>(faces[t + 2]);
                auto point = [&](size_t v) {
                    return F32x4{planes_[v].point[0], planes_[v].point[1], planes_[v].point[2], 0.0f};
                };
                F32x4 normal = cross3(point(b) - point(a), point(c) - point(a));
                F32x4 area = splat(std::sqrt(dot3(normal, normal)));
                for (size_t g = 0; g < 4; g++) {
                    F32x4 mean = apart_[a].of[g] + apart_[b].of[g] + apart_[c].of[g];
                    sums[g] = sums[g] + area * mean * mean;
                }
            }
            for (size_t g = 0; g < 4; g++)
                for (size_t lane = 0; lane < 4; lane++) costs[g][lane] += static_cast<double>(sums[g][lane]);
        });
        uint8_t best = STRENGTH_COUNT;
        double least_cost = 0.0;
        for (size_t g = 0; g < 4; g++) {
            for (size_t lane = 0; lane < 4; lane++) {
                uint8_t name = NAMES[g][lane];
                double cost = costs[g][lane];
                if (best < STRENGTH_COUNT && !(cost < least_cost || (cost == least_cost && name < best))) continue;
                best = name;
                least_cost = cost;
            }
        }
        return best;
    }

    const Octree& octree_;
    Budget& budget_;
    Array<F32x4> normals_; // of the finest vertices
    Array<F32x4> middles_; // of the level's cells, in half finest steps
    Array<Plane> planes_;
    Array<Smoothed> smoothed_;
    Array<Apart> apart_;
    Rings rings_;
    Array<uint8_t> needs_;
    size_t members_of_ = 0;
};

} // namespace

void choose_strengths(const Octree& octree, int first, Array<uint8_t>& chosen, Budget& budget) {
    Chooser chooser(octree, budget);
    chosen.clear();
    for (int depth = first; depth <= octree.bits; depth++) chosen.push(chooser.choose(depth));
}

} // namespace meshtide::inline MESHTIDE_ISA
