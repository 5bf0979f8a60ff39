// Bench of the faces layer: bytes, time (-r runs), training (-t, -q: in few steps), odd meshes (-o), damage (-z
// rounds). -s: the file of states, as codec/core/states/faces-*.bin.xz, unpacked; -h: effort high; -c: without
// positions; -12: the twelve meshes; -glb: three that nothing is trained on.
#include "faces/faces.hpp"

#include "layers.hpp"

#include <cmath>
#include <map>

using namespace meshtide;

namespace {

constexpr uint64_t PLENTY = 1ull << 34;

struct Bench {
    Sample sample;
    Budget budget{PLENTY};
    std::unique_ptr<Octree> octree;
    std::vector<std::unique_ptr<Level>> levels; // with centres, parents and first children
    int last = 0;                               // the last depth with faces to code
    explicit Bench(const std::string& path) : Bench(load_sample(path)) {}
    explicit Bench(Sample from) : sample(std::move(from)) {
        octree = std::make_unique<Octree>(Span<const int32_t>(sample.positions.data(), sample.positions.size()),
                                          Span<const int32_t>(sample.faces.data(), sample.faces.size()), sample.bits,
                                          budget);
        for (int b = 0; b <= sample.bits; b++) {
            levels.push_back(std::make_unique<Level>(budget));
            Array<int32_t> faces(budget); // levels get theirs from the layer itself
            faces.swap(octree->depths[static_cast<size_t>(b)].faces);
            octree->make_level(b, *levels.back(), budget);
            faces.swap(octree->depths[static_cast<size_t>(b)].faces);
            bool leaves = true;
            for (uint8_t leaf : levels.back()->leaves) leaves = leaves && leaf != 0;
            if (!leaves && b < sample.bits) last = b + 1;
        }
    }
    FacesTruth truth(int b) const { return {octree->depths[static_cast<size_t>(b)].faces.span()}; }
};

// Softmax regression over what an encoder chose among.
struct Trace {
    struct Choice {
        uint32_t first, count, wanted;
    };
    int terms = 0;
    std::vector<Choice> choices;
    std::vector<int32_t> places;
};
Trace* tracing = nullptr;

struct WatchingEncoder : RangeEncoder {
    using RangeEncoder::RangeEncoder;
    template <class Candidates>
    void watch(const Candidates& candidates, int wanted) {
        if (tracing == nullptr) return;
        Trace& trace = *tracing;
        trace.terms = Candidates::TERMS;
        Trace::Choice choice{static_cast<uint32_t>(trace.places.size()), 0, 0};
        for (int i = 0; i < candidates.lanes; i++) {
            if (candidates.score_of[i] == NO_SCORE) continue;
            if (i == wanted) choice.wanted = choice.count;
            choice.count++;
            for (int j = 0; j < Candidates::TERMS; j++) trace.places.push_back(candidates.places_of[j][i]);
        }
        trace.choices.push_back(choice);
    }
};

template <Effort effort, bool positions>
struct Layer {
    using Model = FacesModel<effort, positions>;
    std::vector<Array<uint8_t>> payloads;
    Budget budget{PLENTY};

    template <class Encoder>
    void encode(Bench& bench, Model& model, FacesMemory& memory) {
        payloads.clear();
        payloads.reserve(64);
        for (int b = 1; b <= bench.last; b++) {
            payloads.emplace_back(budget);
            Encoder coder(payloads.back());
            auto& levels = bench.levels;
            FacesTask task{bench.sample.bits, bench.sample.faces.size() / 3, bench.truth(b)};
            if (b == 1) levels[0]->corners.clear();
            code_faces<effort, positions>(coder, *levels[static_cast<size_t>(b - 1)], *levels[static_cast<size_t>(b)],
                                          model, memory, task);
            coder.finish();
        }
    }
    size_t bytes() const {
        size_t sum = 0;
        for (auto& p : payloads) sum += p.size();
        return sum;
    }
    void decode(Bench& bench, Model& model, FacesMemory& memory) {
        for (int b = 1; b <= bench.last; b++) {
            RangeDecoder coder(payloads[static_cast<size_t>(b - 1)].span());
            auto& levels = bench.levels;
            FacesTask task{bench.sample.bits, bench.sample.faces.size() / 3, {}};
            if (b == 1) levels[0]->corners.clear();
            code_faces<effort, positions>(coder, *levels[static_cast<size_t>(b - 1)], *levels[static_cast<size_t>(b)],
                                          model, memory, task);
        }
    }
    bool check(Bench& bench) {
        for (int b = 1; b <= bench.last; b++) {
            Level& level = *bench.levels[static_cast<size_t>(b)];
            std::vector<std::array<int32_t, 3>> faces;
            for (size_t t = 0; t < level.face_count(); t++) {
                int32_t a = level.corners[4 * t], c = level.corners[4 * t + 1], d = level.corners[4 * t + 2];
                if (c < a && c < d)
                    faces.push_back({c, d, a});
                else if (d < a && d < c)
                    faces.push_back({d, a, c});
                else
                    faces.push_back({a, c, d});
            }
            std::sort(faces.begin(), faces.end());
            auto truth = bench.truth(b).faces;
            if (truth.size() != 3 * faces.size()) return false;
            for (size_t i = 0; i < truth.size(); i++)
                if (faces[i / 3][i % 3] != truth[i]) return false;
            for (size_t t = 0; t < level.face_count(); t++)
                for (size_t h = 4 * t; h < 4 * t + 3; h++) {
                    int32_t twin = level.twins[h];
                    if (twin == NONE) continue;
                    if (twin < 0 || level.twins[static_cast<size_t>(twin)] != static_cast<int32_t>(h)) return false;
                    int32_t n = next_half_edge(static_cast<int32_t>(h)), m = next_half_edge(twin);
                    if (level.corners[static_cast<size_t>(n)] != level.corners[static_cast<size_t>(twin)]) return false;
                    if (level.corners[static_cast<size_t>(m)] != level.corners[h]) return false;
                }
        }
        return true;
    }
};

const std::map<std::string, std::pair<int, int>> TODAY = {{"armadillo", {14022, 12403}},
                                                          {"beetle-alt", {9078, 7271}},
                                                          {"casting", {1897, 1461}},
                                                          {"fandisk", {1303, 1114}},
                                                          {"harley", {5513, 4511}},
                                                          {"homer", {2358, 1973}},
                                                          {"horse-quad", {761, 653}},
                                                          {"nefertiti-rgb", {5393, 4614}},
                                                          {"rocker-arm", {3252, 2925}},
                                                          {"spot", {758, 652}},
                                                          {"cannon", {791, 599}},
                                                          {"emoji_heart", {539, 468}},
                                                          {"frostAxe_noMorph", {1062, 889}},
                                                          {"greySnapper_vertColor", {1100, 880}},
                                                          {"marineGround", {542, 408}},
                                                          {"riggedMesh", {4311, 3598}},
                                                          {"runeSword", {1544, 1256}},
                                                          {"seagulf", {9166, 7476}},
                                                          {"sword_noMat", {1351, 1113}},
                                                          {"stanford-bunny", {8051, 6703}},
                                                          {"truck", {3037, 2548}},
                                                          {"underwaterScene", {25119, 20761}}};

template <class T>
void write_array(FILE* file, const Array<T>& array) {
    std::fwrite(array.begin(), sizeof(T), array.size(), file);
}
template <class T>
bool read_array(FILE* file, Array<T>& array) {
    return std::fread(array.begin(), sizeof(T), array.size(), file) == array.size();
}

bool coarsely = false;

// Trained states in few steps, so that they take little: log-odds in 31, weights in 32ths, scores in 4ths of doublings.
template <class Model>
void coarsen(Model& model) {
    const int finer = Model::high ? 4 : 1; // more terms make a score there
    const double steps = Model::high ? 2.2 : 1.6;
    for (Context& context : model.contexts) {
        if (context.slow_rate > 10000) { // hardly seen
            context = Context{};
            continue;
        }
        double p = (context.slow + 0.5) / 65536;
        double step = std::round(std::log(p / (1 - p)) * steps);
        step = std::max(-15.0, std::min(15.0, step));
        context.slow = context.fast = static_cast<uint16_t>(65536 / (1 + std::exp(-step / steps)));
        context.slow_rate = 65536 / 14, context.fast_rate = 65536 / 10;
    }
    auto rounded = [](int16_t x, int step) {
        int y = (x + (x < 0 ? -step : step) / 2) / step * step;
        return static_cast<int16_t>(std::max(-32767, std::min(32767, y)));
    };
    for (int16_t& w : model.weights) w = rounded(w, 512 / finer);
    for (int16_t& w : model.final_weights) w = rounded(w, 512 / finer);
    for (int16_t& score : model.scores) score = rounded(score, 256 / finer);
}

template <Effort effort, bool positions>
int run(std::vector<std::string> names, bool train, int runs, const std::string& states, int epochs) {
    using L = Layer<effort, positions>;
    using Model = typename L::Model;
    Budget budget(PLENTY);
    Model start(budget);
    if (!train || epochs < 0) {
        if (FILE* file = std::fopen(states.c_str(), "rb")) {
            if (!(read_array(file, start.scores) && read_array(file, start.contexts) &&
                  read_array(file, start.weights) && read_array(file, start.final_weights)))
                std::printf("states do not fit\n");
            std::fclose(file);
        }
    }
    std::vector<std::unique_ptr<Bench>> benches;
    for (auto& name : names) benches.push_back(std::make_unique<Bench>(SAMPLES + name + ".mesh"));
    FacesMemory memory(budget);
    if (train) {
        Trace trace;
        std::vector<float> scores(start.scores.size());
        for (int round = 0; round < 2; round++) {
            trace.choices.clear();
            trace.places.clear();
            tracing = &trace;
            for (auto& bench : benches) {
                L layer;
                Model model(budget);
                model.copy(start);
                layer.template encode<WatchingEncoder>(*bench, model, memory);
            }
            tracing = nullptr;
            auto terms = static_cast<size_t>(trace.terms);
            std::vector<size_t> order(trace.choices.size());
            for (size_t i = 0; i < order.size(); i++) order[i] = i;
            uint64_t seed = 1;
            for (int epoch = 0; epoch < epochs; epoch++) {
                float slower = 5 / static_cast<float>(terms);
                float rate = slower * (epoch < epochs / 3 ? 0.08f : epoch < 2 * epochs / 3 ? 0.03f : 0.01f);
                for (size_t i = order.size(); i > 1; i--) {
                    seed = seed * 6364136223846793005ull + 1442695040888963407ull;
                    std::swap(order[i - 1], order[(seed >> 33) % i]);
                }
                double bits = 0;
                std::vector<float> w;
                for (size_t o : order) {
                    auto& c = trace.choices[o];
                    const int32_t* p = trace.places.data() + c.first;
                    w.assign(c.count, 0);
                    float most = -1e9f, sum = 0;
                    for (uint32_t i = 0; i < c.count; i++) {
                        for (size_t j = 0; j < terms; j++) w[i] += scores[static_cast<size_t>(p[i * terms + j])];
                        most = std::max(most, w[i]);
                    }
                    for (uint32_t i = 0; i < c.count; i++) sum += w[i] = std::exp(w[i] - most);
                    bits -= std::log2(std::max(1e-9f, w[c.wanted] / sum));
                    for (uint32_t i = 0; i < c.count; i++) {
                        float step = rate * ((i == c.wanted ? 1.0f : 0.0f) - w[i] / sum);
                        for (size_t j = 0; j < terms; j++) {
                            float& score = scores[static_cast<size_t>(p[i * terms + j])];
                            score += step - rate * 0.0002f * score;
                        }
                    }
                }
                if (epoch % 4 == epochs % 4 || epoch + 1 == epochs)
                    std::printf("epoch %d: %.0f bytes in %zu choices\n", epoch, bits / 8, trace.choices.size());
            }
            for (size_t i = 0; i < scores.size(); i++) {
                float nat = std::round(scores[i] * 1477.3f / 64) * 64;
                start.scores[i] = static_cast<int16_t>(std::max(-32000.0f, std::min(32000.0f, nat)));
            }
        }
        for (int round = 0; round < 3; round++) {
            size_t sum = 0;
            for (auto& bench : benches) {
                L layer;
                Model model(budget);
                model.copy(start);
                layer.template encode<RangeEncoder>(*bench, model, memory);
                start.contexts.copy(model.contexts.span());
                start.weights.copy(model.weights.span());
                start.final_weights.copy(model.final_weights.span());
                sum += layer.bytes();
            }
            std::printf("round %d: %zu bytes\n", round, sum);
            // Rates as after so many decisions.
            for (Context& context : start.contexts) {
                context.slow_rate = std::max<uint16_t>(context.slow_rate, 65536 / 14);
                context.fast_rate = std::max<uint16_t>(context.fast_rate, 65536 / 10);
            }
        }
        if (coarsely) coarsen(start);
        FILE* file = std::fopen(states.c_str(), "wb");
        write_array(file, start.scores), write_array(file, start.contexts), write_array(file, start.weights);
        write_array(file, start.final_weights);
        std::fclose(file);
        return 0;
    }
    double product = 0;
    int rated = 0;
    size_t total = 0;
    for (auto& bench : benches) {
        L layer;
        Model model(budget);
        model.copy(start);
        double time = seconds();
        layer.template encode<RangeEncoder>(*bench, model, memory);
        double encoding = seconds() - time, best = 1e9;
        bool good = layer.check(*bench);
        for (int r = 0; r < runs; r++) {
            model.copy(start);
            time = seconds();
            layer.decode(*bench, model, memory);
            best = std::min(best, seconds() - time);
            if (r == 0) good = good && layer.check(*bench);
        }
        std::printf("%-22s %s %6zu", bench->sample.name.c_str(), good ? "ok" : "WRONG", layer.bytes());
        auto today = TODAY.find(bench->sample.name);
        if (today != TODAY.end()) {
            int yardstick = effort == Effort::standard ? today->second.first : today->second.second;
            double ratio = static_cast<double>(layer.bytes()) / yardstick;
            std::printf(" / %6d = %.3f", yardstick, ratio);
            product += std::log(ratio), rated++;
        }
        std::printf("  encode %.0f ms decode %.1f ms  [", encoding * 1e3, best * 1e3);
        for (auto& p : layer.payloads) std::printf("%zu ", p.size());
        std::printf("]\n");
        std::fflush(stdout);
        total += layer.bytes();
    }
    std::printf("total %zu, geometric mean of today's %.4f\n", total, std::exp(product / std::max(rated, 1)));
    return 0;
}

uint64_t g_seed = 1;
uint32_t chance(uint32_t below) {
    g_seed = g_seed * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<uint32_t>((g_seed >> 33) % below);
}

// Vertices at random, in Morton order, all different; faces as told by `face`, none twice.
template <class Face>
Sample make_sample(const char* name, int bits, size_t vertices, size_t faces, Face face) {
    auto spread = [](uint64_t x) {
        uint64_t out = 0;
        for (int i = 0; i < 21; i++) out |= (x >> i & 1) << 3 * i;
        return out;
    };
    Sample sample;
    sample.name = name, sample.bits = bits;
    std::vector<std::pair<uint64_t, std::array<int32_t, 3>>> places;
    for (size_t i = 0; i < vertices; i++) {
        std::array<int32_t, 3> p;
        for (auto& x : p) x = static_cast<int32_t>(chance(1u << bits));
        auto u = [&](size_t k) { return spread(static_cast<uint64_t>(p[k])); };
        places.push_back({u(0) << 2 | u(1) << 1 | u(2), p});
    }
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
    for (auto& p : places) sample.positions.insert(sample.positions.end(), p.second.begin(), p.second.end());
    auto n = static_cast<uint32_t>(places.size());
    std::vector<std::array<int32_t, 3>> all;
    for (size_t i = 0; i < faces; i++) {
        std::array<int32_t, 3> f = face(static_cast<uint32_t>(i), n);
        if (f[0] == f[1] || f[1] == f[2] || f[2] == f[0]) continue;
        while (f[0] > f[1] || f[0] > f[2]) f = {f[1], f[2], f[0]};
        all.push_back(f);
    }
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    for (auto& f : all) sample.faces.insert(sample.faces.end(), f.begin(), f.end());
    return sample;
}

template <Effort effort, bool positions>
bool test_odd() {
    using L = Layer<effort, positions>;
    using F = std::array<int32_t, 3>;
    auto any = [](uint32_t n) { return static_cast<int32_t>(chance(n)); };
    std::vector<Sample> samples;
    samples.push_back(make_sample("soup", 8, 300, 2000, [&](uint32_t, uint32_t n) {
        return F{any(n), any(n), any(n)};
    }));
    samples.push_back(make_sample("dense", 3, 40, 6000, [&](uint32_t, uint32_t n) {
        return F{any(n), any(n), any(n)};
    }));
    samples.push_back(make_sample("coarse", 1, 8, 500, [&](uint32_t, uint32_t n) {
        return F{any(n), any(n), any(n)};
    }));
    samples.push_back(make_sample("sparse", 9, 3000, 400, [&](uint32_t, uint32_t n) {
        return F{any(n), any(n), any(n)};
    }));
    samples.push_back(make_sample("none", 6, 500, 0, [&](uint32_t, uint32_t) { return F{0, 1, 2}; }));
    samples.push_back(make_sample("opposite", 7, 200, 600, [&](uint32_t i, uint32_t n) {
        auto a = static_cast<int32_t>(i / 2 * 7 % n), b = static_cast<int32_t>((i / 2 * 7 + 1) % n);
        auto c = static_cast<int32_t>((i / 2 * 7 + 2) % n);
        return (i & 1) != 0 ? F{a, b, c} : F{a, c, b};
    }));
    samples.push_back(make_sample("book", 12, 100002, 100000, [](uint32_t i, uint32_t n) {
        return F{0, static_cast<int32_t>(n - 1), static_cast<int32_t>(1 + i % (n - 2))};
    }));
    samples.push_back(make_sample("fan", 12, 100002, 100000, [](uint32_t i, uint32_t n) {
        return F{0, static_cast<int32_t>(1 + i % (n - 2)), static_cast<int32_t>(2 + i % (n - 2))};
    }));
    samples.push_back(make_sample("fan soup", 12, 20000, 60000, [&](uint32_t, uint32_t n) {
        return F{0, any(n), any(n)};
    }));
    bool all = true;
    for (auto& sample : samples) {
        Bench bench(sample);
        Budget budget(PLENTY);
        FacesMemory memory(budget);
        typename L::Model model(budget), fresh(budget);
        L layer;
        double time = seconds();
        layer.template encode<RangeEncoder>(bench, model, memory);
        double encoding = seconds() - time;
        bool good = layer.check(bench);
        model.copy(fresh);
        time = seconds();
        layer.decode(bench, model, memory);
        time = seconds() - time;
        good = good && layer.check(bench);
        std::printf("%-10s %s: %zu vertices, %zu faces, %zu bytes, encode %.0f ms, decode %.0f ms\n",
                    sample.name.c_str(), good ? "ok" : "WRONG", sample.positions.size() / 3, sample.faces.size() / 3,
                    layer.bytes(), encoding * 1e3, time * 1e3);
        std::fflush(stdout);
        all = all && good;
    }
    return all;
}

// Damaged payloads: decoded to something, or refused, within time and memory.
template <Effort effort, bool positions>
void test_damage(const std::vector<std::string>& names, int rounds) {
    using L = Layer<effort, positions>;
    for (auto& name : names) {
        Bench bench(SAMPLES + name + ".mesh");
        L layer;
        Budget budget(PLENTY);
        typename L::Model start(budget), model(budget);
        FacesMemory memory(budget);
        model.copy(start);
        layer.template encode<RangeEncoder>(bench, model, memory);
        int refused = 0;
        double longest = 0;
        uint64_t peak = 0;
        std::vector<Array<uint8_t>> whole;
        for (auto& p : layer.payloads) {
            whole.emplace_back(budget);
            whole.back().copy(p.span());
        }
        for (int round = 0; round < rounds; round++) {
            for (size_t i = 0; i < whole.size(); i++) layer.payloads[i].copy(whole[i].span());
            for (uint32_t k = 0; k <= chance(4); k++) {
                auto& p = layer.payloads[chance(static_cast<uint32_t>(whole.size()))];
                if (p.empty()) continue;
                uint8_t& byte = p[chance(static_cast<uint32_t>(p.size()))];
                byte = static_cast<uint8_t>(byte ^ 1u << chance(8));
            }
            Budget limit(1 << 28);
            FacesMemory small(limit);
            model.copy(start);
            double time = seconds();
            try {
                layer.decode(bench, model, small);
            } catch (const Failure& failure) {
                refused++;
                if (failure.fault != Fault::malformed)
                    std::printf("  fault %d: %s\n", static_cast<int>(failure.fault), failure.text);
            }
            longest = std::max(longest, seconds() - time);
            peak = std::max(peak, limit.peak());
        }
        std::printf("%s: %d of %d damaged refused, the longest took %.0f ms, %.1f MB\n", name.c_str(), refused, rounds,
                    longest * 1e3, static_cast<double>(peak) / 1e6);
    }
}

} // namespace

int main(int argc, char** argv) {
    bool train = false, high = false, classic = false;
    bool odd = false;
    int damage = 0, runs = 0, epochs = 12;
    std::string states = "faces.bin";
    std::vector<std::string> names;
    for (int i = 1; i < argc; i++) {
        std::string a = argv[i];
        if (a == "-t")
            train = true;
        else if (a == "-e")
            epochs = std::atoi(argv[++i]);
        else if (a == "-q")
            coarsely = true;
        else if (a == "-o")
            odd = true;
        else if (a == "-z")
            damage = std::atoi(argv[++i]);
        else if (a == "-h")
            high = true;
        else if (a == "-c")
            classic = true;
        else if (a == "-r")
            runs = std::atoi(argv[++i]);
        else if (a == "-s")
            states = argv[++i];
        else if (a == "-12")
            for (auto n : {"armadillo", "beetle-alt", "casting", "fandisk", "harley", "homer", "horse-quad",
                           "nefertiti-rgb", "rocker-arm", "spot", "stanford-bunny", "truck"})
                names.push_back(n);
        else if (a == "-glb")
            for (auto n : {"sword_noMat", "seagulf", "riggedMesh"}) names.push_back(n);
        else
            names.push_back(a);
    }
    if (odd) {
        bool good = test_odd<Effort::standard, true>();
#ifndef ONLY_STANDARD
        good = test_odd<Effort::standard, false>() && good;
        good = test_odd<Effort::high, true>() && good;
#endif
        return good ? 0 : 1;
    }
    if (damage > 0) {
        test_damage<Effort::standard, true>(names, damage);
#ifndef ONLY_STANDARD
        test_damage<Effort::standard, false>(names, damage);
        test_damage<Effort::high, true>(names, damage);
#endif
        return 0;
    }
#ifdef ONLY_HIGH
    return run<Effort::high, true>(names, train, runs, states, epochs);
#endif
#ifndef ONLY_STANDARD
    if (high) return classic ? 2 : run<Effort::high, true>(names, train, runs, states, epochs);
    if (classic) return run<Effort::standard, false>(names, train, runs, states, epochs);
#endif
    return run<Effort::standard, true>(names, train, runs, states, epochs);
}
