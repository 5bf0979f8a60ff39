// The decoder of profile classic: rebuilds each level from its packets, also when Diffs are missing, late or changed.
//
// Faces decode from Base and Map&Conn alone. Geometry is the coarser level's, extended, filtered, and moved by the Diff
// where it is there; a Diff that is missing counts as zero, and finer levels extend what was made (R. Balan, G. Taubin,
// "3D mesh geometry filtering algorithms for progressive transmission schemes", CAD 32, 2000, section 4). So a level is
// made when it is asked for, from the packets that have come by then, and kept until a packet changes it.
#pragma once

#include "classic/connectivity.hpp"
#include "codec/stream_decoder.hpp"
#include "surface/filters.hpp"

namespace meshtide::inline MESHTIDE_ISA {

// The filter of a header.
Filter filter_of(const ClassicOptions& options);

class ClassicDecoder final : public StreamDecoder {
public:
    ClassicDecoder(const Header& header, const Trained& trained, Budget& budget);

    uint64_t available() const override;
    uint64_t exact() const override;
    uint64_t map_bytes() const override { return map_bytes_; }
    void show(uint32_t level, Shown& shown) override;

protected:
    void take(PacketPlace place, Span<const uint8_t> payload) override;
    void replace(const DecodedDiffs& decoded, Span<const double> values) override;

private:
    // What is known of one level.
    struct ClassicLevel {
        explicit ClassicLevel(Budget& budget)
            : waiting(budget), parents(budget), faces(budget), graph(budget), coefficients(budget), differences(budget),
              others(budget), geometry(budget) {}
        size_t vertex_count = 0, face_count = 0;
        bool has_waiting = false, has_faces = false, has_coefficients = false, has_differences = false;
        bool has_graph = false, has_geometry = false;
        Array<uint8_t> waiting; // its Map&Conn, until it is decoded
        Array<uint32_t> parents;
        Array<int32_t> faces;
        Graph graph;
        Array<float> coefficients;
        Array<int32_t> differences;
        Array<double> others; // in place of the differences, if there are any
        Array<Vector> geometry;
    };

    uint32_t coarsest() const { return header_.classic.levels - 1; }
    int shift_of(uint32_t level) const { return header_.classic.shifts[level]; }
    void decode_base(Span<const uint8_t> payload);
    void decode_levels();
    void decode_coefficients(ClassicLevel& level, Span<const uint8_t> payload);
    void decode_diff(uint32_t number, Span<const uint8_t> payload);
    void forget_geometry(uint32_t number);
    void reconstruct(uint32_t number);

    Filter filter_;
    List<ClassicLevel> levels_; // level 0 first
    ClassicConnectivity connectivity_;
    uint32_t next_; // the level whose faces come next: levels from here on have none
    bool broken_ = false;
    uint64_t map_bytes_ = 0;
};

} // namespace meshtide::inline MESHTIDE_ISA
