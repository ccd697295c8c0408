// The range, histogram and threshold of a volume's samples.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/types.h"

namespace isomesh::volume {

struct Statistics {
  std::array<double, 2> range = {0, 0};  // smallest and largest finite sample; 0 without any
  double otsu = 0;                       // Otsu's threshold; the value itself if all are equal
  std::uint64_t non_finite = 0;          // infinite samples and NaN
};

// Bins of equal width: the first starts at `range[0]`, the last ends at `range[1]`. A sample equal
// to range[1] is in the last bin; samples outside, and NaN, are in none.
struct Bins {
  std::array<double, 2> range = {0, 0};
  std::size_t count = 0;
};

// `samples` holds whole little-endian samples, aligned for their type. All functions are thread
// safe.
//
// Otsu's threshold is exact for integers that span fewer than 65536 values; otherwise it follows
// from 1024 bins between the smallest and the largest sample. It is midway between the two classes,
// so no integer sample equals it unless the volume is constant. It leaves out as many of the
// smallest samples as `left_out` says; these are copies of that sample which stand for others.
Statistics measure(std::span<const std::byte> samples, SampleType type, std::uint64_t left_out = 0);

std::vector<std::uint64_t> histogram(std::span<const std::byte> samples, SampleType type,
                                     const Bins& bins);

// Nobuyuki Otsu, "A threshold selection method from gray-level histograms", IEEE Transactions on
// Systems, Man, and Cybernetics 9 (1979): the threshold that maximises the variance between the two
// classes. If empty bins separate the classes, the centre of these bins. Needs a nonzero count.
double otsu_threshold(std::span<const std::uint64_t> counts, const std::array<double, 2>& range);

}  // namespace isomesh::volume
