// Closest points of a surface: a tree of boxes over its triangles, four children at a time, searched in floats, with
// doubles for the answer.
//
// Triangles are sorted along a Morton curve, and a binary tree halves the curve where the uppermost bit of its keys
// changes (Karras, "Maximizing parallelism in the construction of BVHs, octrees, and k-d trees", High Performance
// Graphics 2012); its nodes are then merged into nodes of four (Dammertz, Hanika, Keller, "Shallow bounding volume
// hierarchies for fast SIMD ray tracing of incoherent rays", EGSR 2008). Floats decide which triangles can matter, with
// a margin for their rounding, and those are measured in doubles: answers are those of doubles. Building is
// O(m log m), a search O(log m) on surfaces. A tree never changes, so many threads can search it.
#pragma once

#include "base/lanes.hpp"
#include "surface/beams.hpp"
#include "surface/geometry.hpp"
#include "surface/samples.hpp"

namespace meshtide::inline MESHTIDE_ISA {

struct Closest {
    double squared; // distance
    Foot foot;
};

// Mean and maximum of squared distances.
struct Spread {
    double mean = 0, largest = 0;
};

// The closest point of one triangle.
Closest closest_on_face(const Surface& surface, size_t face, Vector point);

// Points along the curve of a surface, each with the key of the face that it is on.
struct CurvePoints {
    explicit CurvePoints(Budget& budget) : at(budget), keys(budget) {}
    Array<Vector> at;
    Array<uint64_t> keys;
};

class ClosestPoints {
public:
    // The surface, of at least one triangle of finite vertices, must stay as it is as long as the tree is used. If
    // another one is about where `like` is, both have the same curve.
    ClosestPoints(Surface surface, Budget& budget, const ClosestPoints* like = nullptr);

    // The closest point of the surface, or none and a distance of 0 if that is surely not above `enough`, squared and
    // greater than 0. A search is short when it begins with a triangle, `hint`, that is close.
    Closest closest(Vector point, size_t hint, double enough = 0.0) const;

    // The closest point for each; those that are neighbours in the list and in space are found fast. Feet that have a
    // face already, from a search of points near by, begin there.
    void closest(Span<const Vector> points, Span<Foot> feet) const;

    // Of the squared distances of some points. In a tangle of large triangles that are all near to every point, where
    // searches are slow, only as many points are looked at, spread evenly over the list, as take reasonable time.
    Spread spread(const CurvePoints& points) const;
    // The greatest of `floor` and the squared distances: faster than to find each of them.
    double largest(const CurvePoints& points, double floor) const;

    // How many nodes of four children a search visits on average: about 12 on surfaces, up to all of them in tangles.
    double visits_per_search(Span<const Vector> points) const;

    const Surface& surface() const { return surface_; }
    // The triangles along the curve: neighbours in this list are neighbours in space.
    Span<const uint32_t> order() const { return order_.span(); }
    // Points on the surface, evenly by area, and the vertices that faces use, see samples.hpp.
    void sample(uint64_t seed, Span<Foot> samples, Budget& budget) const {
        meshtide::sample(surface_, order_.span(), seed, samples, budget);
    }
    void sampled(size_t count, uint64_t seed, CurvePoints& points, Budget& budget) const;
    void used_vertices(size_t limit, CurvePoints& points, Budget& budget) const;

private:
    // Four children, a lane for each: nodes, or ~number of a block of up to four triangles.
    struct Node {
        float low[3][4], high[3][4]; // boxes of the children
        int32_t children[4];
        int32_t beams[4]; // of each child, or -1
    };
    struct Block {
        float first[3][4], second[3][4], third[3][4]; // corner, and the edges from it to the other two
        int32_t faces[4];                             // those that fill a block up are repeated
    };
    struct Point {
        F32x4 at[3];
    };
    struct Contest;
    struct Builder;

    static F32x4 squared_distances(const Node& node, const Point& point);
    static F32x4 squared_distances(const Block& block, const Point& point);
    void prefetch(int32_t child) const;
    Closest search(Vector point, size_t hint, double enough, size_t& visits) const;
    size_t stride(Span<const Vector> points) const;
    size_t follow(size_t place, uint64_t key) const;

    Surface surface_;
    Vector centre_;
    double scale_ = 1;      // to floats, in which the surface is within 0.5 of the centre; a power of two
    Array<uint32_t> order_; // of the faces along the curve
    Array<uint64_t> keys_;  // of those on it
    Array<Node> nodes_;
    Array<Block> blocks_;
    Array<uint32_t> block_of_face_;
    Array<Beam> beams_;
};

} // namespace meshtide::inline MESHTIDE_ISA
