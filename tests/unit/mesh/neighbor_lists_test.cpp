// Lists of neighbours, and sums over them.
#include "server/mesh/labels/neighbor_lists.h"

#include <cstddef>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/buffer.h"

namespace isomesh::mesh {
namespace {

TEST(NeighborLists, HaveAllNeighboursInTheirOrder) {
  constexpr std::size_t kCount = 40'000;  // several chunks
  const NeighborLists rings(kCount, {}, [](std::size_t i, std::vector<std::uint32_t>& list) {
    for (std::size_t n = 0; n < i % 23; ++n) list.push_back((i * 7 + n) % kCount);
  });
  Buffer<std::uint64_t> numbers;
  numbers.resize_for_overwrite(kCount);
  for (std::size_t i = 0; i < kCount; ++i) numbers[i] = i;
  for (std::size_t i = 0; i < kCount; ++i) {
    std::vector<std::uint32_t> seen;
    rings.visit(i, [&](std::uint32_t each) {
      if (each != kCount) seen.push_back(each);
    });
    ASSERT_EQ(seen.size(), i % 23);
    ASSERT_EQ(rings.degree(i), seen.size());
    std::uint64_t sum = 0;
    for (std::size_t n = 0; n < seen.size(); ++n) {
      ASSERT_EQ(seen[n], (i * 7 + n) % kCount);
      sum += seen[n];
    }
    ASSERT_EQ(rings.sum(i, numbers), sum);
  }
}

}  // namespace
}  // namespace isomesh::mesh
