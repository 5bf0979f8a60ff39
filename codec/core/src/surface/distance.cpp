#include "surface/distance.hpp"

#include "surface/samples.hpp"

#include <algorithm>

namespace meshtide::inline MESHTIDE_ISA {

namespace {

struct Frame {
    Vector centre;
    double scale;
};

// About the middle of the box, with its diagonal as the unit: safe from overflow and underflow.
Frame frame_of(Span<const Vector> vertices) {
    if (vertices.size() == 0) fail(Fault::argument, "a mesh must have at least one vertex to have distances");
    Vector low = vertices[0], high = low;
    for (Vector v : vertices) {
        low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
        high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
    }
    Vector sides = high - low;
    double largest = std::max(sides.x, std::max(sides.y, sides.z));
    Frame frame{low * 0.5 + high * 0.5, 1.0};
    if (largest > 0.0 && std::isfinite(largest)) {
        Vector shares{sides.x / largest, sides.y / largest, sides.z / largest};
        frame.scale = largest * length(shares);
    }
    return frame;
}

void place(Surface surface, const Frame& frame, Array<Vector>& vertices) {
    vertices.resize(surface.vertices.size());
    for (size_t i = 0; i < vertices.size(); i++) {
        Vector v = surface.vertices[i] - frame.centre;
        vertices[i] = {v.x / frame.scale, v.y / frame.scale, v.z / frame.scale};
        if (!std::isfinite(v.x + v.y + v.z)) fail(Fault::argument, "vertices must be finite to have distances");
    }
}

// Triangles of one vertex each, where there are none.
Span<const int32_t> faces_of(Surface surface, Array<int32_t>& points) {
    if (surface.face_count() != 0) return surface.faces;
    points.resize(3 * surface.vertices.size());
    for (size_t i = 0; i < points.size(); i++) points[i] = static_cast<int32_t>(i / 3);
    return points.span();
}

void sampled(const ClosestPoints& tree, size_t count, uint64_t seed, Array<Vector>& points, Budget& budget) {
    Array<Foot> feet(budget);
    feet.resize(count);
    points.resize(count);
    sample(tree.faces(), seed, feet.span());
    for (size_t i = 0; i < count; i++) points[i] = feet[i].on(tree.surface());
}

} // namespace

DistanceMeter::DistanceMeter(Surface original, const DistanceOptions& options, Budget& budget)
    : options_(options), budget_(budget), vertices_(budget), faces_(budget), samples_(budget), used_(budget),
      tree_(
          [&] {
              Frame frame = frame_of(original.vertices);
              centre_ = frame.centre, scale_ = frame.scale;
              place(original, frame, vertices_);
              return Surface{vertices_.span(), faces_of(original, faces_)};
          }(),
          budget) {
    if (options.samples == 0 || options.vertex_limit == 0)
        fail(Fault::argument, "a distance needs samples and vertices");
    sampled(tree_, options.samples, options.seed, samples_, budget);
    used_vertices(tree_.surface(), tree_.order(), options.vertex_limit, used_, budget);
}

Distortion DistanceMeter::measure(Surface other) const {
    Array<Vector> vertices(budget_), samples(budget_), used(budget_);
    Array<int32_t> faces(budget_);
    place(other, {centre_, scale_}, vertices);
    ClosestPoints tree({vertices.span(), faces_of(other, faces)}, budget_);
    sampled(tree, options_.samples, options_.seed + 1, samples, budget_);
    used_vertices(tree.surface(), tree.order(), options_.vertex_limit, used, budget_);

    Spread forth = tree.spread(samples_.span()), back = tree_.spread(samples.span());
    double farthest = std::max(forth.largest, back.largest);
    farthest = tree_.largest(used.span(), farthest);
    farthest = tree.largest(used_.span(), farthest);
    return {std::sqrt(std::max(forth.mean, back.mean)), std::sqrt(farthest)};
}

} // namespace meshtide::inline MESHTIDE_ISA
