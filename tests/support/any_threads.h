// Expectations of results that do not depend on the number of threads.
#pragma once

#include <functional>
#include <initializer_list>

#include <gtest/gtest.h>

#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"

namespace isomesh::test {

// Expects that make() gives on several numbers of threads what it gives on one, as
// are_same(one, other) tells. Returns what it gives on one.
template <class Make, class AreSame = std::equal_to<>>
auto expect_same_on_any_threads(Make make, AreSame are_same = {},
                                std::initializer_list<int> numbers = {3, 16}) {
  const ThreadCount one(1);
  auto single = make();
  for (const int threads : numbers) {
    const ThreadCount several(threads);
    EXPECT_TRUE(are_same(single, make())) << threads << " threads";
  }
  return single;
}

inline constexpr auto kSameBytes = [](const auto& a, const auto& b) { return same_bytes(a, b); };

}  // namespace isomesh::test
