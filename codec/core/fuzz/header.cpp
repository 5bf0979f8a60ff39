// libFuzzer: any bytes as a header; what is taken for one can be written again, and is read as the same.
#include "stream/header.hpp"

#include <cstdlib>
#include <cstring>

using namespace meshtide;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t count) {
    Budget budget(1u << 26);
    Header header(budget), again(budget);
    Array<uint8_t> written(budget), second(budget);
    try {
        parse_header({bytes, count}, Limits{}, header);
    } catch (const Failure& failure) {
        if (failure.fault == Fault::internal) std::abort();
        return 0;
    }
    write_header(header, written);
    parse_header(written.span(), Limits{}, again);
    write_header(again, second);
    if (written.size() != second.size() || std::memcmp(written.begin(), second.begin(), written.size()) != 0)
        std::abort();
    return 0;
}
