#include "surface/refit.hpp"

#include "surface/samples.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

constexpr size_t ROUNDS = 3;
constexpr size_t ROUGH_ROUNDS = 2;        // of these, with fewer samples: the next one changes more than that
constexpr size_t ROUGH_STRIDE = 3;        // of samples then
constexpr size_t MEASURED_SAMPLES = 1000; // of either surface, for distances
constexpr size_t ROUNDING_ROUNDS = 2;     // projections while vertices move on the grid
constexpr size_t ROUNDING_STRIDE = 2;     // of samples in the first of them
constexpr size_t ROUNDING_PASSES = 20;    // over all vertices, after each projection; most end earlier
constexpr size_t SAMPLES_PER_VERTEX = 10; // of either surface; more of them make it no closer
constexpr size_t FEWEST_SAMPLES = 600;
constexpr double STIFFNESS = 0.005; // of the spring that holds a vertex, for each sample that falls to it
constexpr size_t PASSES = 30;       // of conjugate gradients, in each round
constexpr double TOLERANCE = 1e-2;  // of the gradient: the projection of the next round changes more than that
constexpr double CLOSE = 1e-3;      // between points whose difference is too short to have a direction
constexpr uint64_t SEED = 1;
constexpr int32_t REACH = 1; // grid steps that a vertex may move at a time, along each axis

double dot_all(Span<const Vector> a, Span<const Vector> b) {
    double total = 0.0;
    for (size_t i = 0; i < a.size(); i++) total += dot(a[i], b[i]);
    return total;
}

} // namespace

Refitter::Refitter(const ClosestPoints& original, Span<const int32_t> faces, size_t vertices, Budget& budget)
    : original_(original), faces_(faces), budget_(budget), samples_(budget), feet_(budget), own_(budget), back_(budget),
      planes_(budget), gradient_(budget), starts_(budget), corners_(budget) {
    size_t count = std::max(FEWEST_SAMPLES, SAMPLES_PER_VERTEX * vertices);
    full_stiffness_ = stiffness_ = STIFFNESS * 2.0 * static_cast<double>(count) / static_cast<double>(vertices);
    own_.resize(count);
    original.sample(SEED, own_.span(), budget);
    samples_.resize(count);
    for (size_t i = 0; i < count; i++) samples_[i] = own_[i].on(original.surface());
    feet_.assign(count, Foot{});
    back_.assign(count, Foot{});
    planes_.resize(faces.size() / 3);
    gradient_.resize(vertices);

    starts_.assign(vertices + 1, 0);
    for (int32_t v : faces) starts_[static_cast<size_t>(v) + 1]++;
    for (size_t v = 0; v < vertices; v++) starts_[v + 1] += starts_[v];
    corners_.resize(faces.size());
    for (uint32_t h = 0; h < faces.size(); h++) corners_[starts_[static_cast<size_t>(faces[h])]++] = h;
    for (size_t v = vertices; v > 0; v--) starts_[v] = starts_[v - 1];
    starts_[0] = 0;
}

void Refitter::fit(Span<Vector> vertices) {
    for (size_t round = 0; round < ROUNDS; round++) {
        project(vertices, round < ROUGH_ROUNDS ? ROUGH_STRIDE : 1);
        solve(vertices);
    }
}

void Refitter::round(Span<const Vector> vertices, double step, int32_t last, Array<int32_t>& grid) {
    Array<Vector> placed(budget_);
    placed.resize(vertices.size());
    grid.resize(3 * vertices.size());
    auto nearest = [&](double value) {
        double rounded = std::floor(value / step + 0.5);
        return static_cast<int32_t>(std::clamp(rounded, 0.0, static_cast<double>(last)));
    };
    for (size_t v = 0; v < vertices.size(); v++) {
        grid[3 * v] = nearest(vertices[v].x);
        grid[3 * v + 1] = nearest(vertices[v].y);
        grid[3 * v + 2] = nearest(vertices[v].z);
    }
    for (size_t round = 0; round < ROUNDING_ROUNDS; round++) {
        for (size_t v = 0; v < vertices.size(); v++)
            placed[v] = Vector{static_cast<double>(grid[3 * v]), static_cast<double>(grid[3 * v + 1]),
                               static_cast<double>(grid[3 * v + 2])} *
                        step;
        project(placed.span(), round == 0 ? ROUNDING_STRIDE : 1);
        for (size_t v = 0; v < vertices.size(); v++)
            gradient_[v] = gradient_[v] + (placed[v] - vertices[v]) * stiffness_;
        for (size_t pass = 0; pass < ROUNDING_PASSES; pass++)
            if (round_once(vertices, step, last, grid.span()) == 0) break;
    }
}

double Refitter::distance(Span<const Vector> vertices) {
    Surface mesh{vertices, faces_};
    ClosestPoints tree(mesh, budget_);
    tree.sample(SEED + 1, own_.span(), budget_);
    size_t stride = (samples_.size() + MEASURED_SAMPLES - 1) / MEASURED_SAMPLES, count = 0;
    double forth = 0.0, back = 0.0;
    for (size_t i = 0; i < samples_.size(); i += stride, count++) {
        forth += tree.closest(samples_[i], hint(feet_, i, stride)).squared;
        back += original_.closest(own_[i].on(mesh), hint(back_, i, stride)).squared;
    }
    return std::sqrt(std::max(forth, back) / static_cast<double>(count));
}

// Along a difference; where it is too short, along the normal of its foot's face.
Vector Refitter::direction(Vector difference, const Surface& surface, const Foot& foot) const {
    double size = length(difference);
    if (size > CLOSE) return difference * (1.0 / size);
    Vector normal = surface.normal(static_cast<size_t>(foot.face));
    return normal * (1.0 / std::max(length(normal), CLOSE));
}

// The planes of every `stride`-th sample of both surfaces, with the vertices where they are.
void Refitter::project(Span<const Vector> vertices, size_t stride) {
    Surface mesh{vertices, faces_};
    stiffness_ = full_stiffness_ / static_cast<double>(stride);
    ClosestPoints tree(mesh, budget_);
    planes_.assign(planes_.size(), FacePlanes{});
    gradient_.assign(gradient_.size(), Vector{});
    for (size_t i = 0; i < samples_.size(); i += stride) {
        feet_[i] = tree.closest(samples_[i], hint(feet_, i, stride)).foot;
        add_plane(feet_[i], vertices, direction(samples_[i] - feet_[i].on(mesh), mesh, feet_[i]), samples_[i]);
    }
    tree.sample(SEED + 1, own_.span(), budget_);
    for (size_t i = 0; i < own_.size(); i += stride) {
        Vector point = own_[i].on(mesh);
        back_[i] = original_.closest(point, hint(back_, i, stride)).foot;
        Vector foot = back_[i].on(original_.surface());
        add_plane(own_[i], vertices, direction(point - foot, original_.surface(), back_[i]), foot);
    }
}

// Where to begin to search: where this sample was found before, or else the one before it.
size_t Refitter::hint(const Array<Foot>& feet, size_t place, size_t stride) {
    int32_t face = feet[place].face;
    if (face < 0 && place >= stride) face = feet[place - stride].face;
    return static_cast<size_t>(std::max(face, 0));
}

// A point of the mesh is to lie in the plane through another, across `direction` of length 1.
void Refitter::add_plane(const Foot& foot, Span<const Vector> vertices, Vector direction, Vector through) {
    FacePlanes& planes = planes_[static_cast<size_t>(foot.face)];
    double w[3] = {foot.weight(0), foot.weight(1), foot.weight(2)};
    const Vector& d = direction;
    Symmetric square{d.x * d.x, d.x * d.y, d.x * d.z, d.y * d.y, d.y * d.z, d.z * d.z};
    planes.blocks[0].add(square, w[0] * w[0]);
    planes.blocks[1].add(square, w[1] * w[1]);
    planes.blocks[2].add(square, w[2] * w[2]);
    planes.blocks[3].add(square, w[0] * w[1]);
    planes.blocks[4].add(square, w[1] * w[2]);
    planes.blocks[5].add(square, w[2] * w[0]);
    double apart = dot(d, foot.on({vertices, faces_}) - through);
    for (size_t k = 0; k < 3; k++) {
        auto v = static_cast<size_t>(faces_[3 * static_cast<size_t>(foot.face) + k]);
        gradient_[v] = gradient_[v] + d * (w[k] * apart);
    }
}

// The matrix of all planes and springs times `values`.
void Refitter::multiply(Span<const Vector> values, Span<Vector> products) const {
    for (size_t v = 0; v < values.size(); v++) products[v] = values[v] * stiffness_;
    for (size_t f = 0; f < planes_.size(); f++) {
        const Symmetric* blocks = planes_[f].blocks;
        const int32_t* corners = faces_.block(3 * f, 3);
        auto i = static_cast<size_t>(corners[0]), j = static_cast<size_t>(corners[1]);
        auto k = static_cast<size_t>(corners[2]);
        Vector a = values[i], b = values[j], c = values[k];
        products[i] = products[i] + (blocks[0] * a + blocks[3] * b + blocks[5] * c);
        products[j] = products[j] + (blocks[3] * a + blocks[1] * b + blocks[4] * c);
        products[k] = products[k] + (blocks[5] * a + blocks[4] * b + blocks[2] * c);
    }
}

// Conjugate gradients from where the vertices are, which springs hold there, until the gradient has fallen enough.
void Refitter::solve(Span<Vector> vertices) {
    size_t n = vertices.size();
    Array<Vector> step(budget_), image(budget_);
    step.resize(n);
    image.resize(n);
    for (size_t v = 0; v < n; v++) step[v] = gradient_[v] * -1.0;
    double square = dot_all(gradient_.span(), gradient_.span()), goal = square * TOLERANCE * TOLERANCE;
    for (size_t pass = 0; pass < PASSES && square > goal; pass++) {
        multiply(step.span(), image.span());
        double curvature = dot_all(image.span(), step.span());
        if (!(curvature > 0.0)) break;
        double far = square / curvature;
        for (size_t v = 0; v < n; v++) {
            vertices[v] = vertices[v] + step[v] * far;
            gradient_[v] = gradient_[v] + image[v] * far;
        }
        double before = square;
        square = dot_all(gradient_.span(), gradient_.span());
        for (size_t v = 0; v < n; v++) step[v] = step[v] * (square / before) - gradient_[v];
    }
}

// Moves each vertex to the best of the grid points around it, the others staying where they are; returns how many
// have moved.
size_t Refitter::round_once(Span<const Vector> wanted, double step, int32_t last, Span<int32_t> grid) {
    size_t moved = 0;
    for (size_t v = 0; v < wanted.size(); v++) {
        Symmetric hessian;
        hessian.xx = hessian.yy = hessian.zz = stiffness_;
        for (size_t i = starts_[v]; i < starts_[v + 1]; i++)
            hessian.add(planes_[corners_[i] / 3].blocks[corners_[i] % 3], 1.0);
        Vector gradient = gradient_[v];
        double best = 0.0;
        int32_t best_move[3] = {};
        int32_t* at = grid.block(3 * v, 3);
        for (int32_t i = -REACH; i <= REACH; i++) {
            for (int32_t j = -REACH; j <= REACH; j++) {
                for (int32_t k = -REACH; k <= REACH; k++) {
                    Vector move = Vector{static_cast<double>(i), static_cast<double>(j), static_cast<double>(k)} * step;
                    double change = dot(move, gradient * 2.0 + hessian * move);
                    if (!(change < best)) continue;
                    if (at[0] + i < 0 || at[1] + j < 0 || at[2] + k < 0) continue;
                    if (at[0] + i > last || at[1] + j > last || at[2] + k > last) continue;
                    best = change;
                    best_move[0] = i, best_move[1] = j, best_move[2] = k;
                }
            }
        }
        if (!(best < 0.0)) continue;
        moved++;
        for (size_t k = 0; k < 3; k++) at[k] += best_move[k];
        Vector move = Vector{static_cast<double>(best_move[0]), static_cast<double>(best_move[1]),
                             static_cast<double>(best_move[2])} *
                      step;
        gradient_[v] = gradient_[v] + move * stiffness_;
        for (size_t i = starts_[v]; i < starts_[v + 1]; i++) {
            size_t face = corners_[i] / 3, corner = corners_[i] % 3;
            for (size_t k = 0; k < 3; k++) {
                auto other = static_cast<size_t>(faces_[3 * face + k]);
                gradient_[other] = gradient_[other] + planes_[face].blocks[FacePlanes::block(corner, k)] * move;
            }
        }
    }
    return moved;
}

} // namespace meshtide::inline MESHTIDE_ISA
