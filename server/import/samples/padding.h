// Samples that a file stores but declares to be no part of its image.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/import/source/names.h"

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
  std::uint64_t count() const;
  // The bits of the samples from the first of a block on; the first is the lowest.
  std::uint64_t block(std::size_t index) const { return words_[index]; }

 private:
  std::uint64_t total_;
  std::vector<std::uint64_t> words_;
};

// Gives padding the value of the smallest other sample, so it is outside at every larger iso-value.
// `padding` is not empty, and of the samples of `volume`, whose type and dims are set. Adds a note.
// Returns the number of samples that are no part of the image, for finish().
//
// Changes nothing and returns 0 if the options accept padding, with a note, and if the padding is
// the 0 around labels: their background is outside already, and must not become a label.
//
// Throws Error kUnusableVolume if all samples are padding, which the options may accept.
std::uint64_t leave_out_padding(const SampleSet& padding, const ImportOptions& options,
                                std::span<std::byte> samples, Volume& volume);

}  // namespace isomesh::import
