// Bench of the Map layer: sizes and times of every depth, training, damaged payloads.
//   map [-t ROUNDS] [-s STATES_FOLDER] [-e default|high] [-r RUNS] [-d DAMAGES] [-v] MESH ...
// With -t it trains on the meshes of TRAINED that are among those named, and writes STATES_FOLDER/map-EFFORT.states.
#include "map/map.hpp"

#include "layers.hpp"

#include <cmath>
#include <cstdlib>
#include <map>

using namespace meshtide;

namespace {

const char* const TRAINED[] = {
    "casting",   "homer",          "horse-quad",       "nefertiti-rgb",         "spot",
    "cannon",    "emoji_heart",    "frostAxe_noMorph", "greySnapper_vertColor", "marineGround",
    "runeSword", "underwaterScene"};

struct Arguments {
    int rounds = 0, runs = 1, damages = 0;
    bool verbose = false;
    std::string states = ".", effort;
    std::vector<std::string> meshes;
};

struct Depth {
    explicit Depth(Budget& budget) : coarse(budget), octants(budget), leaves(budget), payload(budget) {}
    Level coarse;
    Array<uint8_t> octants, leaves, payload;
};

struct Mesh {
    explicit Mesh(const std::string& path) : sample(load_sample(path)) {
        for (const char* name : TRAINED) trained |= sample.name == name;
        Octree tree({sample.positions.data(), sample.positions.size()}, {sample.faces.data(), sample.faces.size()},
                    sample.bits, *budget);
        options = {sample.bits, sample.positions.size() / 3, {sample.mirror_axis, sample.mirror_sum}};
        for (int b = 0; b < sample.bits; b++) {
            Depth depth(*budget);
            tree.make_level(b, depth.coarse, *budget);
            bool inner = false;
            for (uint8_t leaf : depth.coarse.leaves) inner |= leaf == 0;
            if (!inner) break;
            const Octree::Depth& below = tree.depths[static_cast<size_t>(b) + 1];
            depth.octants.assign(depth.coarse.vertex_count(), 0);
            depth.leaves.assign(depth.coarse.vertex_count(), 0);
            for (size_t i = 0; i < below.cell_count(); i++) {
                const int32_t* p = &sample.positions[3 * below.first[i]];
                int shift = sample.bits - b - 1;
                int octant = (p[0] >> shift & 1) << 2 | (p[1] >> shift & 1) << 1 | (p[2] >> shift & 1);
                depth.octants[below.parents[i]] |= static_cast<uint8_t>(1 << octant);
                if (below.is_leaf(i)) depth.leaves[below.parents[i]] |= static_cast<uint8_t>(1 << octant);
            }
            depths.push_back(std::move(depth));
        }
        for (size_t i = 0; i < depths.size(); i++) {
            fine.emplace_back(*budget);
            tree.make_level(static_cast<int>(i) + 1, fine.back(), *budget);
        }
    }

    Sample sample;
    bool trained = false;
    std::unique_ptr<Budget> budget = std::make_unique<Budget>(8ull << 30);
    MapOptions options;
    std::vector<Depth> depths;
    std::vector<Level> fine;
};

bool equal(const Level& a, const Level& b) {
    if (a.vertex_count() != b.vertex_count()) return false;
    for (size_t v = 0; v < a.vertex_count(); v++) {
        if (a.leaves[v] != b.leaves[v] || a.cell_depths[v] != b.cell_depths[v] || a.parents[v] != b.parents[v])
            return false;
        for (int k = 0; k < 4; k++)
            if (a.centres[v][k] != b.centres[v][k]) return false;
    }
    return true;
}

template <Effort effort>
struct Watcher {
    [[maybe_unused]] static constexpr bool encoding = true;
    struct Seen {
        MapQuestion<effort> question;
        uint32_t bit;
    };
    std::vector<Seen> seen;
    void watch(const MapQuestion<effort>& question, uint32_t bit) { seen.push_back({question, bit}); }
};

struct Cost {
    [[maybe_unused]] static constexpr bool encoding = true;
    double bits = 0;
    int code(uint32_t p, int bit) {
        bits -= std::log2((bit != 0 ? p : 65536 - p) / 65536.0);
        return bit;
    }
};

// Contexts start from counts over the meshes; weights learn by coding each mesh, its contexts trained on the others.
template <Effort effort>
void train(std::vector<Mesh>& meshes, MapModel<effort>& model, int rounds) {
    typedef typename MapShape<effort>::Mix Mix;
    constexpr size_t contexts = MapPlaces<effort>::contexts;
    typedef std::vector<std::array<float, 2>> Counts;
    std::vector<Watcher<effort>> seen;
    std::vector<Counts> counts;
    Counts all(contexts);
    for (Mesh& mesh : meshes) {
        if (!mesh.trained) continue;
        Watcher<effort> watcher;
        Level fine(*mesh.budget);
        for (Depth& depth : mesh.depths)
            code_map<effort>(watcher, mesh.options, model, depth.coarse, fine,
                             {depth.octants.span(), depth.leaves.span()});
        counts.emplace_back(contexts);
        for (auto& s : watcher.seen)
            for (uint32_t place : s.question.contexts) counts.back()[place][s.bit]++, all[place][s.bit]++;
        seen.push_back(std::move(watcher));
    }
    auto start = [&](const Counts* without) {
        for (size_t c = 0; c < contexts; c++) {
            float zeros = all[c][0], ones = all[c][1];
            if (without != nullptr) zeros -= (*without)[c][0], ones -= (*without)[c][1];
            float n = zeros + ones, p = (ones + 0.4f) / (n + 0.8f);
            Context& context = model.contexts[c] = Context{};
            if (n < (effort == Effort::standard ? 16 : 6)) continue;
            p = std::min(std::max(p, 0.002f), 0.998f);
            int step = std::min(31, std::max(0, static_cast<int>(std::floor(std::log(p / (1 - p)) * 2)) + 16));
            context.slow = context.fast = LOGISTIC.squash[static_cast<size_t>(128 * step + 64)];
            context.slow_rate = static_cast<uint16_t>(n >= 16 ? MapModel<effort>::SETTLED_RATE : n >= 6 ? 8192 : 13107);
            context.fast_rate = std::max(context.slow_rate, FASTEST_FLOOR);
        }
    };
    for (size_t i = 0; i < model.weights.size(); i++) {
        size_t lane = i % Mix::lanes;
        model.weights[i] = static_cast<int16_t>(
            lane < Mix::lanes - 8 && lane % 16 < 4 ? 0.3 * WEIGHT_ONE * 4 / Mix::context_count : 0);
    }
    std::vector<double> sums(model.weights.size()), final_sums(model.final_weights.size());
    int added = 0;
    for (int round = 0; round < rounds; round++) {
        double bits = 0;
        for (size_t k = 0; k < seen.size(); k++) {
            start(&counts[k]);
            Mix mixer(model.states());
            Cost cost;
            for (auto& s : seen[k].seen) mixer.code(cost, s.question, static_cast<int>(s.bit));
            bits += cost.bits;
            if (round + 3 < rounds) continue;
            for (size_t i = 0; i < sums.size(); i++) sums[i] += model.weights[i];
            for (size_t i = 0; i < final_sums.size(); i++) final_sums[i] += model.final_weights[i];
            added++;
        }
        std::printf("round %d: %.0f bytes\n", round, bits / 8);
    }
    if (added > 0) {
        for (size_t i = 0; i < sums.size(); i++) model.weights[i] = static_cast<int16_t>(std::lround(sums[i] / added));
        for (size_t i = 0; i < final_sums.size(); i++)
            model.final_weights[i] = static_cast<int16_t>(std::lround(final_sums[i] / added));
    }
    start(nullptr);
}

template <Effort effort>
void run(std::vector<Mesh>& meshes, const Arguments& arguments,
         const std::map<std::string, std::array<int, 2>>& yardsticks) {
    const char* name = effort == Effort::standard ? "default" : "high";
    std::string path = arguments.states + "/map-" + name + ".states";
    Budget budget(8ull << 30);
    MapModel<effort> trained(budget);
    if (arguments.rounds > 0) {
        train(meshes, trained, arguments.rounds);
        Array<uint8_t> bytes(budget);
        RangeEncoder coder(bytes);
        trained.code_states(coder, budget);
        coder.finish();
        FILE* file = std::fopen(path.c_str(), "wb");
        if (file == nullptr || std::fwrite(bytes.begin(), 1, bytes.size(), file) != bytes.size()) std::exit(2);
        std::fclose(file);
    }
    {
        FILE* file = std::fopen(path.c_str(), "rb");
        std::vector<uint8_t> bytes(1 << 20);
        if (file == nullptr) std::exit(2);
        bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file));
        std::fclose(file);
        RangeDecoder coder({bytes.data(), bytes.size()});
        trained.code_states(coder, budget);
        std::printf("effort %s: %zu bytes of states, %zu contexts, %zu neurons\n", name, bytes.size(),
                    trained.contexts.size(), trained.weights.size() / MapShape<effort>::Mix::lanes);
    }
    auto restart = [&](MapModel<effort>& model) {
        model.contexts.copy(trained.contexts.span());
        model.weights.copy(trained.weights.span());
        model.final_weights.copy(trained.final_weights.span());
    };
    double logs = 0, untrained_logs = 0;
    int twelve = 0, untrained = 0;
    uint64_t digest = 1469598103934665603u;
    MapModel<effort> model(budget);
    Level fine(budget);
    for (Mesh& mesh : meshes) {
        size_t bytes = 0, cells = 0;
        restart(model);
        for (Depth& depth : mesh.depths) {
            RangeEncoder coder(depth.payload);
            code_map<effort>(coder, mesh.options, model, depth.coarse, fine,
                             {depth.octants.span(), depth.leaves.span()});
            coder.finish();
            bytes += depth.payload.size();
            for (uint8_t leaf : depth.coarse.leaves) cells += leaf == 0;
            for (uint8_t byte : depth.payload) digest = (digest ^ byte) * 1099511628211u;
        }
        double best = 1e9;
        for (int r = 0; r < arguments.runs; r++) {
            restart(model);
            double time = 0;
            for (size_t i = 0; i < mesh.depths.size(); i++) {
                Depth& depth = mesh.depths[i];
                double from = seconds();
                RangeDecoder coder(depth.payload.span());
                code_map<effort>(coder, mesh.options, model, depth.coarse, fine);
                coder.finish();
                time += seconds() - from;
                if (r == 0 && !equal(fine, mesh.fine[i])) {
                    std::printf("%s: depth %zu decodes to something else\n", mesh.sample.name.c_str(), i);
                    std::exit(1);
                }
            }
            best = std::min(best, time);
        }
        auto yardstick = yardsticks.find(mesh.sample.name);
        int today = yardstick == yardsticks.end() ? 0 : yardstick->second[effort == Effort::high];
        double ratio = today != 0 ? static_cast<double>(bytes) / today : 1;
        bool of_twelve = mesh.sample.mirror_sum >= 0 && today != 0;
        for (const char* glb : {"cannon", "emoji_heart", "frostAxe_noMorph", "greySnapper_vertColor", "marineGround",
                                "riggedMesh", "runeSword", "seagulf", "sword_noMat", "underwaterScene"})
            of_twelve &= mesh.sample.name != glb;
        if (of_twelve) logs += std::log(ratio), twelve++;
        if (!mesh.trained) untrained_logs += std::log(ratio), untrained++;
        std::printf("%-22s%s %8zu bytes, today %6d, %.4f  %8.2f ms, %5.0f ns a cell\n", mesh.sample.name.c_str(),
                    mesh.trained ? "*" : " ", bytes, today, ratio, best * 1e3, best * 1e9 / static_cast<double>(cells));
        if (arguments.verbose) {
            for (Depth& depth : mesh.depths) std::printf(" %zu", depth.payload.size());
            std::printf("\n");
        }
    }
    std::printf("%s: geometric mean of today's: the twelve %.4f, untrained %.4f; digest %016llx\n", name,
                std::exp(logs / twelve), std::exp(untrained_logs / untrained), static_cast<unsigned long long>(digest));

    uint64_t random = 88172645463325252u;
    int refused = 0;
    for (int d = 0; d < arguments.damages; d++) {
        auto next = [&] { return random ^= random << 13, random ^= random >> 7, random ^= random << 17; };
        Mesh& mesh = meshes[next() % meshes.size()];
        Depth& depth = mesh.depths[next() % mesh.depths.size()];
        Budget small(64ull << 20);
        Array<uint8_t> damaged(small);
        damaged.copy(depth.payload.span());
        if (damaged.empty()) continue;
        if (next() % 4 == 0) damaged.resize(next() % damaged.size());
        for (uint64_t flips = next() % 8 + 1; flips > 0 && !damaged.empty(); flips--)
            damaged[next() % damaged.size()] ^= static_cast<uint8_t>(1 << next() % 8);
        restart(model);
        Level level(small), coarse(small);
        coarse.depth = depth.coarse.depth;
        coarse.centres.copy(depth.coarse.centres.span());
        coarse.cell_depths.copy(depth.coarse.cell_depths.span());
        coarse.leaves.copy(depth.coarse.leaves.span());
        coarse.corners.copy(depth.coarse.corners.span());
        if (next() % 4 == 0) // faces that no encoder made
            for (int32_t& corner : coarse.corners)
                if (next() % 3 != 0) corner = static_cast<int32_t>(next() % coarse.vertex_count());
        link(coarse, small);
        try {
            RangeDecoder coder(damaged.span());
            code_map<effort>(coder, mesh.options, model, coarse, level);
            if (level.vertex_count() > mesh.options.vertices) std::abort();
            coder.finish();
        } catch (const Failure& failure) {
            refused++;
            if (failure.fault != Fault::malformed) {
                std::printf("damage %d: %s\n", d, failure.text);
                std::exit(1);
            }
        }
    }
    if (arguments.damages > 0) std::printf("%d damaged payloads, %d refused\n", arguments.damages, refused);
}

} // namespace

int main(int count, char** values) {
    Arguments arguments;
    for (int i = 1; i < count; i++) {
        std::string value = values[i];
        if (value == "-t")
            arguments.rounds = std::atoi(values[++i]);
        else if (value == "-s")
            arguments.states = values[++i];
        else if (value == "-e")
            arguments.effort = values[++i];
        else if (value == "-r")
            arguments.runs = std::atoi(values[++i]);
        else if (value == "-d")
            arguments.damages = std::atoi(values[++i]);
        else if (value == "-v")
            arguments.verbose = true;
        else
            arguments.meshes.push_back(value);
    }
    std::map<std::string, std::array<int, 2>> yardsticks; // Map bytes of today, default and high
    if (FILE* file = std::fopen((SAMPLES + "baseline.txt").c_str(), "r")) {
        char line[4096], name[256];
        while (std::fgets(line, sizeof line, file) != nullptr) {
            if (std::sscanf(line, "%255s", name) != 1) continue;
            const char* first = std::strstr(line, "'Map': ");
            const char* high = std::strstr(line, " high ");
            const char* second = high == nullptr ? nullptr : std::strstr(high, "'Map': ");
            if (first != nullptr && second != nullptr) yardsticks[name] = {std::atoi(first + 7), std::atoi(second + 7)};
        }
        std::fclose(file);
    }
    std::vector<Mesh> meshes;
    for (const std::string& path : arguments.meshes) meshes.emplace_back(path);
    if (arguments.effort != "high") run<Effort::standard>(meshes, arguments, yardsticks);
    if (arguments.effort != "default") run<Effort::high>(meshes, arguments, yardsticks);
    return 0;
}
