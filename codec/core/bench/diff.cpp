#include "layers.hpp"
#include "diff/code_diff.hpp"
#include <cmath>
#include <cstring>
#include <memory>
#include <map>
#include <algorithm>
using namespace meshtide;
static const char* TWELVE[] = {"armadillo","beetle-alt","casting","fandisk","harley","homer","horse-quad","nefertiti-rgb","rocker-arm","spot","stanford-bunny","truck"};
static const int CAP = getenv("CAP") ? atoi(getenv("CAP")) : 12;
#ifndef EFF
#define EFF standard
#endif
constexpr Effort EFFORT = Effort::EFF;
using Model = DiffModel<EFFORT>;
using M = Model::DiffMixer;
struct Prepared { Sample s; std::unique_ptr<Budget> budget; std::unique_ptr<Octree> octree; std::vector<std::unique_ptr<Level>> levels; };
static std::unique_ptr<Prepared> prepare(const std::string& name) {
    auto p = std::make_unique<Prepared>();
    p->s = load_sample("/tmp/wt/data/" + name + ".mesh");
    p->budget = std::make_unique<Budget>(1ull << 32);
    p->octree = std::make_unique<Octree>(Span<const int32_t>(p->s.positions.data(), p->s.positions.size()), Span<const int32_t>(p->s.faces.data(), p->s.faces.size()), p->s.bits, *p->budget);
    for (int b = 0; b <= p->s.bits; b++) {
        p->levels.push_back(std::make_unique<Level>(*p->budget));
        p->octree->make_level(b, *p->levels.back(), *p->budget);
        bool all = true; for (uint8_t l : p->levels.back()->leaves) all &= l != 0;
        if (all) break;
    }
    return p;
}
static void copy_model(Model& to, const Model& from) { to.contexts.copy(from.contexts.span()); to.weights.copy(from.weights.span()); to.final_weights.copy(from.final_weights.span()); }
struct Payloads { std::vector<std::vector<uint8_t>> parts; std::vector<int> ends; size_t size() const { size_t n = 0; for (auto& p : parts) n += p.size(); return n; } };
template <class F> static void walk(Prepared& p, F f) { // f(level, depth)
    for (int b = 1; b <= p.s.bits; b++) f(*p.levels[std::min<size_t>(b, p.levels.size() - 1)], b);
}
static Payloads encode(Prepared& p, Model& model) {
    Budget budget(1ull << 32);
    DiffSlice slice(budget, SliceRange{p.s.bits, 0, ~0ull}, MirrorPlane{p.s.mirror_axis, p.s.mirror_sum});
    slice.enter(*p.levels[0]);
    Payloads out; Array<uint8_t> bytes(budget); auto rc = std::make_unique<RangeEncoder>(bytes); int at = 0;
    auto close = [&](int b) { rc->finish(); out.parts.emplace_back(bytes.begin(), bytes.end()); out.ends.push_back(b); rc = std::make_unique<RangeEncoder>(bytes); };
    walk(p, [&](Level& level, int b) {
        if (level.depth != at) slice.enter(level), at = level.depth;
        code_diff<EFFORT>(*rc, level, b, slice, model, DiffTruth{p.octree->positions, p.octree->depths[level.depth].first.span()});
        if (b == p.s.bits || rc->size() >= 64) close(b);
    });
    return out;
}
static double T_ENTER, T_CODE;
static bool decode(Prepared& p, Model& model, const Payloads& in, bool check) {
    Budget budget(1ull << 32);
    DiffSlice slice(budget, SliceRange{p.s.bits, 0, ~0ull}, MirrorPlane{p.s.mirror_axis, p.s.mirror_sum});
    slice.enter(*p.levels[0]);
    size_t part = 0; int at = 0;
    auto open = [&]() { return std::make_unique<RangeDecoder>(Span<const uint8_t>(in.parts[part].data(), in.parts[part].size())); };
    auto rc = open();
    walk(p, [&](Level& level, int b) {
        double t0 = seconds();
        if (level.depth != at) slice.enter(level), at = level.depth;
        double t1 = seconds();
        code_diff<EFFORT>(*rc, level, b, slice, model, DiffTruth{});
        T_ENTER += t1 - t0; T_CODE += seconds() - t1;
        if (b == in.ends[part]) { rc->finish(); if (++part < in.parts.size()) rc = open(); }
    });
    if (!check) return true;
    Level& last = *p.levels.back();
    Array<F32x4> known(budget); known.resize(last.vertex_count());
    slice.tell(last, known.span());
    for (size_t i = 0; i < last.vertex_count(); i++) for (int k = 0; k < 3; k++) if (known[i][k] != static_cast<float>(2 * p.s.positions[3 * i + k] + 1)) return false;
    return true;
}
static int visits(const Context& c) { double n = 65536.0 / c.slow_rate - 2; return (int)std::min(200.0, std::max(0.0, n + 0.5)); }
static uint16_t rate_of(int count) { return (uint16_t)std::min(32767.0, 65536.0 / (count + 2)); }
// a trained state: probability and count of each context
struct Trained { std::vector<float> p; std::vector<int> n; std::vector<int16_t> w, f; };
static void apply(const Trained& t, Model& m, int cap) {
    for (size_t i = 0; i < t.p.size(); i++) { Context& c = m.contexts[i]; c.slow = c.fast = (uint16_t)std::min(65472.f, std::max(64.f, t.p[i] * 65536)); int n = std::min(t.n[i], cap); c.slow_rate = rate_of(n); c.fast_rate = std::max<uint16_t>(rate_of(n), FASTEST_FLOOR); }
    for (size_t i = 0; i < t.w.size(); i++) m.weights[i] = t.w[i];
    for (size_t i = 0; i < t.f.size(); i++) m.final_weights[i] = t.f[i];
}
static Trained train(std::vector<Prepared*> set, int rounds) {
    Budget budget(1ull << 32); Trained t; Model m(budget), l(budget);
    t.p.assign(Model::context_count, 0.5f); t.n.assign(Model::context_count, 0);
    t.w.assign(m.weights.begin(), m.weights.end()); t.f.assign(m.final_weights.begin(), m.final_weights.end());
    for (int round = 0; round < rounds; round++) {
        size_t C = t.p.size(), total = 0; std::vector<double> vis(C), sum(C), sq(C), ws(t.w.size()), wn(t.w.size()), fs(t.f.size()), fn(t.f.size());
        apply(t, m, CAP);
        for (Prepared* p : set) {
            copy_model(l, m); for (auto& c : l.contexts) c.slow_rate = c.fast_rate = 32767;
            total += encode(*p, l).size();
            for (size_t i = 0; i < C; i++) { double n = visits(l.contexts[i]), q = l.contexts[i].slow / 65536.0; vis[i] += n; sum[i] += n * q; sq[i] += n * q * q; }
            double v = (double)p->s.positions.size() / 3;
            for (size_t i = 0; i < ws.size(); i++) if (l.weights[i] != m.weights[i]) ws[i] += v * l.weights[i], wn[i] += v;
            for (size_t i = 0; i < fs.size(); i++) if (l.final_weights[i] != m.final_weights[i]) fs[i] += v * l.final_weights[i], fn[i] += v;
        }
        for (size_t i = 0; i < C; i++) { bool met = vis[i] > 0; double v = met ? vis[i] : 1, mean = met ? (sum[i] + 0.5) / (v + 1) : 0.5, sp = std::max(sq[i] / v - (sum[i] / v) * (sum[i] / v), 1e-6), ag = mean * (1 - mean) / sp - 1, c = std::min(ag, vis[i] / 4); t.p[i] = (float)mean; t.n[i] = met ? (int)std::max(c, 1.0) : 0; }
        for (size_t i = 0; i < ws.size(); i++) if (wn[i] > 0) t.w[i] = (int16_t)std::lrint(ws[i] / wn[i]);
        for (size_t i = 0; i < fs.size(); i++) if (fn[i] > 0) t.f[i] = (int16_t)std::lrint(fs[i] / fn[i]);
        fprintf(stderr, "round %d: %zu\n", round, total);
    }
    return t;
}
int main(int argc, char** argv) {
    std::map<std::string, std::pair<int,int>> today; { FILE* f = fopen("/tmp/basediff.txt", "r"); char n[99]; int a, b; while (fscanf(f, "%98s %d %d", n, &a, &b) == 3) today[n] = {a, b}; fclose(f); }
    bool tr = false; std::string states = "/tmp/diff.states"; int runs = 0; std::vector<std::string> names;
    int rounds = 5;
    for (int i = 1; i < argc; i++) { std::string a = argv[i]; if (a == "-t") tr = true; else if (a == "-s") states = argv[++i]; else if (a == "-n") rounds = atoi(argv[++i]); else if (a == "-r") runs = atoi(argv[++i]); else names.push_back(a); }
    if (tr) {
        std::vector<std::unique_ptr<Prepared>> ps; std::vector<Prepared*> set;
        for (auto& n : names) { ps.push_back(prepare(n)); set.push_back(ps.back().get()); }
        Trained t = train(set, rounds);
        FILE* f = fopen(states.c_str(), "wb"); fwrite(t.p.data(), 4, t.p.size(), f); fwrite(t.n.data(), 4, t.n.size(), f); fwrite(t.w.data(), 2, t.w.size(), f); fwrite(t.f.data(), 2, t.f.size(), f); fclose(f);
        return 0;
    }
    Budget budget(1ull << 32); Model start(budget), model(budget);
    if (FILE* f = fopen(states.c_str(), "rb")) { Trained t; t.p.resize(Model::context_count); t.n.resize(Model::context_count); t.w.resize(start.weights.size()); t.f.resize(start.final_weights.size()); size_t ok = fread(t.p.data(), 4, t.p.size(), f) + fread(t.n.data(), 4, t.n.size(), f) + fread(t.w.data(), 2, t.w.size(), f) + fread(t.f.data(), 2, t.f.size(), f); fclose(f); if (ok != t.p.size() * 2 + t.w.size() + t.f.size()) { fprintf(stderr, "bad states\n"); return 2; } apply(t, start, CAP); }
    if (names.empty()) for (auto n : TWELVE) names.push_back(n);
    double g = 0, gh = 0; int c = 0;
    for (auto& n : names) {
        auto p = prepare(n); copy_model(model, start); Payloads out = encode(*p, model);
        double best = 1e9, be = 0; bool ok = true;
        if (runs) { copy_model(model, start); ok = decode(*p, model, out, true); }
        for (int r = 0; r < runs; r++) { copy_model(model, start); T_ENTER = T_CODE = 0; decode(*p, model, out, false); if (T_ENTER + T_CODE < best) best = T_ENTER + T_CODE, be = T_ENTER; }
        double a = (double)out.size() / today[n].first, b = (double)out.size() / today[n].second; g += log(a); gh += log(b); c++;
        printf("%-22s %7zu  /default %.4f /high %.4f", n.c_str(), out.size(), a, b);
        if (runs) printf("  %s %.2f ms (enter %.2f)", ok ? "OK" : "FAIL", best * 1e3, be * 1e3);
        printf("\n"); fflush(stdout);
    }
    printf("mean /default %.4f /high %.4f\n", exp(g / c), exp(gh / c));
}
