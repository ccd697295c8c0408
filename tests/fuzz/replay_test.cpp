// The corpora, as they are and damaged, through the same functions that libFuzzer calls: without
// clang, and under whatever sanitizers the build has.
#include <gtest/gtest.h>

#include "tests/fuzz/targets.h"

namespace isomesh::fuzz {
namespace {

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

class Replay : public testing::TestWithParam<Target> {};

TEST_P(Replay, EveryInputIsReadOrRefused) {
  const std::vector<std::string> inputs = corpus(GetParam().name);
  ASSERT_FALSE(inputs.empty());
  for (const std::string& input : inputs) GetParam().run(bytes_of(input));
}

TEST_P(Replay, SoAreDamagedOnes) {
  constexpr std::size_t kDamages = 20;  // the preset `fuzz` looks for more
  std::uint64_t state = 88172645463325252U;
  const auto random = [&](std::size_t below) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return static_cast<std::size_t>(state % below);
  };
  for (const std::string& input : corpus(GetParam().name)) {
    for (std::size_t round = 0; round < kDamages; ++round) {
      std::string damaged = input;
      for (std::size_t change = random(4); change > 0; --change) {
        damaged[random(damaged.size())] = static_cast<char>(random(256));
      }
      if (round % 3 == 0) damaged.resize(random(damaged.size() + 1));
      GetParam().run(bytes_of(damaged));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Targets, Replay, testing::ValuesIn(targets().begin(), targets().end()),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace
}  // namespace isomesh::fuzz
