// Some of a volume's samples.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace isomesh::import {

// Samples by their numbers: one bit each, which are scanned 64 at a time.
class SampleSet {
 public:
  static constexpr std::size_t kBlock = 64;

  // An empty set of samples below `total`. Takes memory with the first sample.
  explicit SampleSet(std::uint64_t total) : total_(total) {}

  void add(std::uint64_t sample) {
    if (words_.empty()) words_.resize((total_ + kBlock - 1) / kBlock);
    words_[sample / kBlock] |= std::uint64_t{1} << sample % kBlock;
  }

  bool is_empty() const { return words_.empty(); }
  std::uint64_t count() const {
    std::uint64_t sum = 0;
    for (const std::uint64_t word : words_) sum += static_cast<std::uint64_t>(std::popcount(word));
    return sum;
  }
  // The bits of the samples from the first of a block on; the first is the lowest.
  std::uint64_t block(std::size_t index) const { return words_[index]; }

 private:
  std::uint64_t total_;
  std::vector<std::uint64_t> words_;
};

}  // namespace isomesh::import
