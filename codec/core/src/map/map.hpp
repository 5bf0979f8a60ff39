// Maps: which octants of each cell have children, and which of these are leaves (docs/format.md, Map).
#pragma once

#include "base/effort.hpp"
#include "map/facts.hpp"
#include "map/mirror.hpp"
#include "map/questions.hpp"

namespace meshtide::inline MESHTIDE_ISA {

struct MapOptions {
    int bits = 0;        // of the finest coordinates
    size_t vertices = 0; // of the finest mesh
    MapMirror mirror;
};

// Of each cell of the coarse depth: its children, as masks.
struct MapTruth {
    Span<const uint8_t> octants, leaves;
};

template <Effort effort, class Coder>
void code_map(Coder& coder, const MapOptions& options, MapModel<effort>& model, Level& coarse, Level& fine,
              const MapTruth& truth) {
    size_t n = coarse.vertex_count();
    MapRoom& room = model.room;
    const int depth = coarse.depth + 1;
    const bool last = depth == options.bits;
    expect(depth <= options.bits, "a map below the finest depth");
    const uint32_t fewest = last ? 2 : 1;
    const float step = static_cast<float>(1 << (options.bits - coarse.depth)); // half a coarse cell
    const float scale = 1.0f / step;

    fine.depth = depth;
    fine.centres.clear();
    fine.cell_depths.clear();
    fine.leaves.clear();
    fine.parents.clear();
    coarse.first_children.resize(n + 1);
    room.notes.resize(n);
    room.moved.resize(n);
    room.laps.swap(room.fine_laps);
    if (room.laps.size() != n) room.laps.assign(n, splat(0));
    room.fine_laps.clear();
    size_t certain = 0; // finest vertices that there are at least
    for (size_t v = 0; v < n; v++) {
        bool leaf = coarse.leaves[v] != 0;
        room.notes[v] = leaf ? Note::leaf(static_cast<uint32_t>(coarse.depth - coarse.cell_depths[v])) : Note();
        room.moved[v] = coarse.centres[v];
        certain += leaf ? 1 : 2;
    }
    room.images.prepare(options.mirror, coarse, options.bits);
    const Mixer<MapShape<effort>::groups, MapShape<effort>::neurons, 4> mixer(model.states());
    int trust = 0; uint32_t recent = 3 << 5, recent_leaf = 0;
#ifdef ALLN
    static Budget bb(1ull << 32); CellTable alln(bb); { size_t nn = 0; for (size_t v = 0; v < n; v++) nn += !coarse.leaves[v]; alln.reset(nn); int sh = options.bits - coarse.depth + 1;
    for (size_t v = 0; v < n; v++) if (!coarse.leaves[v]) { I32x4 w = truncate(coarse.centres[v]); alln.put((uint32_t)(w[0] >> sh), (uint32_t)(w[1] >> sh), (uint32_t)(w[2] >> sh), (uint32_t)v); } }
#endif

    for (size_t v = 0; v < n; v++) {
        coarse.first_children[v] = static_cast<uint32_t>(fine.centres.size());
        auto append = [&](F32x4 centre, int cell_depth, bool leaf) {
            fine.centres.push(centre);
            fine.cell_depths.push(static_cast<uint8_t>(cell_depth));
            fine.leaves.push(leaf);
            room.fine_laps.push(room.laps[v] * splat(0.25f));
            fine.parents.push(static_cast<uint32_t>(v));
        };
        if (coarse.leaves[v] != 0) {
            append(coarse.centres[v], coarse.cell_depths[v], true);
            continue;
        }
        Survey s = survey(coarse, room.notes.span(), room.moved.span(), room.laps.span(), v, scale);
#ifdef ALLN
        {   I32x4 wh = truncate(coarse.centres[v]); int sh = options.bits - coarse.depth + 1;
            uint64_t outer = 0, edges = 0, corners = 0; s.touch_leaf = s.touch_inner = s.touch_empty = 0;
            for (int dx = -1; dx <= 1; dx++) for (int dy = -1; dy <= 1; dy++) for (int dz = -1; dz <= 1; dz++) {
                int nz = (dx != 0) + (dy != 0) + (dz != 0); if (nz < 1) continue;
                int w = alln.find((uint32_t)((wh[0] >> sh) + dx), (uint32_t)((wh[1] >> sh) + dy), (uint32_t)((wh[2] >> sh) + dz));
                if (w < 0) continue;
                Note note = room.notes[(size_t)w]; int d[3] = {dx, dy, dz};
                uint32_t half = 0xff, mask = note.octants(), leafs = note.leaves(); int other = 0, axis1 = 0;
                for (int axis = 0; axis < 3; axis++) if (d[axis]) { half &= UPPER_HALF[(size_t)axis] ^ (d[axis] > 0 ? 0 : 0xff); mask = flipped(mask, axis); leafs = flipped(leafs, axis); axis1 = axis; } else other = axis;
                uint64_t lanes = spread(half), code = note.is_coded() ? lanes : 3 * lanes;
                code += spread(mask) & (lanes * 0xff); uint64_t all = lanes * 0xff; if (note.is_coded()) { s.touch_leaf += spread(leafs) & all; s.touch_inner += spread(mask & ~leafs) & all; s.touch_empty += spread(~mask & 255) & all; }
                if (nz == 1) outer |= code << (2 * (2 - axis1)); else if (nz == 3) corners |= code; else edges |= code << (2 * (2 - other));
            }
            s.outer = outer; s.edges = edges; s.corners = corners;
        }
#endif
        Children image;
        bool imaged = false;
        if (room.images.present())
            imaged = room.images.find(coarse, v, [&](size_t w) { return Children{room.notes[w].octants(), room.notes[w].leaves()}; }, image);
        CellFacts cell;
        cell.mirror_state = !room.images.present() ? 0 : imaged ? 2 + static_cast<uint32_t>(std::min(trust, 2)) : 1;
        cell.trusted = !imaged ? 0 : cell.mirror_state < 4 ? 1 : 2;
        describe(s, cell); cell.recent = std::min(recent >> 4, 15u); cell.recent_leaf = recent_leaf >> 5;
        uint32_t want_octants = 0, want_leaves = 0;
        if (Coder::encoding) want_octants = truth.octants[v], want_leaves = truth.leaves[v];
        {   // siblings
            uint32_t p = coarse.parents.size() == n ? coarse.parents[v] : 0; size_t i = v, j = v;
            if (coarse.parents.size() == n) { while (i > 0 && coarse.parents[i - 1] == p) i--; while (j + 1 < n && coarse.parents[j + 1] == p) j++; }
            cell.siblings = static_cast<uint32_t>(j - i); cell.place = static_cast<uint32_t>(v - i);
        }

        Children made;
        uint32_t path = 1, count = 0;
        for (uint32_t rank = 0; rank < 8; rank++) {
            uint32_t octant = s.octants[rank];
            int bit = 1;
            if (count + 8 - rank > fewest) {
                OctantFacts facts;
                facts.rank = rank;
                facts.path = path;
                facts.vote = std::min(byte_of(s.votes, octant), 3u);
                facts.outer = byte_of(s.outer, octant);
                facts.inner = INNER[path];
                facts.touch_empty = byte_of(s.touch_empty, octant); facts.touch_leaf = byte_of(s.touch_leaf, octant); facts.touch_inner = byte_of(s.touch_inner, octant); facts.leaf_votes = byte_of(s.leaf_votes, octant); facts.all_votes = byte_of(s.votes, octant);
                facts.corner = byte_of(s.corners, octant);
                facts.edges = byte_of(s.edges, octant);
                { uint32_t b0 = s.octants[0] ^ s.octants[4], b1 = s.octants[0] ^ s.octants[2], b2 = s.octants[0] ^ s.octants[1];
                auto at = [](uint32_t b) { return b == 4 ? 4 : b == 2 ? 2 : 0; };
                facts.canon_outer = (facts.outer >> at(b0) & 3) << 4 | (facts.outer >> at(b1) & 3) << 2 | (facts.outer >> at(b2) & 3);
                facts.canon_edges = (facts.edges >> at(b0) & 3) << 4 | (facts.edges >> at(b1) & 3) << 2 | (facts.edges >> at(b2) & 3); }
                facts.count = count;
                facts.over = cell.heights[rank >> 2][rank & 3];
                facts.height = s.oriented ? static_cast<uint32_t>(std::clamp((facts.over + 3.0f) * 4.0f, 0.0f, 16.0f)) : 12;
                facts.answer = !imaged ? 0 : 1 + (image.octants >> octant & 1);
                bit = decide(coder, mixer, ask_octant<effort>(cell, facts), cell, facts, want_octants >> octant & 1);
            }
            path = 2 * path + static_cast<uint32_t>(bit);
            count += static_cast<uint32_t>(bit);
            made.octants |= static_cast<uint32_t>(bit) << octant;
        }
        if (last) {
            made.leaves = made.octants;
        } else if (count > 1) {
            LeafFacts facts;
            facts.size = std::min(count, 5u) - 2;
            facts.split = facts.found = 0;
            facts.canonical = path & 255;
            facts.children = count; facts.left = count;
            for (uint32_t rank = 0; rank < 8; rank++) {
                uint32_t octant = s.octants[rank];
                if ((made.octants >> octant & 1) == 0) continue;
                uint32_t across = (made.octants >> (octant ^ 4) & 1) + (made.octants >> (octant ^ 2) & 1) + (made.octants >> (octant ^ 1) & 1);
                uint32_t edges = (made.octants >> (octant ^ 6) & 1) + (made.octants >> (octant ^ 5) & 1) + (made.octants >> (octant ^ 3) & 1);
                facts.rank = rank;
                facts.touch_leaf = byte_of(s.touch_leaf, octant); facts.touch_inner = byte_of(s.touch_inner, octant); facts.leaf_votes = byte_of(s.leaf_votes, octant); facts.all_votes = byte_of(s.votes, octant); facts.path = path;
                facts.beside = 2 * across + (edges > 1);
                facts.vote = std::min(byte_of(s.votes, octant), 3u);
                facts.outer = byte_of(s.outer, octant);
                facts.over = cell.heights[rank >> 2][rank & 3];
                facts.answer = !imaged ? 0 : 1 + (image.leaves >> octant & 1);
                int bit = decide(coder, mixer, ask_leaf<effort>(cell, facts), cell, facts, want_leaves >> octant & 1);
                made.leaves |= static_cast<uint32_t>(bit) << octant;
                (bit != 0 ? facts.found : facts.split)++;
                facts.left--;
            }
        }
        // The finest vertices that must follow: one for each leaf, two for each other cell, instead of this cell's two.
        certain += 2 * count - static_cast<size_t>(std::popcount(made.leaves)) - 2;
        expect(certain <= options.vertices, "more cells than vertices");
        F32x4 sum = splat(0);
        float far = 0;
        for (uint32_t octant = 0; octant < 8; octant++) {
            if ((made.octants >> octant & 1) == 0) continue;
            F32x4 corner = {(octant & 4) != 0 ? 0.5f : -0.5f, (octant & 2) != 0 ? 0.5f : -0.5f, (octant & 1) != 0 ? 0.5f : -0.5f, 0};
            sum += corner;
            append(coarse.centres[v] + corner * splat(step), depth, (made.leaves >> octant & 1) != 0);
        }
        { float each = 1.0f / static_cast<float>(count);        room.laps[v] = (sum * splat(each) - s.mean) * splat(step);         room.laps[v][3] = 0; }
        for (size_t i = coarse.first_children[v]; i < room.fine_laps.size(); i++) room.fine_laps[i] = room.laps[v] * splat(0.25f);
        if (s.oriented)
            for (uint32_t rank = 0; rank < 8; rank++)
                if ((made.octants >> s.octants[rank] & 1) != 0) far += std::abs(cell.heights[rank >> 2][rank & 3]);
        float each = 1.0f / static_cast<float>(count);
        room.moved[v] = coarse.centres[v] + sum * splat(step * each);
        room.moved[v][3] = s.oriented ? far * each : 0.6f;
        room.notes[v] = Note::cell(made.octants, made.leaves);
        recent += count * 8 - recent / 8 ; recent_leaf += std::popcount(made.leaves)  * 32 / count - recent_leaf / 8;
        if (imaged) {
            bool right = image.octants == made.octants && (last || image.leaves == made.leaves);
            trust = right ? std::min(trust + 1, 4) : trust >> 1;
        }
    }
    coarse.first_children[n] = static_cast<uint32_t>(fine.centres.size());
}

} // namespace meshtide::inline MESHTIDE_ISA
