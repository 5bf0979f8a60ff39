// include/meshtide.h: what every binding asks first.
#include "check.hpp"
#include "meshtide.h"

#include <cstring>

namespace meshtide::testing {

void test_interface() {
    check(std::strcmp(mt_best_kind(), "baseline") == 0 || std::strcmp(mt_best_kind(), "avx2") == 0);
    check_equal(mt_self_check(), MT_SELF_CHECK);
}

} // namespace meshtide::testing
