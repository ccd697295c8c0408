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
  std::array<double, 2> range = {0, 0};  // smallest and largest finite sample; 0 when there is none
  double otsu = 0;                       // Otsu's threshold; the value itself when all are equal
  std::uint64_t non_finite = 0;          // samples that are infinite or no number
};

// Bins of equal width: the first begins at `range[0]`, the last ends at `range[1]`. A sample at
// range[1] counts for the last bin; those outside, and those that are no numbers, for none.
struct Bins {
  std::array<double, 2> range = {0, 0};
  std::size_t count = 0;
};

// `samples` holds whole little-endian samples, aligned for their type. All functions are thread
// safe.
//
// Otsu's threshold is exact for integers that span fewer than 65536 values; for all others it is
// taken from 1024 bins between the smallest and the largest sample. It lies midway between the two
// classes, so no integer sample equals it unless the volume is constant.
Statistics measure(std::span<const std::byte> samples, SampleType type);

std::vector<std::uint64_t> histogram(std::span<const std::byte> samples, SampleType type,
                                     const Bins& bins);

// Nobuyuki Otsu, "A threshold selection method from gray-level histograms", IEEE Transactions on
// Systems, Man, and Cybernetics 9 (1979): the threshold that maximises the variance between the two
// classes. Where empty bins lie between the classes, the middle of them. Needs a count that is not
// 0.
double otsu_threshold(std::span<const std::uint64_t> counts, const std::array<double, 2>& range);

}  // namespace isomesh::volume
