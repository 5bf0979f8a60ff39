#include "surface/distance.hpp"

#include "surface/samples.hpp"
#include "surface/triangles.hpp"

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

bool same(Span<const Vector> a, Span<const Vector> b) {
    return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](Vector one, Vector other) {
               return one.x == other.x && one.y == other.y && one.z == other.z;
           });
}

bool same(Span<const int32_t> a, Span<const int32_t> b) {
    return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin());
}

} // namespace

DistanceMeter::DistanceMeter(Surface original, const DistanceOptions& options, Budget& budget)
    : options_(options), vertices_(budget), faces_(budget), samples_(budget), used_(budget),
      tree_(
          [&] {
              if (options.samples == 0 || options.vertex_limit == 0)
                  fail(Fault::argument, "a distance needs samples and vertices");
              Frame frame = frame_of(original.vertices);
              centre_ = frame.centre, scale_ = frame.scale;
              place(original, frame, vertices_);
              return Surface{vertices_.span(), faces_or_vertices(original, faces_)};
          }(),
          budget) {
    tree_.sampled(options.samples, options.seed, samples_, budget);
    tree_.used_vertices(options.vertex_limit, used_, budget);
}

Distortion DistanceMeter::measure(Surface other, Budget& budget) const {
    Array<Vector> vertices(budget);
    Array<int32_t> points(budget);
    place(other, {centre_, scale_}, vertices);
    Span<const int32_t> faces = faces_or_vertices(other, points);
    if (same(vertices.span(), vertices_.span()) && same(faces, tree_.surface().faces)) return {};
    ClosestPoints tree({vertices.span(), faces}, budget, &tree_);
    CurvePoints samples(budget), used(budget);
    tree.sampled(options_.samples, options_.seed + 1, samples, budget);
    tree.used_vertices(options_.vertex_limit, used, budget);

    Spread forth = tree.spread(samples_), back = tree_.spread(samples);
    double farthest = std::max(forth.largest, back.largest);
    farthest = tree_.largest(used, farthest);
    farthest = tree.largest(used_, farthest);
    return {std::sqrt(std::max(forth.mean, back.mean)), std::sqrt(farthest)};
}

} // namespace meshtide::inline MESHTIDE_ISA
