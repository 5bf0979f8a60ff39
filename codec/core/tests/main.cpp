// Runs all tests of the core; ends at the first check that does not hold.
#include "check.hpp"

namespace meshtide::testing {

void test_memory();
void test_lanes();
void test_range_coder();
void test_contexts();
void test_mixing();
void test_level();
void test_octree();
void test_interface();
void test_header();
void test_classic();
void test_classic_decoder();
void test_compact();
void test_closest_points();
void test_previews();

} // namespace meshtide::testing

int main() {
    using namespace meshtide::testing;
    struct {
        const char* name;
        void (*run)();
    } tests[] = {
        {"memory", test_memory},
        {"lanes", test_lanes},
        {"range coder", test_range_coder},
        {"contexts", test_contexts},
        {"mixing", test_mixing},
        {"level", test_level},
        {"octree", test_octree},
        {"interface", test_interface},
        {"header", test_header},
        {"classic", test_classic},
        {"classic decoder", test_classic_decoder},
        {"compact", test_compact},
        {"closest points", test_closest_points},
        {"previews", test_previews},
    };
    for (const auto& test : tests) {
        std::printf("%s\n", test.name);
#ifdef __wasm__
        test.run();
#else
        try {
            test.run();
        } catch (const meshtide::Failure& failure) {
            std::printf("an unexpected failure: %s\n", failure.text);
            return 1;
        }
#endif
    }
    std::printf("%d bodies failed as they must\n", failures_seen);
    return 0;
}
