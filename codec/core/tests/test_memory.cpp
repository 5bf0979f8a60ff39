// base/memory.hpp: what a budget allows, and that no access goes beside an array.
#include "base/memory.hpp"
#include "check.hpp"

namespace meshtide::testing {

void test_memory() {
    Budget budget(1000);
    {
        Array<uint32_t> array(budget);
        array.assign(100, 7);
        check_equal(budget.left(), 600u);
        check_equal(array.back(), 7u);
        check_fails(Fault::internal, [&] { array[100] = 0; });
        check_fails(Fault::internal, [&] { (void)array[SIZE_MAX]; });
        check_fails(Fault::internal, [&] { (void)array.span()[100]; });
        check_fails(Fault::internal, [&] { (void)array.span().block(90, 11); });
        check_fails(Fault::internal, [&] { (void)array.span().block(101, 0); });
        check_fails(Fault::internal, [&] { (void)array.span().part(2, SIZE_MAX); });
        check_equal(array.span().part(90, 10).size(), 10u);
        check_fails(Fault::limit, [&] { array.resize(251); });
        check_fails(Fault::limit, [&] { array.resize(SIZE_MAX / 2); });
        check_equal(array.size(), 100u);

        // What was taken is kept when it shrinks, and moves with the array.
        array.clear();
        check_fails(Fault::internal, [&] { array.pop(); });
        check_equal(budget.left(), 600u);
        for (uint32_t i = 0; i < 100; i++) array.push(i);
        check_equal(budget.left(), 600u);
        check_equal(array.pop(), 99u);
        Array<uint32_t> other(std::move(array));
        check_equal(other.size(), 99u);
        check_equal(other[98], 98u);
        Array<uint32_t> copied(budget);
        copied.copy(other.span());
        check_equal(copied[42], 42u);
        check_equal(budget.left(), 1000u - 400 - 396);
    }
    check_equal(budget.left(), 1000u);
    check_equal(budget.peak(), 796u);

    // Growing by pushes stays within the budget, whatever it is.
    Array<uint64_t> pushed(budget);
    check_fails(Fault::limit, [&] {
        for (;;) pushed.push(1);
    });
    check(budget.peak() <= 1000);
}

} // namespace meshtide::testing
