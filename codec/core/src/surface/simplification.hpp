// Simplified versions of a mesh, for previews: clusters on a grid, then edges collapsed in the order of quadric error.
//
// Vertices are first clustered in the cells of the octree's depth that has enough of them, each cluster with the sum of
// its vertices' quadrics (Lindstrom, "Out-of-core simplification of large polygonal models", SIGGRAPH 2000): far
// cheaper than to collapse them one by one, and no worse when seven times as many are left as are wanted in the end.
// Then edges are collapsed (Garland, Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997),
// with a weak pull towards the collapsed ends that keeps flat regions well shaped.
//
// Faces may meet in any way. Collapses that turn a face over are put off, and those that glue sheets together are made
// only when no others are left, so that meshes of many parts get as coarse as any. The queue is a heap whose outdated
// entries are skipped. O((n + m) log m).
#pragma once

#include "surface/quadrics.hpp"
#include "surface/triangles.hpp"

namespace meshtide::inline MESHTIDE_ISA {

class Simplifier {
public:
    // A mesh of grid points in Morton order, three coordinates below 2^bits each, pairwise different; faces, of
    // which those of three different corners count; `finest` is the greatest number of vertices that will be asked for.
    Simplifier(Span<const int32_t> positions, Span<const int32_t> faces, int bits, size_t finest, Budget& budget);

    // Gets coarser from call to call: to `target` vertices, or as near as it goes. Faces are canonical.
    void reduce(size_t target, TriangleMesh& reduced);

private:
    struct Vertex {
        Vector position;
        Quadric quadric;
    };
    // An edge in the queue. The key is the cost as a float, whose bits rise as it does, and u, which breaks ties.
    struct Entry {
        uint64_t key;
        int32_t v;
        uint32_t versions; // the sum of both when the cost was found: they only ever rise
        int32_t u() const { return static_cast<int32_t>(key & INT32_MAX); }
    };

    void cluster(Span<const int32_t> positions, Span<const int32_t> faces, int bits, size_t fewest);
    void list_corners();
    QuadricMinimum collapsed(int32_t u, int32_t v) const;
    Entry entry_of(int32_t u, int32_t v) const;
    bool glues(int32_t u, int32_t v);
    bool turns(int32_t moved, int32_t merged, Vector to);
    void merge(int32_t u, int32_t v, Vector to);
    void drop_dead(int32_t vertex);
    bool has_faces(int32_t vertex) const;
    void queue_around(int32_t vertex, int32_t above);
    bool current(const Entry& entry) const;
    void push(int32_t u, int32_t v);
    Entry pop();
    void sink(size_t place);
    void compact();

    Vertex& at(int32_t vertex) { return vertices_[static_cast<size_t>(vertex)]; }
    const Vertex& at(int32_t vertex) const { return vertices_[static_cast<size_t>(vertex)]; }
    int32_t corner(size_t face, size_t k) const { return faces_[3 * face + k]; }

    Budget& budget_;
    Array<Vertex> vertices_;
    Array<int32_t> faces_;
    Array<uint8_t> alive_;        // of each face
    Array<int32_t> first_, last_; // of each vertex: its list of corners, 3 face + corner
    Array<int32_t> following_;    // of each corner in such a list
    Array<uint32_t> versions_;    // of each vertex: how often it was moved; GONE if it is not in use any more
    Array<uint32_t> marks_;       // of each vertex
    Array<Entry> heap_;
    size_t heap_room_ = 0;
    size_t live_ = 0;
    size_t work_ = 0; // corners looked at
    uint32_t mark_ = 0;
    bool gluing_ = false;
};

} // namespace meshtide::inline MESHTIDE_ISA
