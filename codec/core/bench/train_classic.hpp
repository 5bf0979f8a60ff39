// Profile classic's part of training.cpp: faces that are coded without positions. To be included behind what trains the
// other layers.
#pragma once

#include "classic.hpp"

namespace {

// All meshes' bytes, each coded with a model of its own that begins as it is trained, or as `prepare` makes it.
template <class Coder, class Prepare, class Finished>
size_t code_classics(const std::vector<std::unique_ptr<ClassicSample>>& samples, const ClassicFacesModel& trained,
                     Budget& budget, Prepare prepare, Finished finished) {
    size_t bytes = 0;
    Array<uint8_t> payload(budget);
    for (size_t k = 0; k < samples.size(); k++) {
        ClassicConnectivity connectivity(budget, trained);
        prepare(k, connectivity.model());
        Coder coder(payload);
        code_classic(coder, *samples[k], connectivity);
        finished(k, connectivity.model());
        bytes += payload.size();
    }
    return bytes;
}

void train_classic(const std::vector<std::unique_ptr<ClassicSample>>& samples, ClassicFacesModel& trained, int rounds,
                   int epochs) {
    Budget budget(PLENTY);
    auto nothing = [](size_t, ClassicFacesModel&) {};
    for (int round = 0; round < 2; round++) {
        Trace trace;
        tracing = &trace;
        code_classics<Watcher>(samples, trained, budget, nothing, nothing);
        tracing = nullptr;
        fit_scores(trace, trained.scores.span(), epochs);
    }
    Learner learner{
        trained.contexts.span(), trained.weights.span(), trained.final_weights.span(), 65536 / 14, 4.0f, {}, {}, {}};
    for (size_t k = 0; k < samples.size(); k++) learner.counts.push_back({{}, {}});
    constexpr int LAST_ROUNDS = 3;
    for (int round = 0; round < rounds; round++) {
        std::vector<Counts> fresh;
        Counts counts;
        size_t bytes = code_classics<Watcher>(
            samples, trained, budget,
            [&](size_t k, ClassicFacesModel& model) {
                if (round > 0) learner.start(&learner.counts[k], model.contexts.span());
                counts = {model.contexts.span(), std::vector<std::array<float, 2>>(model.contexts.size())};
                counting = {&counts};
            },
            [&](size_t, ClassicFacesModel& model) {
                trained.weights.copy(model.weights.span());
                trained.final_weights.copy(model.final_weights.span());
                fresh.push_back(std::move(counts));
                if (round + LAST_ROUNDS >= rounds) learner.add_weights();
            });
        counting.clear();
        learner.counts = std::move(fresh);
        std::fprintf(stderr, "round %d: classic faces %zu bytes\n", round, bytes);
    }
    learner.conclude(static_cast<double>(LAST_ROUNDS) * static_cast<double>(samples.size()));
    learner.start(nullptr, learner.contexts);
}

// As `run` for profile classic: trains if asked to, then prints bytes of faces with and without training.
int run_classic(const Arguments& arguments) {
    Budget budget(PLENTY);
    ClassicFacesModel trained(budget), untrained(budget);
    auto nothing = [](size_t, ClassicFacesModel&) {};
    auto load = [](const char* name) { return std::make_unique<ClassicSample>(load_sample(SAMPLES + name + ".mesh")); };
    std::vector<std::unique_ptr<ClassicSample>> samples;
    if (arguments.train) {
        for (const char* name : TRAINED) samples.push_back(load(name));
        train_classic(samples, trained, arguments.rounds, arguments.epochs);
        write_states(arguments.states, trained, budget);
    }
    read_states(arguments.states, trained, budget);
    std::vector<std::string> names = arguments.meshes;
    if (names.empty()) names.assign(std::begin(UNTRAINED), std::end(UNTRAINED));
    double logs = 0;
    for (const std::string& name : names) {
        samples.clear();
        samples.push_back(load(name.c_str()));
        size_t now = code_classics<RangeEncoder>(samples, trained, budget, nothing, nothing);
        size_t before = code_classics<RangeEncoder>(samples, untrained, budget, nothing, nothing);
        std::printf("%-22s classic faces %zu, untrained %zu\n", name.c_str(), now, before);
        logs += std::log(static_cast<double>(now) / static_cast<double>(before));
    }
    std::printf("geometric mean: %.4f of untrained\n", std::exp(logs / static_cast<double>(names.size())));
    return 0;
}

} // namespace
