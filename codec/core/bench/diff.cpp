// Bench of the Diff layer: sizes, times, training, damage.
//
//   diff [-e standard|high] [-s states] [-l slices] [-r runs] [-z damages] [mesh ...]    default: the twelve
//   diff -t rounds [-e ...] [-s states] mesh ...                                         trains and writes states
#include "diff/code_diff.hpp"
#include "layers.hpp"

#include <algorithm>
#include <cmath>
#include <map>

using namespace meshtide;

namespace {

const std::vector<std::string> TWELVE = {"armadillo",  "beetle-alt", "casting",        "fandisk",
                                         "harley",     "homer",      "horse-quad",     "nefertiti-rgb",
                                         "rocker-arm", "spot",       "stanford-bunny", "truck"};
constexpr uint64_t PLENTY = 1ull << 32;
constexpr size_t SMALL_PACKET = 64; // bytes below which a bit plane waits for the next one

struct Mesh {
    explicit Mesh(const std::string& name)
        : sample(load_sample(name.find('/') == std::string::npos ? SAMPLES + name + ".mesh" : name)), budget(PLENTY),
          octree({sample.positions.data(), sample.positions.size()}, {sample.faces.data(), sample.faces.size()},
                 sample.bits, budget) {
        for (int b = 0; b <= sample.bits; b++) {
            levels.push_back(std::make_unique<Level>(budget));
            octree.make_level(b, *levels.back(), budget);
            if (std::all_of(levels.back()->leaves.begin(), levels.back()->leaves.end(), [](int l) { return l != 0; }))
                break;
        }
    }
    const Level& level(int depth) const { return *levels[std::min(static_cast<size_t>(depth), levels.size() - 1)]; }
    std::vector<SliceRange> ranges(int count) const {
        std::vector<SliceRange> all;
        uint64_t end = 1ull << (3 * sample.bits);
        size_t n = sample.positions.size() / 3;
        for (int i = 0; i < count; i++) {
            uint64_t first = 0;
            size_t v = n * static_cast<size_t>(i) / static_cast<size_t>(count);
            for (int b = sample.bits - 1; b >= 0; b--)
                for (size_t k = 0; k < 3; k++) first = first << 1 | (sample.positions[3 * v + k] >> b & 1);
            if (i == 0) first = 0;
            if (!all.empty()) all.back().end = first;
            all.push_back({sample.bits, first, end});
        }
        return all;
    }

    Sample sample;
    Budget budget;
    Octree octree;
    std::vector<std::unique_ptr<Level>> levels;
};

struct Packet {
    int depth; // of its last bit plane
    std::vector<uint8_t> bytes;
};
using Packets = std::vector<Packet>;
size_t size_of(const Packets& packets) {
    size_t bytes = 0;
    for (const Packet& packet : packets) bytes += packet.bytes.size();
    return bytes;
}

template <Effort effort>
struct Bench {
    using Model = DiffModel<effort>;
    using Shape = DiffShape<effort>;
    Budget model_budget{PLENTY};
    Model trained{model_budget};

    void read(const std::string& path) {
        std::vector<uint8_t> bytes(1 << 20);
        FILE* file = std::fopen(path.c_str(), "rb");
        if (file == nullptr) {
            std::fprintf(stderr, "no states in %s\n", path.c_str());
            return;
        }
        bytes.resize(std::fread(bytes.data(), 1, bytes.size(), file));
        std::fclose(file);
        RangeDecoder coder({bytes.data(), bytes.size()});
        StatesModel states(model_budget);
        trained.code_states(coder, states);
        coder.finish();
    }
    void write(const std::string& path) {
        Array<uint8_t> bytes(model_budget);
        RangeEncoder coder(bytes);
        StatesModel states(model_budget);
        trained.code_states(coder, states);
        coder.finish();
        std::fprintf(stderr, "%zu bytes of states\n", bytes.size());
        FILE* file = std::fopen(path.c_str(), "wb");
        std::fwrite(bytes.begin(), 1, bytes.size(), file);
        std::fclose(file);
    }
    Model start() {
        Model model(model_budget);
        model.copy(trained);
        return model;
    }

    static Packets encode(const Mesh& mesh, SliceRange range, Model& model) {
        Budget budget(PLENTY);
        DiffSlice slice(budget, range, {mesh.sample.mirror_axis, mesh.sample.mirror_sum});
        slice.enter(mesh.level(0));
        Packets packets;
        Array<uint8_t> bytes(budget);
        auto coder = std::make_unique<RangeEncoder>(bytes);
        int entered = 0;
        for (int b = 1; b <= mesh.sample.bits; b++) {
            const Level& level = mesh.level(b);
            if (level.depth != entered) slice.enter(level);
            entered = level.depth;
            const auto& depth = mesh.octree.depths[static_cast<size_t>(level.depth)];
            code_diff(*coder, b, slice, model, {mesh.octree.positions, depth.first.span()});
            if (b == mesh.sample.bits || coder->size() >= SMALL_PACKET) {
                coder->finish();
                packets.push_back({b, {bytes.begin(), bytes.end()}});
                coder = std::make_unique<RangeEncoder>(bytes);
            }
        }
        return packets;
    }

    double enter_seconds = 0, code_seconds = 0;
    // Whether the positions are those of the mesh; and that it is known to what depth each is, on the way.
    bool decode(const Mesh& mesh, SliceRange range, Model& model, const Packets& packets, bool check, bool telling) {
        Budget budget(PLENTY);
        DiffSlice slice(budget, range, {mesh.sample.mirror_axis, mesh.sample.mirror_sum});
        slice.enter(mesh.level(0));
        Array<F32x4> known(budget);
        int entered = 0, depth = 0;
        bool good = true;
        enter_seconds = code_seconds = 0;
        auto agrees = [&](const Level& level) {
            known.resize(level.vertex_count());
            slice.tell(level, known.span());
            const auto& cells = mesh.octree.depths[static_cast<size_t>(level.depth)].first;
            DiffSlice::Run run = slice.run_of(level);
            for (size_t v = run.first; v < run.end; v++) {
                bool told = level.leaves[v] != 0 && level.cell_depths[v] <= slice.known_depth();
                int deep = told ? slice.known_depth() : level.cell_depths[v], shift = mesh.sample.bits - deep;
                if (known[v][3] != static_cast<float>(deep)) return false;
                for (int k = 0; k < 3; k++) {
                    int32_t cell = mesh.sample.positions[3 * cells[v] + static_cast<size_t>(k)] >> shift;
                    if (known[v][k] != static_cast<float>((2 * cell + 1) << shift)) return false;
                }
            }
            return true;
        };
        for (const Packet& packet : packets) {
            RangeDecoder coder({packet.bytes.data(), packet.bytes.size()});
            while (depth < packet.depth) {
                const Level& level = mesh.level(++depth);
                double start = seconds();
                if (level.depth != entered) slice.enter(level);
                entered = level.depth;
                double middle = seconds();
                code_diff(coder, depth, slice, model);
                enter_seconds += middle - start;
                code_seconds += seconds() - middle;
                if (telling)
                    for (const auto& any : mesh.levels) good = good && agrees(*any);
            }
            coder.finish();
        }
        return good && (!check || agrees(*mesh.levels.back()));
    }

    // Training, round by round: each mesh is coded from the same states, and these become the mean of what the meshes
    // have left, each context by its visits.
    void train(const std::vector<std::unique_ptr<Mesh>>& meshes, int rounds) {
        size_t count = trained.contexts.size();
        std::vector<double> probability(count, 0.5), certainty(count, 0);
        std::vector<double> fine(trained.weights.begin(), trained.weights.end());
        std::vector<double> final_fine(trained.final_weights.begin(), trained.final_weights.end());
        std::vector<double> visits_of(count);
        const double least_visits = effort == Effort::high ? 12 : 24; // for what is worth its bytes
        const size_t WEIGHTS = fine.size(), FINAL_WEIGHTS = final_fine.size();
        for (int round = 0; round < rounds; round++) {
            size_t bytes = 0;
            std::vector<double> visits(count), sums(count), squares(count);
            std::vector<double> weight_sums(WEIGHTS), weight_counts(WEIGHTS), final_sums(FINAL_WEIGHTS),
                final_counts(FINAL_WEIGHTS);
            for (const auto& mesh : meshes) {
                Model model(model_budget);
                for (size_t i = 0; i < count; i++) {
                    double p = std::clamp(probability[i] * 65536, 64.0, 65472.0);
                    Context fresh;
                    fresh.slow = fresh.fast = static_cast<uint16_t>(p);
                    model.contexts[i] = fresh;
                }
                for (size_t i = 0; i < WEIGHTS; i++) model.weights[i] = static_cast<int16_t>(std::lrint(fine[i]));
                for (size_t i = 0; i < FINAL_WEIGHTS; i++)
                    model.final_weights[i] = static_cast<int16_t>(std::lrint(final_fine[i]));
                bytes += size_of(encode(*mesh, mesh->ranges(1)[0], model));
                for (size_t i = 0; i < count; i++) {
                    double n = std::clamp(65536.0 / model.contexts[i].slow_rate - 2, 0.0, 200.0);
                    double p = model.contexts[i].slow / 65536.0;
                    if (n < 0.5) n = 0;
                    visits[i] += n, sums[i] += n * p, squares[i] += n * p * p;
                }
                for (size_t i = 0; i < WEIGHTS; i++)
                    if (model.weights[i] != std::lrint(fine[i]))
                        weight_sums[i] += model.weights[i], weight_counts[i] += 1;
                for (size_t i = 0; i < FINAL_WEIGHTS; i++)
                    if (model.final_weights[i] != std::lrint(final_fine[i]))
                        final_sums[i] += model.final_weights[i], final_counts[i] += 1;
            }
            for (size_t i = 0; i < count; i++) {
                certainty[i] = 0;
                if (visits[i] == 0) continue;
                double mean = (sums[i] + 0.5) / (visits[i] + 1), raw = sums[i] / visits[i];
                double scatter = std::max(squares[i] / visits[i] - raw * raw, 1e-6);
                probability[i] = mean;
                certainty[i] = std::max(std::min(mean * (1 - mean) / scatter - 1, visits[i] / 4), 1.0);
            }
            for (size_t i = 0; i < WEIGHTS; i++)
                if (weight_counts[i] > 0) fine[i] = weight_sums[i] / weight_counts[i];
            for (size_t i = 0; i < FINAL_WEIGHTS; i++)
                if (final_counts[i] > 0) final_fine[i] = final_sums[i] / final_counts[i];
            visits_of = visits;
            std::fprintf(stderr, "round %d: %zu bytes\n", round, bytes);
        }
        for (size_t i = 0; i < count; i++) {
            if (certainty[i] == 0 || visits_of[i] < least_visits) continue;
            Context& context = trained.contexts[i];
            context.slow = static_cast<uint16_t>(std::clamp(probability[i] * 65536, 64.0, 65472.0));
            context.slow_rate = static_cast<uint16_t>(65536 / (2 + std::min(certainty[i], 30.0)));
        }
        for (size_t i = 0; i < WEIGHTS; i++) trained.weights[i] = static_cast<int16_t>(std::lrint(fine[i]));
        for (size_t i = 0; i < FINAL_WEIGHTS; i++)
            trained.final_weights[i] = static_cast<int16_t>(std::lrint(final_fine[i]));
    }

    // Damaged payloads end in a failure or in other positions.
    void damage(const Mesh& mesh, const std::vector<SliceRange>& ranges, const std::vector<Packets>& coded, int count) {
        uint32_t random = 12345;
        auto next = [&](size_t below) {
            random = random * 1664525 + 1013904223;
            return static_cast<size_t>(random >> 8) % below;
        };
        int refused = 0;
        for (int i = 0; i < count; i++) {
            size_t which = next(ranges.size());
            Packets packets = coded[which];
            for (size_t flips = 1 + next(4); flips > 0; flips--) {
                auto& bytes = packets[next(packets.size())].bytes;
                if (!bytes.empty()) bytes[next(bytes.size())] ^= static_cast<uint8_t>(1 << next(8));
                if (next(8) == 0) bytes.resize(next(bytes.size() + 8));
            }
            Model model = start();
            try {
                decode(mesh, ranges[which], model, packets, false, false);
            } catch (const Failure& failure) {
                if (failure.fault != Fault::malformed) std::printf("  fault: %s\n", failure.text);
                refused++;
            }
        }
        std::printf("%-22s %d of %d damaged streams refused\n", mesh.sample.name.c_str(), refused, count);
    }
};

std::map<std::string, std::pair<double, double>> todays_sizes() { // default, high
    std::map<std::string, std::pair<double, double>> sizes;
    FILE* file = std::fopen((SAMPLES + "baseline.txt").c_str(), "r");
    if (file == nullptr) return sizes;
    char line[4096];
    while (std::fgets(line, sizeof line, file) != nullptr) {
        std::string text = line, name = text.substr(0, text.find(' '));
        size_t first = text.find("'Diff': "), second = text.find("'Diff': ", text.find(" high "));
        if (first == std::string::npos || second == std::string::npos) continue;
        sizes[name] = {std::atof(line + first + 8), std::atof(line + second + 8)};
    }
    std::fclose(file);
    return sizes;
}

struct Arguments {
    Effort effort = Effort::standard;
    std::string states;
    int rounds = 0, slices = 1, runs = 0, damages = 0;
    std::vector<std::string> meshes;
};

template <Effort effort>
void run(Arguments arguments) {
    Bench<effort> bench;
    if (arguments.rounds > 0) {
        std::vector<std::unique_ptr<Mesh>> meshes;
        for (const auto& name : arguments.meshes) meshes.push_back(std::make_unique<Mesh>(name));
        bench.train(meshes, arguments.rounds);
        bench.write(arguments.states);
        return;
    }
    bench.read(arguments.states);
    auto today = todays_sizes();
    if (arguments.meshes.empty()) arguments.meshes = TWELVE;
    double to_default = 0, to_high = 0;
    for (const auto& name : arguments.meshes) {
        Mesh mesh(name);
        std::vector<SliceRange> ranges = mesh.ranges(arguments.slices);
        std::vector<Packets> coded;
        size_t bytes = 0;
        bool good = true;
        double best = 1e9, entering = 0;
        uint32_t sum = 0;
        for (SliceRange range : ranges) {
            auto model = bench.start(), other = bench.start();
            coded.push_back(Bench<effort>::encode(mesh, range, model));
            bytes += size_of(coded.back());
            for (const Packet& packet : coded.back())
                for (uint8_t byte : packet.bytes) sum = (sum ^ byte) * 16777619u;
            good = good && bench.decode(mesh, range, other, coded.back(), true, arguments.slices > 1);
        }
        for (int i = 0; i < arguments.runs; i++) {
            double all = 0, enter = 0;
            for (size_t k = 0; k < ranges.size(); k++) {
                auto model = bench.start();
                bench.decode(mesh, ranges[k], model, coded[k], false, false);
                all += bench.enter_seconds + bench.code_seconds;
                enter += bench.enter_seconds;
            }
            if (all < best) best = all, entering = enter;
        }
        auto [size_default, size_high] = today[name];
        double size = static_cast<double>(bytes);
        to_default += std::log(size / size_default);
        to_high += std::log(size / size_high);
        std::printf("%-22s %s %7zu bytes, %.4f of default, %.4f of high, hash %08x", name.c_str(),
                    good ? "good" : "WRONG", bytes, size / size_default, size / size_high, sum);
        if (arguments.runs > 0) std::printf(", %.2f ms (%.2f of them to enter levels)", best * 1e3, entering * 1e3);
        std::printf("\n");
        if (arguments.damages > 0) bench.damage(mesh, ranges, coded, arguments.damages);
        std::fflush(stdout);
    }
    double count = static_cast<double>(arguments.meshes.size());
    std::printf("mean: %.4f of default, %.4f of high\n", std::exp(to_default / count), std::exp(to_high / count));
}

} // namespace

int main(int argc, char** argv) {
    Arguments arguments;
    for (int i = 1; i < argc; i++) {
        std::string option = argv[i];
        if (option[0] != '-') {
            arguments.meshes.push_back(option);
            continue;
        }
        if (++i == argc) return 2;
        if (option == "-e")
            arguments.effort = std::string(argv[i]) == "high" ? Effort::high : Effort::standard;
        else if (option == "-s")
            arguments.states = argv[i];
        else if (option == "-l")
            arguments.slices = std::atoi(argv[i]);
        else if (option == "-r")
            arguments.runs = std::atoi(argv[i]);
        else if (option == "-z")
            arguments.damages = std::atoi(argv[i]);
        else if (option == "-t")
            arguments.rounds = std::atoi(argv[i]);
        else
            return 2;
    }
    bool high = arguments.effort == Effort::high;
    if (arguments.states.empty()) arguments.states = high ? "diff-high.states" : "diff-standard.states";
    high ? run<Effort::high>(arguments) : run<Effort::standard>(arguments);
}
