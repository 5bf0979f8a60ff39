// What the benches of single layers share: meshes from files, the levels of all their depths, time, training.
#pragma once

#include "mesh/octree.hpp"

#include <cstdio>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

namespace meshtide {

// Where samples are looked for by their names, from the folder that a bench runs in.
inline const std::string SAMPLES = "samples/";

struct Sample {
    std::string name;
    int bits = 12, mirror_axis = -1, mirror_sum = 0;
    std::vector<int32_t> positions, faces;
};

// A file of int32: vertices, faces, bits, mirror axis (-1: none), mirror sum, positions, corners.
inline Sample load_sample(const std::string& path) {
    Sample sample;
    size_t from = path.rfind('/') + 1;
    sample.name = path.substr(from, path.rfind('.') - from);
    FILE* file = std::fopen(path.c_str(), "rb");
    int32_t head[5];
    if (file == nullptr || std::fread(head, 4, 5, file) != 5) {
        std::fprintf(stderr, "cannot read %s\n", path.c_str());
        std::exit(2);
    }
    sample.bits = head[2], sample.mirror_axis = head[3], sample.mirror_sum = head[4];
    sample.positions.resize(3 * static_cast<size_t>(head[0]));
    sample.faces.resize(3 * static_cast<size_t>(head[1]));
    bool whole = std::fread(sample.positions.data(), 4, sample.positions.size(), file) == sample.positions.size() &&
                 std::fread(sample.faces.data(), 4, sample.faces.size(), file) == sample.faces.size();
    std::fclose(file);
    if (!whole) std::exit(2);
    return sample;
}

inline double seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

} // namespace meshtide
