#include "surface/previews.hpp"

#include "mesh/morton.hpp"
#include "surface/logarithms.hpp"
#include "surface/sorting.hpp"

#include <algorithm>
#include <bit>
#include <memory>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr size_t FEWEST_VERTICES = 2000; // meshes of fewer have no previews: their levels take no longer to arrive
constexpr size_t FEWEST_PREVIEW_VERTICES = 8;
constexpr int FEWEST_BITS = 4;
constexpr double TANGLED = 150; // nodes visited for a point: a surface takes about 10 to 30, a fan of 20 000 slivers 75
constexpr double STEP_PER_DISTANCE = 6.5; // longest step of a preview's grid, in root mean square distances of the fit
constexpr double LARGEST_EXCESS = 1.5;    // vertices against those wanted: some meshes cannot be simplified that far
constexpr double OCTREE_DISTANCE = 0.35;  // root mean square distance that an octree level shows, in sides of its cells

// Root mean square distances to show early, in diagonals; beyond, the octree's levels are there about as soon.
constexpr double DISTANCES[] = {1e-2, 3e-3, 1e-3, 4e-4};
// Vertices of the mesh for one of a preview: steps of an eighth, as fine as the bytes of a preview matter.
constexpr double FINEST_RATIO = 18, STEP = 1.12;
constexpr size_t STEPS = 42;
// Meshes of more than LARGE vertices have no finer preview than this: together at most 6 % of the stream.
constexpr size_t LARGE = 20000, LARGE_RATIO = 40;
// Nor has any mesh for the last distance, which only shapes of flat faces reach so early.
constexpr size_t LAST_RATIO = 28;

constexpr double MARGIN = 0.98;          // of a distance: what is measured with other samples differs by so much
constexpr double SHARE_OF_FIT = 0.85;    // of a distance: the fit's, where the grid is as coarse as it should be
constexpr double ROUNDING = 0.12;        // what rounding adds, in steps of the preview's grid,
constexpr double COARSE_ROUNDING = 0.15; // and on grids of FEW_BITS, where vertices meet and shapes get lost
constexpr double LEAST_SHARE = 0.4;      // of a distance that is left to the fit, however coarse the grid is
constexpr double TOO_FAR = 1.03;         // distances at which a fit's preview is expected that is not tried
constexpr double HOPELESS = 1.3; // distances by which a guess of the finest preview misses one that it is not tried for
constexpr size_t FIRST_GUESS = 60; // vertices of the first mesh that is fitted
constexpr double SLOPE = 0.85;     // how fast distances grow with ratios, on logarithmic scales
// Previews of so few bits are tried with one more too, but for those of large meshes, for which it matters less and
// takes longer.
constexpr int FEW_BITS = 5;

constexpr size_t SAMPLES = 2000;
constexpr uint64_t SEED = 3;
constexpr size_t TOO_SMALL_TO_WAIT = 40; // vertices of a preview, about 80 bytes, which needs no coarser one before it

double grid_steps(int bits) { return static_cast<double>((1 << bits) - 1); }

// Depth of the coarsest grid that suits a fit which is `distance` steps of the grid of depth `bits` away.
int grid_bits(double distance, int bits) {
    int depth = FEWEST_BITS;
    while (depth < bits && grid_steps(bits) / grid_steps(depth) > STEP_PER_DISTANCE * distance) depth++;
    return std::min(depth, bits);
}

bool is_large(const GridMesh& mesh) { return mesh.positions.size() / 3 > LARGE; }

// Of the meshes that are tried, finest first.
std::vector<size_t> ratios_of(const GridMesh& mesh) {
    std::vector<size_t> ratios;
    size_t n = mesh.positions.size() / 3;
    if (n < FEWEST_VERTICES) return ratios;
    double ratio = FINEST_RATIO;
    for (size_t step = 0; step <= STEPS; step++, ratio *= STEP) {
        auto rounded_ratio = static_cast<size_t>(ratio + 0.5);
        if (is_large(mesh) && rounded_ratio < LARGE_RATIO) continue;
        if (n / rounded_ratio < FEWEST_PREVIEW_VERTICES) break;
        ratios.push_back(rounded_ratio);
    }
    return ratios;
}

// A mesh whose previews are asked for, and what of it all of them need.
struct Original {
    // `finest`: vertices of the finest preview.
    Original(const GridMesh& mesh_, size_t finest, Budget& budget_)
        : mesh(mesh_), budget(budget_), simplifier(mesh.positions, mesh.faces, mesh.bits, finest, budget),
          surface(budget) {
        for (size_t i = 0; i < vertex_count(); i++) {
            uint32_t differing = 0;
            for (size_t k = 0; k < 3 && i > 0; k++)
                differing |= static_cast<uint32_t>(mesh.positions[3 * i + k] ^ mesh.positions[3 * i - 3 + k]);
            cells[i > 0 ? std::clamp(mesh.bits - 31 + std::countl_zero(differing), 0, 31) : 0]++;
        }
        for (int depth = 1; depth < 32; depth++) cells[depth] += cells[depth - 1];
        simplifier.reduce(vertex_count(), surface);
        if (surface.faces.empty()) return;
        tree = std::make_unique<ClosestPoints>(surface.surface(), budget);
        find_lost();
    }
    size_t vertex_count() const { return mesh.positions.size() / 3; }
    // The mesh with about 1 / ratio of its vertices; false if it cannot be simplified so far. Ratios rise.
    bool simplify(size_t ratio, TriangleMesh& simplified) {
        size_t target = vertex_count() / ratio;
        simplifier.reduce(target, simplified);
        return !simplified.faces.empty() &&
               static_cast<double>(simplified.vertices.size()) <= LARGEST_EXCESS * static_cast<double>(target);
    }
    // Whether searches take reasonable time: a tangle of large triangles has no previews.
    bool can_be_searched() const {
        if (!tree) return false;
        CurvePoints some(budget);
        tree->sampled(1000, 0, some, budget);
        return tree->visits_per_search(some.at.span()) <= TANGLED;
    }
    // Root mean square distance from the mesh of what is so far from its clusters, as far as that is known.
    double with_lost(double mean_square) const { return std::sqrt(mean_square + lost); }
    // Side of the cells, in grid steps, of the octree's first level of at least `count` cells.
    double cell_side(size_t count) const {
        int depth = 0;
        while (depth < mesh.bits && cells[depth] < count) depth++;
        return static_cast<double>(1 << (mesh.bits - depth));
    }

    void find_lost() {
        size_t n = vertex_count(), stride = n / SAMPLES + 1, count = 0, hint = 0;
        for (size_t v = 0; v < n; v += stride, count++) {
            const int32_t* at = mesh.positions.block(3 * v, 3);
            Closest found = tree->closest(
                {static_cast<double>(at[0]), static_cast<double>(at[1]), static_cast<double>(at[2])}, hint);
            lost += found.squared;
            hint = static_cast<size_t>(found.foot.face);
        }
        lost /= static_cast<double>(count);
    }

    GridMesh mesh;
    Budget& budget;
    Simplifier simplifier;
    // Clusters, as they are before the first collapse: distances from them are found much faster than from the mesh.
    TriangleMesh surface;
    std::unique_ptr<ClosestPoints> tree; // of that, unless it has no faces
    double lost = 0;                     // mean square distance of the mesh's vertices from it
    size_t cells[32] = {};               // of each depth, or fewer
};

// A simplified mesh whose vertices have been moved to the original surface.
struct Fit {
    Fit(const Original& original, const TriangleMesh& mesh)
        : refitter(*original.tree, mesh.faces.span(), mesh.vertices.size(), original.budget),
          vertices(original.budget) {
        vertices.copy(mesh.vertices.span());
        refitter.fit(vertices.span());
        double apart = refitter.distance(vertices.span());
        distance = original.with_lost(apart * apart);
        shows_more = distance <= OCTREE_DISTANCE * original.cell_side(vertices.size());
    }
    Refitter refitter;
    Array<Vector> vertices;
    double distance;
    bool shows_more; // than an octree level of as many vertices
};

// Vertices on the grid in Morton order, those that meet made one, those without faces left out.
void weld(Span<const int32_t> grid, Span<const int32_t> faces, Preview& preview, Budget& budget) {
    Array<Keyed> keys(budget);
    Array<int32_t> owners(budget), firsts(budget), used(budget);
    auto coordinate = [&](size_t v, size_t k) { return static_cast<uint32_t>(grid[3 * v + k]); };
    size_t n = grid.size() / 3;
    for (size_t v = 0; v < n; v++)
        keys.push({morton_code(coordinate(v, 0), coordinate(v, 1), coordinate(v, 2)), static_cast<uint32_t>(v)});
    sort_keyed(keys, 3 * preview.bits, budget);
    owners.resize(n);
    for (size_t i = 0; i < n; i++) {
        if (i == 0 || keys[i].key != keys[i - 1].key) firsts.push(static_cast<int32_t>(keys[i].place));
        owners[keys[i].place] = static_cast<int32_t>(firsts.size() - 1);
    }
    preview.faces.clear();
    for (int32_t v : faces) preview.faces.push(owners[static_cast<size_t>(v)]);
    canonical_faces(preview.faces, firsts.size(), budget);
    drop_unused(preview.faces, firsts.size(), used, budget);
    preview.positions.clear();
    for (int32_t v : used)
        for (size_t k = 0; k < 3; k++)
            preview.positions.push(grid[3 * static_cast<size_t>(firsts[static_cast<size_t>(v)]) + k]);
}

// A fit on a grid of depth `bits`; without faces where none are left of it.
Preview rounded(const Original& original, Fit& fit, const TriangleMesh& mesh, int bits) {
    Preview preview(original.budget);
    preview.bits = bits;
    Array<int32_t> grid(original.budget);
    double step = grid_steps(original.mesh.bits) / grid_steps(bits);
    fit.refitter.round(fit.vertices.span(), step, (1 << bits) - 1, grid);
    weld(grid.span(), mesh.faces.span(), preview, original.budget);
    return preview;
}

// The simplified meshes of all ratios, coarsest first; each is fitted and measured when it is asked for.
class Candidates {
public:
    struct Found {
        size_t place;
        Preview preview;
        double distance;
    };

    // ratios: those of the meshes, finest first.
    Candidates(Original& original, const std::vector<size_t>& ratios, const PreviewSize& size)
        : original_(original), size_(size), samples_(original.budget) {
        original.tree->sampled(SAMPLES, SEED, samples_, original.budget);
        for (size_t ratio : ratios) {
            TriangleMesh mesh(original.budget);
            if (!original.simplify(ratio, mesh)) break;
            meshes_.push_back({ratio, std::move(mesh), nullptr, {}});
        }
        std::reverse(meshes_.begin(), meshes_.end());
    }

    // The smallest preview within `distance`; none that is coarser than the one at `first`, or of a ratio below
    // `finest`.
    std::unique_ptr<Found> smallest_within(double distance, size_t first, size_t finest) {
        int bits = grid_bits(SHARE_OF_FIT * distance, original_.mesh.bits);
        bool thorough = bits <= FEW_BITS && !is_large(original_.mesh);
        std::vector<Found> found;
        for (int depth : {bits, std::min(bits + 1, original_.mesh.bits)}) {
            size_t place = coarsest_within(distance, depth, first, finest);
            if (place >= meshes_.size()) continue;
            const Measured& measured = measure(place, depth, distance);
            if (measured.distance <= distance) found.push_back({place, copy(measured.preview), measured.distance});
            if (!thorough) break;
        }
        if (found.empty()) return nullptr;
        size_t best = 0, best_size = found.size() > 1 ? size_(found[0].preview) : 0;
        for (size_t i = 1; i < found.size(); i++) {
            size_t bytes = size_(found[i].preview);
            if (bytes < best_size) best = i, best_size = bytes;
        }
        return std::make_unique<Found>(std::move(found[best]));
    }

private:
    struct Measured {
        int bits;
        Preview preview;
        double distance; // in grid steps of the mesh
    };
    struct Candidate {
        size_t ratio;
        TriangleMesh mesh;
        std::unique_ptr<Fit> fit;
        std::vector<Measured> measured;
    };

    Preview copy(const Preview& preview) const {
        Preview made(original_.budget);
        made.bits = preview.bits;
        made.positions.copy(preview.positions.span());
        made.faces.copy(preview.faces.span());
        return made;
    }

    // The coarsest place from `first` on whose preview of so many bits is within the distance; behind the last if none.
    size_t coarsest_within(double distance, int bits, size_t first, size_t finest) {
        size_t end = 0;
        while (end < meshes_.size() && meshes_[end].ratio >= finest) end++;
        bool fitted = std::any_of(meshes_.begin(), meshes_.end(),
                                  [](const Candidate& one) { return one.fit != nullptr && one.fit->shows_more; });
        if (fitted && guess(HOPELESS * distance, bits) >= end) return meshes_.size();
        size_t low = first, high = end;
        while (low < high) {
            size_t expected = guess(distance, bits);
            // What is at `high` is within the distance, and nothing coarser is expected to be.
            if (high < end && expected >= high) return high;
            size_t place = std::min(std::max(expected, low), high - 1);
            if (measure(place, bits, distance).distance <= distance)
                high = place;
            else
                low = place + 1;
        }
        return low < end ? low : meshes_.size();
    }

    // What rounding to a grid of `bits` bits adds to the square of a distance, as its root.
    double rounding_of(int bits) const {
        return (bits > FEW_BITS ? ROUNDING : COARSE_ROUNDING) * grid_steps(original_.mesh.bits) / grid_steps(bits);
    }

    // The coarsest place whose preview may be within the distance: by the fit that is nearest to it. The distance of a
    // fit falls as its vertices rise; what rounding adds to its square does not.
    size_t guess(double distance, int bits) const {
        double rounding = rounding_of(bits);
        double least = LEAST_SHARE * distance;
        double wanted =
            natural_logarithm(std::sqrt(std::max(distance * distance - rounding * rounding, least * least)));
        struct Known {
            double apart, distance, ratio;
        };
        std::vector<Known> known;
        for (const Candidate& one : meshes_) {
            if (one.fit == nullptr || !one.fit->shows_more || !(one.fit->distance > 0.0)) continue;
            double far = natural_logarithm(one.fit->distance);
            known.push_back({std::abs(wanted - far), far, natural_logarithm(static_cast<double>(one.ratio))});
        }
        auto count_if = [&](auto condition) {
            return static_cast<size_t>(std::count_if(meshes_.begin(), meshes_.end(), condition));
        };
        if (known.empty()) return count_if([](const Candidate& one) { return one.mesh.vertices.size() < FIRST_GUESS; });
        std::sort(known.begin(), known.end(), [](const Known& a, const Known& b) {
            return a.apart != b.apart ? a.apart < b.apart : a.distance < b.distance;
        });
        double slope = SLOPE;
        for (const Known& other : known) {
            double between = known[0].ratio - other.ratio;
            if (std::abs(between) <= 0.5) continue;
            slope = (known[0].distance - other.distance) / between;
            break;
        }
        slope = std::clamp(slope, SLOPE / 2, 2 * SLOPE);
        double ratio = exponential(known[0].ratio + (wanted - known[0].distance) / slope);
        return count_if([&](const Candidate& one) { return static_cast<double>(one.ratio) > ratio; });
    }

    // The preview at a place on a grid of `bits` bits and its distance: infinity if it shows no more than an octree
    // level of as many vertices, or is not expected to be within `wanted`.
    const Measured& measure(size_t place, int bits, double wanted) {
        Candidate& one = meshes_[place];
        if (one.fit == nullptr) one.fit = std::make_unique<Fit>(original_, one.mesh);
        double fit = one.fit->distance, rounding = rounding_of(bits), limit = TOO_FAR * wanted;
        if (!one.fit->shows_more || fit > wanted || fit * fit + rounding * rounding > limit * limit) return hopeless_;
        for (const Measured& known : one.measured)
            if (known.bits == bits) return known;
        Measured measured{bits, rounded(original_, *one.fit, one.mesh, bits), INFINITY};
        if (!measured.preview.faces.empty()) measured.distance = distance_of(measured.preview);
        one.measured.push_back(std::move(measured));
        return one.measured.back();
    }

    double distance_of(const Preview& preview) const {
        Array<Vector> vertices(original_.budget);
        CurvePoints points(original_.budget);
        double step = grid_steps(original_.mesh.bits) / grid_steps(preview.bits);
        for (size_t i = 0; i < preview.positions.size(); i += 3)
            vertices.push(Vector{static_cast<double>(preview.positions[i]),
                                 static_cast<double>(preview.positions[i + 1]),
                                 static_cast<double>(preview.positions[i + 2])} *
                          step);
        ClosestPoints tree({vertices.span(), preview.faces.span()}, original_.budget, original_.tree.get());
        tree.sampled(SAMPLES, SEED + 1, points, original_.budget);
        return original_.with_lost(std::max(tree.spread(samples_).mean, original_.tree->spread(points).mean));
    }

    const Original& original_;
    const PreviewSize& size_;
    CurvePoints samples_;
    std::vector<Candidate> meshes_;
    Measured hopeless_{0, Preview(original_.budget), INFINITY};
};

} // namespace

std::vector<Preview> choose_previews(const GridMesh& mesh, const PreviewSize& size, Budget& budget) {
    std::vector<Preview> previews;
    std::vector<size_t> ratios = ratios_of(mesh);
    if (ratios.empty() || mesh.faces.size() == 0) return previews;
    Original original(mesh, mesh.positions.size() / 3 / ratios[0], budget);
    if (!original.can_be_searched()) return previews;
    Candidates candidates(original, ratios, size);
    int32_t low[3] = {INT32_MAX, INT32_MAX, INT32_MAX}, high[3] = {};
    for (size_t i = 0; i < mesh.positions.size(); i++) {
        low[i % 3] = std::min(low[i % 3], mesh.positions[i]);
        high[i % 3] = std::max(high[i % 3], mesh.positions[i]);
    }
    Vector sides{static_cast<double>(high[0] - low[0]), static_cast<double>(high[1] - low[1]),
                 static_cast<double>(high[2] - low[2])};
    double diagonal = length(sides), reached = INFINITY;
    size_t place = 0;
    for (double wanted : DISTANCES) {
        double distance = MARGIN * wanted * diagonal;
        if (reached <= distance) continue;
        size_t finest = ratios[0];
        if (wanted == DISTANCES[std::size(DISTANCES) - 1]) finest = std::max(finest, LAST_RATIO);
        std::unique_ptr<Candidates::Found> found = candidates.smallest_within(distance, place, finest);
        if (found == nullptr) continue;
        place = found->place, reached = found->distance;
        if (!previews.empty() && found->preview.vertex_count() <= TOO_SMALL_TO_WAIT) previews.pop_back();
        previews.push_back(std::move(found->preview));
    }
    return previews;
}

std::vector<Preview> make_previews(const GridMesh& mesh, std::vector<size_t> ratios, Budget& budget) {
    std::vector<Preview> previews;
    std::sort(ratios.begin(), ratios.end());
    ratios.erase(std::unique(ratios.begin(), ratios.end()), ratios.end());
    size_t n = mesh.positions.size() / 3;
    std::erase_if(ratios, [&](size_t ratio) { return ratio < 2 || n / ratio < FEWEST_PREVIEW_VERTICES; });
    if (n < FEWEST_VERTICES || mesh.faces.size() == 0 || ratios.empty()) return previews;
    Original original(mesh, n / ratios[0], budget);
    if (!original.can_be_searched()) return previews;
    for (size_t ratio : ratios) {
        TriangleMesh coarse(budget);
        if (!original.simplify(ratio, coarse)) break;
        Fit fit(original, coarse);
        if (!fit.shows_more) continue;
        Preview preview = rounded(original, fit, coarse, grid_bits(fit.distance, mesh.bits));
        if (!preview.faces.empty()) previews.push_back(std::move(preview));
    }
    std::reverse(previews.begin(), previews.end());
    return previews;
}

} // namespace meshtide::inline MESHTIDE_ISA
