// Runs all tests of the core; ends at the first check that does not hold.
#include "check.hpp"

#include <cstring>

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
void test_compact();

} // namespace meshtide::testing

int main(int count, char** arguments) {
    using namespace meshtide::testing;
    struct {
        const char* name;
        void (*run)();
    } tests[] = {
        {"memory", test_memory},     {"lanes", test_lanes},         {"range coder", test_range_coder},
        {"contexts", test_contexts}, {"mixing", test_mixing},       {"level", test_level},
        {"octree", test_octree},     {"interface", test_interface}, {"header", test_header},
        {"classic", test_classic},   {"compact", test_compact},
    };
    if (count == 3 && std::strcmp(arguments[1], "--fails") == 0) body_to_run = std::atoi(arguments[2]);
    for (const auto& test : tests) {
        if (body_to_run < 0) std::printf("%s\n", test.name);
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
    std::printf("%d bodies must fail\n", bodies_passed);
    return body_to_run < 0 ? 0 : 1;
}
