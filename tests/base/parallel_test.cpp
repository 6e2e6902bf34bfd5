#include "libeditnerf/base/parallel.h"

#include <ATen/Parallel.h>

#include <atomic>
#include <stdexcept>
#include <vector>

#include "tests/catch.h"

using namespace editnerf;

TEST_CASE("parallel loops visit every item once") {
  for (const int64_t count : {0, 1, 2, 7, 1000}) {
    std::vector<std::atomic<int>> visits(static_cast<size_t>(count));
    ParallelFor(count, 3, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) ++visits[static_cast<size_t>(i)];
    });
    for (const auto& visit : visits) CHECK(visit == 1);
  }
}

TEST_CASE("parallel loops nest and pass exceptions on") {
  std::atomic<int> total{0};
  ParallelFor(8, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i)
      ParallelFor(10, 1, [&](int64_t b, int64_t e) { total += static_cast<int>(e - b); });
  });
  CHECK(total == 80);
  CHECK_THROWS_AS(ParallelFor(100, 1, [](int64_t, int64_t) { throw std::runtime_error("no"); }), std::runtime_error);
}

TEST_CASE("parallel parts run LibTorch's operations in one thread each and put its threads back") {
  SetNumThreads(2);
  std::vector<int> threads(5, 0);
  ParallelParts(5, [&](int64_t part) { threads[static_cast<size_t>(part)] = at::get_num_threads(); });
  for (const int count : threads) CHECK(count == 1);
  CHECK(at::get_num_threads() == 2);
}
