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

    // Values of any size, also behind others.
    Budget roomy(1 << 16);
    struct Triple {
        uint8_t bytes[3];
    };
    Array<Triple> triples(roomy);
    for (size_t size : {1u, 2u, 3u, 100u, 229u}) {
        size_t old = triples.size();
        auto value = static_cast<uint8_t>(size);
        triples.resize(size, Triple{{value, 1, 2}});
        check(triples.size() == size && triples[old].bytes[0] == value && triples[old].bytes[2] == 2);
        check(triples.back().bytes[0] == value && triples.back().bytes[1] == 1);
        check_equal(triples[0].bytes[0], 1);
    }
    triples.resize(5, Triple{});
    check_equal(triples.size(), 5u);

    // Objects stay where they are, and end with their list.
    int alive = 0;
    struct Counted {
        Counted(int& count_, int number_) : count(count_), number(number_) { count++; }
        ~Counted() { count--; }
        int& count;
        int number;
    };
    {
        List<Counted> list(roomy);
        Counted& first = list.add(alive, 0);
        for (int i = 1; i < 40; i++) list.add(alive, i);
        check(&first == &list[0] && list.size() == 40 && alive == 40);
        list.remove(1);
        check(alive == 39 && list[1].number == 2 && list[38].number == 39);
        int sum = 0;
        for (const Counted& each : list) sum += each.number;
        check_equal(sum, 39 * 40 / 2 - 1);
        check_fails(Fault::internal, [&] { (void)list[39]; });
        List<Counted> moved(std::move(list));
        check(list.empty() && alive == 39 && &moved[0] == &first);
        moved.clear();
        check_equal(alive, 0);
        moved.add(alive, 7);
    }
    check_equal(alive, 0);

    // Growing by pushes stays within the budget, whatever it is.
    Array<uint64_t> pushed(budget);
    check_fails(Fault::limit, [&] {
        for (;;) pushed.push(1);
    });
    check(budget.peak() <= 1000);

    // Where there are many bytes, and where there become few.
    Budget plenty(1u << 30);
    {
        Array<uint64_t> many(plenty);
        for (uint64_t i = 0; i < 3u << 20; i++) many.push(i);
        for (uint64_t i = 0; i < 3u << 20; i += 1000) check_equal(many[static_cast<size_t>(i)], i);
        many = Array<uint64_t>(plenty);
        many.push(7);
        check_equal(many[0], 7u);
    }
    check_equal(plenty.left(), 1u << 30);
}

} // namespace meshtide::testing
