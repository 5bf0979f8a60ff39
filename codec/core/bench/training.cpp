// Sizes, times and training of all layers (docs/format.md, Trained states).
//
//   training [-e default|high|classic] [-t] [-r RUNS] [-f STATES] [MESH ...]
//
// `make core-train` builds and runs it. Codes meshes of samples/, each layer in payloads of its own, decodes them
// again, and prints bytes and milliseconds of Map, faces and Diffs. -t: trains first, on those of TRAINED, and writes
// STATES.
#include "codec/layers.hpp"
#include "diff/plane.hpp"
#include "layers.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

using namespace meshtide;

namespace {

const char* const TRAINED[] = {
    "casting",   "homer",          "horse-quad",       "nefertiti-rgb",         "spot",
    "cannon",    "emoji_heart",    "frostAxe_noMorph", "greySnapper_vertColor", "marineGround",
    "runeSword", "underwaterScene"};
// Meshes that nothing is trained on, to see what training is worth elsewhere.
const char* const UNTRAINED[] = {"stanford-bunny", "armadillo", "rocker-arm",  "fandisk", "beetle-alt",
                                 "harley",         "truck",     "sword_noMat", "seagulf", "riggedMesh"};

constexpr uint64_t PLENTY = 1ull << 34;

struct Mesh {
    explicit Mesh(const std::string& name) : sample(load_sample(SAMPLES + name + ".mesh")), octree(make_octree()) {
        plan.bits = sample.bits;
        plan.vertices = sample.positions.size() / 3;
        plan.most_faces = octree.depths.back().faces.size() / 3;
        plan.mirror = {sample.mirror_axis, sample.mirror_sum};
        for (size_t b = 0; b + 1 < octree.depths.size(); b++) {
            const Octree::Depth &coarse = octree.depths[b], &fine = octree.depths[b + 1];
            octants.emplace_back(coarse.cell_count(), 0);
            leaves.emplace_back(coarse.cell_count(), 0);
            int shift = sample.bits - static_cast<int>(b) - 1;
            for (size_t i = 0, parent = 0; i < fine.cell_count(); i++) {
                const int32_t* p = &sample.positions[3 * fine.first[i]];
                int octant = (p[0] >> shift & 1) << 2 | (p[1] >> shift & 1) << 1 | (p[2] >> shift & 1);
                parent = coarse.cell_of(fine.first[i], parent);
                octants[b][parent] |= static_cast<uint8_t>(1 << octant);
                if (fine.is_leaf(i)) leaves[b][parent] |= static_cast<uint8_t>(1 << octant);
            }
        }
    }
    Octree make_octree() {
        return {{sample.positions.data(), sample.positions.size()},
                {sample.faces.data(), sample.faces.size()},
                sample.bits,
                budget};
    }
    LevelTruth truth(size_t b) const { // of the level of depth b + 1
        return {{{octants[b].data(), octants[b].size()}, {leaves[b].data(), leaves[b].size()}},
                {octree.depths[b + 1].faces.span()}};
    }

    Sample sample;
    Budget budget{PLENTY};
    Octree octree;
    Plan plan;
    std::vector<std::vector<uint8_t>> octants, leaves;
};

enum Layer { MAP, FACES, DIFF, LAYERS };
const char* const LAYER_NAMES[LAYERS] = {"Map", "faces", "Diff"};

struct Payloads {
    explicit Payloads(Budget& budget) {
        for (auto& layer : of)
            for (int b = 0; b < 32; b++) layer.emplace_back(budget);
    }
    size_t bytes(Layer layer) const {
        size_t sum = 0;
        for (const auto& payload : of[layer]) sum += payload.size();
        return sum;
    }
    std::vector<Array<uint8_t>> of[LAYERS];
};

template <Effort effort>
struct Models {
    Models(Budget& budget, const TrainedLayers<effort>& trained) : layers(budget), memory(budget) {
        layers.map.copy(trained.map);
        layers.faces.copy(trained.faces);
        layers.diff.copy(trained.diff);
    }
    TrainedLayers<effort> layers;
    FacesMemory memory;
};

struct Times {
    double of[LAYERS] = {};
};

template <class Coder>
struct Opened {
    explicit Opened(Array<uint8_t>& payload) : coder(make(payload)) {}
    static Coder make(Array<uint8_t>& payload) {
        if constexpr (Coder::encoding)
            return Coder(payload);
        else
            return Coder(payload.span());
    }
    Coder coder;
};

// The whole of a mesh; whether what comes out is what there should be.
template <Effort effort, class Coder>
bool code(const Mesh& mesh, Models<effort>& models, Payloads& payloads, Times& times) {
    Budget budget(PLENTY);
    LevelChain chain(budget, mesh.plan);
    DiffSlice slice(budget, {mesh.plan.bits}, mesh.plan.mirror);
    slice.enter(chain.at(0));
    MapOptions options{mesh.plan.bits, mesh.plan.vertices, mesh.plan.mirror};
    double before = seconds();
    auto took = [&](Layer layer) {
        double now = seconds();
        times.of[layer] += now - before;
        before = now;
    };
    for (int depth = 1; depth <= mesh.plan.bits; depth++) {
        auto b = static_cast<size_t>(depth) - 1;
        auto open = [&](Layer layer) { return Opened<Coder>(payloads.of[layer][b]); };
        if (!chain.ends()) {
            Level& fine = chain.begin_next();
            Level& coarse = chain.before_next();
            LevelTruth truth{};
            if (Coder::encoding) truth = mesh.truth(b);
            auto map = open(MAP);
            code_map<effort>(map.coder, options, models.layers.map, coarse, fine, truth.map);
            map.coder.finish();
            took(MAP);
            auto faces = open(FACES);
            code_faces<effort, true>(faces.coder, coarse, fine, models.layers.faces, models.memory,
                                     FacesTask{mesh.plan.bits, mesh.plan.most_faces, truth.faces});
            faces.coder.finish();
            chain.complete_next();
            took(FACES);
        }
        auto diff = open(DIFF);
        code_planes<effort>(diff.coder, chain, slice, models.layers.diff, depth,
                            Coder::encoding ? &mesh.octree : nullptr);
        diff.coder.finish();
        took(DIFF);
    }
    Array<F32x4> known(budget);
    const Level& level = chain.last();
    known.resize(level.vertex_count());
    slice.give_known(level, known.span());
    bool good = level.vertex_count() == mesh.plan.vertices && level.face_count() == mesh.plan.most_faces;
    for (size_t i = 0; good && i < mesh.sample.positions.size(); i++)
        good = known[i / 3][static_cast<int>(i % 3)] == static_cast<float>(2 * mesh.sample.positions[i] + 1);
    return good;
}

// What encoders choose among, and what contexts meet.
struct Trace {
    struct Choice {
        uint32_t first, count, wanted;
    };
    size_t terms = 0;
    std::vector<Choice> choices;
    std::vector<int32_t> places;
};
struct Counts {
    Span<Context> contexts;
    std::vector<std::array<float, 2>> of;
};
Trace* tracing = nullptr;
std::vector<Counts*> counting;

struct Watcher : RangeEncoder {
    using RangeEncoder::RangeEncoder;

    // What was watched since a mark does not count when the coder returns to it.
    struct Mark {
        RangeEncoder::Mark coder;
        std::vector<Counts> counts;
        size_t choices, places;
    };
    Mark mark() const {
        Mark mark{RangeEncoder::mark(), {}, 0, 0};
        for (const Counts* counts : counting) mark.counts.push_back(*counts);
        if (tracing != nullptr) mark.choices = tracing->choices.size(), mark.places = tracing->places.size();
        return mark;
    }
    void return_to(const Mark& mark) {
        RangeEncoder::return_to(mark.coder);
        for (size_t i = 0; i < counting.size(); i++) *counting[i] = mark.counts[i];
        if (tracing != nullptr) tracing->choices.resize(mark.choices), tracing->places.resize(mark.places);
    }

    void watch(const Context& context, int bit) {
        for (Counts* counts : counting) {
            auto place = static_cast<size_t>(&context - counts->contexts.begin());
            if (place < counts->contexts.size()) counts->of[place][static_cast<size_t>(bit)]++;
        }
    }
    template <Effort effort, bool positions>
    void watch(const Candidates<effort, positions>& candidates, int wanted) {
        if (tracing == nullptr) return;
        Trace& trace = *tracing;
        trace.terms = Candidates<effort, positions>::TERMS;
        Trace::Choice choice{static_cast<uint32_t>(trace.places.size()), 0, 0};
        for (int i = 0; i < candidates.lanes; i++) {
            if (candidates.score_of[i] == NO_SCORE) continue;
            if (i == wanted) choice.wanted = choice.count;
            choice.count++;
            for (size_t j = 0; j < trace.terms; j++) trace.places.push_back(candidates.places_of[j][i]);
        }
        trace.choices.push_back(choice);
    }
};

// Softmax regression: in each choice, the scores of the wanted candidate rise, those of the others fall.
void fit_scores(const Trace& trace, Span<int16_t> fitted, int epochs) {
    std::vector<float> scores(fitted.size()), weights;
    std::vector<uint32_t> order(trace.choices.size());
    for (uint32_t i = 0; i < order.size(); i++) order[i] = i;
    uint64_t random = 1;
    auto terms = trace.terms;
    for (int epoch = 0; epoch < epochs; epoch++) {
        float rate = 5 / static_cast<float>(terms) *
                     (epoch < epochs / 3       ? 0.08f
                      : epoch < 2 * epochs / 3 ? 0.03f
                                               : 0.01f);
        for (size_t i = order.size(); i > 1; i--) {
            random = random * 6364136223846793005ull + 1442695040888963407ull;
            std::swap(order[i - 1], order[(random >> 33) % i]);
        }
        double bits = 0;
        for (uint32_t o : order) {
            const Trace::Choice& choice = trace.choices[o];
            const int32_t* places = trace.places.data() + choice.first;
            weights.assign(choice.count, 0);
            float most = -1e9f, sum = 0;
            for (size_t i = 0; i < choice.count; i++) {
                for (size_t j = 0; j < terms; j++) weights[i] += scores[static_cast<size_t>(places[i * terms + j])];
                most = std::max(most, weights[i]);
            }
            for (float& weight : weights) sum += weight = std::exp(weight - most);
            bits -= std::log2(std::max(1e-9f, weights[choice.wanted] / sum));
            for (size_t i = 0; i < choice.count; i++) {
                float step = rate * ((i == choice.wanted ? 1.0f : 0.0f) - weights[i] / sum);
                for (size_t j = 0; j < terms; j++) {
                    float& score = scores[static_cast<size_t>(places[i * terms + j])];
                    score += step - rate * 0.0002f * score;
                }
            }
        }
        if (epoch + 1 == epochs)
            std::fprintf(stderr, "scores: %.0f bytes in %zu choices\n", bits / 8, trace.choices.size());
    }
    constexpr float SCALE = 1024 / 0.6931472f; // 256ths of a doubling, four times
    for (size_t i = 0; i < scores.size(); i++)
        fitted[i] = static_cast<int16_t>(std::clamp(scores[i] * SCALE, -32000.0f, 32000.0f));
}

// What a layer's contexts and weights become. Contexts start from what they met on all meshes, but on a mesh that
// trains, from what they met on the others. Weights go on from mesh to mesh, and become the mean of what they were
// after each one in the last rounds.
struct Learner {
    Span<Context> contexts;
    Span<int16_t> weights, final_weights;
    uint16_t settled_rate;
    float least;                // decisions of a context that is worth its bytes
    std::vector<Counts> counts; // of each mesh
    std::vector<double> weight_sums, final_sums;

    void add_weights() {
        weight_sums.resize(weights.size());
        final_sums.resize(final_weights.size());
        for (size_t i = 0; i < weights.size(); i++) weight_sums[i] += weights[i];
        for (size_t i = 0; i < final_weights.size(); i++) final_sums[i] += final_weights[i];
    }
    void conclude(double count) const {
        for (size_t i = 0; i < weights.size(); i++)
            weights[i] = static_cast<int16_t>(std::lround(weight_sums[i] / count));
        for (size_t i = 0; i < final_weights.size(); i++)
            final_weights[i] = static_cast<int16_t>(std::lround(final_sums[i] / count));
    }
    void start(const Counts* without, Span<Context> started) const {
        for (size_t c = 0; c < contexts.size(); c++) {
            float zeros = 0, ones = 0;
            for (const Counts& each : counts)
                if (&each != without) zeros += each.of[c][0], ones += each.of[c][1];
            float n = zeros + ones, p = std::clamp((ones + 0.4f) / (n + 0.8f), 0.002f, 0.998f);
            started[c] = Context{};
            if (n < least) continue;
            auto probability = static_cast<uint16_t>(p * 65536);
            int middle = settled_rate < 4000 ? 8192 : 2 * settled_rate;
            auto rate = static_cast<uint16_t>(n >= 16 ? settled_rate : n >= 6 ? middle : 13107);
            started[c] = Context{probability, probability, rate, std::max(rate, FASTEST_FLOOR)};
        }
    }
};

template <Effort effort>
void train(std::vector<std::unique_ptr<Mesh>>& meshes, TrainedLayers<effort>& trained, int rounds, int epochs) {
    Budget budget(PLENTY);
    Payloads payloads(budget);
    Times times;
    constexpr bool high = effort == Effort::high;
    Learner learners[LAYERS] = {{trained.map.contexts.span(),
                                 trained.map.weights.span(),
                                 trained.map.final_weights.span(),
                                 MapModel<effort>::SETTLED_RATE,
                                 high ? 6.0f : 16.0f,
                                 {},
                                 {},
                                 {}},
                                {trained.faces.contexts.span(),
                                 trained.faces.weights.span(),
                                 trained.faces.final_weights.span(),
                                 65536 / 14,
                                 high ? 6.0f : 4.0f,
                                 {},
                                 {},
                                 {}},
                                {trained.diff.contexts.span(),
                                 trained.diff.weights.span(),
                                 trained.diff.final_weights.span(),
                                 65536 / 16,
                                 high ? 12.0f : 24.0f,
                                 {},
                                 {},
                                 {}}};
    auto spans_of = [](TrainedLayers<effort>& layers, Layer layer) -> MixerStates {
        return layer == MAP     ? layers.map.mixer_states()
               : layer == FACES ? layers.faces.mixer_states()
                                : layers.diff.mixer_states();
    };
    for (int round = 0; round < 2; round++) {
        Trace trace;
        tracing = &trace;
        for (auto& mesh : meshes) {
            Models<effort> models(budget, trained);
            code<effort, Watcher>(*mesh, models, payloads, times);
        }
        tracing = nullptr;
        fit_scores(trace, trained.faces.scores.span(), epochs);
    }
    for (Learner& learner : learners)
        for (size_t k = 0; k < meshes.size(); k++) learner.counts.push_back({{}, {}});
    constexpr int LAST_ROUNDS = 3;
    for (int round = 0; round < rounds; round++) {
        size_t bytes[LAYERS] = {};
        std::vector<Counts> fresh[LAYERS];
        for (size_t k = 0; k < meshes.size(); k++) {
            Models<effort> models(budget, trained);
            counting.clear();
            Counts counts[LAYERS];
            for (int l = 0; l < LAYERS; l++) {
                MixerStates states = spans_of(models.layers, static_cast<Layer>(l));
                if (round > 0) learners[l].start(&learners[l].counts[k], states.contexts);
                counts[l] = {states.contexts, std::vector<std::array<float, 2>>(states.contexts.size())};
                counting.push_back(&counts[l]);
            }
            code<effort, Watcher>(*meshes[k], models, payloads, times);
            for (int l = 0; l < LAYERS; l++) {
                Learner& learner = learners[l];
                bytes[l] += payloads.bytes(static_cast<Layer>(l));
                MixerStates states = spans_of(models.layers, static_cast<Layer>(l));
                std::copy(states.weights.begin(), states.weights.end(), learner.weights.begin());
                std::copy(states.final_weights.begin(), states.final_weights.end(), learner.final_weights.begin());
                fresh[l].push_back(std::move(counts[l]));
                if (round + LAST_ROUNDS >= rounds) learner.add_weights();
            }
        }
        counting.clear();
        for (int l = 0; l < LAYERS; l++) learners[l].counts = std::move(fresh[l]);
        std::fprintf(stderr, "round %d: Map %zu, faces %zu, Diff %zu bytes\n", round, bytes[MAP], bytes[FACES],
                     bytes[DIFF]);
    }
    for (Learner& learner : learners) learner.conclude(static_cast<double>(LAST_ROUNDS * meshes.size()));
    for (Learner& learner : learners) learner.start(nullptr, learner.contexts);
}

struct Arguments {
    std::string effort = "default"; // or "high", or "classic": the profile's faces without positions
    std::string states;
    int runs = 0, rounds = 6, epochs = 24;
    bool train = false;
    std::vector<std::string> meshes;
};

// States to a file and from it; the program ends where that cannot be done.
template <class Model>
void write_states(const std::string& path, Model& trained, Budget& budget) {
    Array<uint8_t> bytes(budget);
    RangeEncoder coder(bytes);
    trained.code_states(coder, budget);
    coder.finish();
    FILE* file = std::fopen(path.c_str(), "wb");
    if (file == nullptr || std::fwrite(bytes.begin(), 1, bytes.size(), file) != bytes.size()) std::exit(1);
    std::fclose(file);
}
template <class Model>
void read_states(const std::string& path, Model& trained, Budget& budget) {
    Array<uint8_t> bytes(budget);
    FILE* file = std::fopen(path.c_str(), "rb");
    if (file == nullptr) std::exit(1);
    bytes.resize(1 << 20);
    bytes.resize(std::fread(bytes.begin(), 1, bytes.size(), file));
    std::fclose(file);
    std::printf("%zu bytes of states\n", bytes.size());
    RangeDecoder coder(bytes.span());
    trained.code_states(coder, budget);
}

template <Effort effort>
int run(const Arguments& arguments) {
    Budget budget(PLENTY);
    TrainedLayers<effort> trained(budget);
    if (arguments.train) {
        std::vector<std::unique_ptr<Mesh>> meshes;
        for (const char* name : TRAINED) meshes.push_back(std::make_unique<Mesh>(name));
        train(meshes, trained, arguments.rounds, arguments.epochs);
        write_states(arguments.states, trained, budget);
    }
    read_states(arguments.states, trained, budget);

    std::vector<std::string> names = arguments.meshes;
    if (names.empty()) names.assign(std::begin(UNTRAINED), std::end(UNTRAINED));
    for (const std::string& name : names) {
        Mesh mesh(name);
        Payloads payloads(budget);
        Times encoding, best;
        Models<effort> encoder(budget, trained);
        bool good = code<effort, RangeEncoder>(mesh, encoder, payloads, encoding);
        for (double& time : best.of) time = arguments.runs > 0 ? 1e9 : 0;
        for (int r = 0; r < std::max(arguments.runs, 1); r++) {
            Models<effort> decoder(budget, trained);
            Times times;
            good = code<effort, RangeDecoder>(mesh, decoder, payloads, times) && good;
            for (int l = 0; l < LAYERS; l++) best.of[l] = std::min(best.of[l], times.of[l]);
        }
        std::printf("%-22s%s", name.c_str(), good ? "" : " WRONG");
        double sum = 0, milliseconds = 0;
        for (int l = 0; l < LAYERS; l++) {
            auto size = static_cast<double>(payloads.bytes(static_cast<Layer>(l)));
            std::printf(" %s %.0f %.1f ms", LAYER_NAMES[l], size, best.of[l] * 1e3);
            sum += size, milliseconds += best.of[l] * 1e3;
        }
        std::printf(" all %.0f %.1f ms\n", sum, milliseconds);
        std::fflush(stdout);
    }
    return 0;
}

} // namespace

#include "train_classic.hpp"

int main(int count, char** values) {
    Arguments arguments;
    for (int i = 1; i < count; i++) {
        std::string option = values[i];
        auto next = [&] { return ++i < count ? std::string(values[i]) : std::string(); };
        if (option == "-e")
            arguments.effort = next();
        else if (option == "-t")
            arguments.train = true;
        else if (option == "-r")
            arguments.runs = std::atoi(next().c_str());
        else if (option == "-f")
            arguments.states = next();
        else
            arguments.meshes.push_back(option);
    }
    if (arguments.states.empty()) arguments.states = "../../meshtide_codec/states/" + arguments.effort + ".states";
    if (arguments.effort == "classic") return run_classic(arguments);
    return arguments.effort == "high" ? run<Effort::high>(arguments) : run<Effort::standard>(arguments);
}
