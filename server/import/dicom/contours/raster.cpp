#include "server/import/dicom/contours/raster.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>

namespace isomesh::import::dicom {
namespace {

// The first whole number not below `value`, clamped to 0..most.
std::uint32_t first_whole(double value, std::uint32_t most) {
  return static_cast<std::uint32_t>(std::clamp(std::ceil(value), 0.0, static_cast<double>(most)));
}

// --- Distances -----------------------------------------------------------------------------------

// Larger than any square of a distance; sums of a few are still finite.
constexpr double kFar = 1e30;

// The lower envelope of parabolas with their apexes at the samples: for each sample the least of
// values[q] + (step * (p - q))^2, over all q.
class Envelope {
 public:
  explicit Envelope(std::size_t count) : apexes_(count), bounds_(count + 1), result_(count) {}

  std::span<const double> of(std::span<const double> values, double step) {
    const double square = step * step;
    const auto meet = [&](std::size_t p, std::size_t q) {
      const auto a = static_cast<double>(p);
      const auto b = static_cast<double>(q);
      return ((values[p] + square * a * a) - (values[q] + square * b * b)) / (2 * square * (a - b));
    };
    std::size_t last = 0;
    apexes_[0] = 0;
    bounds_[0] = -std::numeric_limits<double>::infinity();
    for (std::size_t at = 1; at < values.size(); ++at) {
      double bound = meet(at, apexes_[last]);
      while (last > 0 && bound <= bounds_[last]) bound = meet(at, apexes_[--last]);
      apexes_[++last] = at;
      bounds_[last] = bound;
    }
    bounds_[last + 1] = std::numeric_limits<double>::infinity();
    std::size_t piece = 0;
    for (std::size_t at = 0; at < values.size(); ++at) {
      while (bounds_[piece + 1] < static_cast<double>(at)) ++piece;
      const double off = static_cast<double>(at) - static_cast<double>(apexes_[piece]);
      result_[at] = values[apexes_[piece]] + square * off * off;
    }
    return std::span(result_).first(values.size());
  }

 private:
  std::vector<std::size_t> apexes_;
  std::vector<double> bounds_;
  std::vector<double> result_;
};

// Squares of distances from the nearest sample whose value is `kind`. The slice has a border of one
// sample outside, which makes what is beyond it count.
std::vector<double> squares(const Mask& mask, std::uint8_t kind,
                            const std::array<double, 2>& spacing) {
  const std::size_t columns = std::size_t{mask.columns} + 2;
  const std::size_t rows = std::size_t{mask.rows} + 2;
  std::vector<double> field(columns * rows, kind == 0 ? 0 : kFar);
  for (std::size_t row = 0; row < mask.rows; ++row) {
    for (std::size_t column = 0; column < mask.columns; ++column) {
      const bool is_kind = mask.samples[row * mask.columns + column] == kind;
      field[(row + 1) * columns + column + 1] = is_kind ? 0 : kFar;
    }
  }
  Envelope envelope(std::max(columns, rows));
  std::vector<double> line(rows);
  for (std::size_t column = 0; column < columns; ++column) {
    for (std::size_t row = 0; row < rows; ++row) line[row] = field[row * columns + column];
    const auto least = envelope.of(line, spacing[1]);
    for (std::size_t row = 0; row < rows; ++row) field[row * columns + column] = least[row];
  }
  for (std::size_t row = 0; row < rows; ++row) {
    const std::span<double> values = std::span(field).subspan(row * columns, columns);
    std::ranges::copy(envelope.of(values, spacing[0]), values.begin());
  }
  return field;
}

}  // namespace

std::uint64_t EvenOddRaster::add(std::span<const PlanePoint> points) {
  std::uint64_t rows = 0;
  for (std::size_t at = 0; at < points.size(); ++at) {
    rows += add_edge(points[at], points[at + 1 < points.size() ? at + 1 : 0]);
  }
  return rows;
}

// The edge changes the parity of all samples behind it, in the rows from its lower end, inclusive,
// to its upper end, exclusive. Both directions of an edge compute the same crossings.
std::uint64_t EvenOddRaster::add_edge(const PlanePoint& from, const PlanePoint& to) {
  const auto& [low, high] = std::minmax(from, to, [](const PlanePoint& a, const PlanePoint& b) {
    return a[1] != b[1] ? a[1] < b[1] : a[0] < b[0];
  });
  const std::uint32_t begin = first_whole(low[1], mask_.rows);
  const std::uint32_t end = first_whole(high[1], mask_.rows);
  const double slope = (high[0] - low[0]) / (high[1] - low[1]);
  for (std::uint32_t row = begin; row < end; ++row) {
    const double column = low[0] + (row - low[1]) * slope;
    const std::uint32_t first = first_whole(column, mask_.columns);
    if (first < mask_.columns) mask_.samples[std::size_t{row} * mask_.columns + first] ^= 1U;
  }
  return end - begin;
}

Mask EvenOddRaster::take() {
  Mask filled = std::exchange(mask_, Mask(mask_.columns, mask_.rows));
  for (std::uint32_t row = 0; row < filled.rows; ++row) {
    std::uint8_t inside = 0;
    for (std::uint32_t column = 0; column < filled.columns; ++column) {
      std::uint8_t& sample = filled.samples[std::size_t{row} * filled.columns + column];
      inside ^= sample;
      sample = inside;
    }
  }
  return filled;
}

std::vector<float> signed_distances(const Mask& mask, const std::array<double, 2>& spacing) {
  const std::vector<double> to_inside = squares(mask, 1, spacing);
  const std::vector<double> to_outside = squares(mask, 0, spacing);
  const std::size_t columns = std::size_t{mask.columns} + 2;
  std::vector<float> distances(mask.samples.size());
  for (std::size_t row = 0; row < mask.rows; ++row) {
    for (std::size_t column = 0; column < mask.columns; ++column) {
      const std::size_t at = row * mask.columns + column;
      const std::size_t place = (row + 1) * columns + column + 1;
      const double distance =
          mask.samples[at] != 0 ? std::sqrt(to_outside[place]) : -std::sqrt(to_inside[place]);
      distances[at] = static_cast<float>(distance);
    }
  }
  return distances;
}

Mask between(const std::vector<float>& from, const std::vector<float>& to, double along,
             std::uint32_t columns, std::uint32_t rows) {
  Mask mask(columns, rows);
  const auto share = static_cast<float>(along);
  for (std::size_t at = 0; at < mask.samples.size(); ++at) {
    mask.samples[at] = from[at] * (1 - share) + to[at] * share > 0 ? 1 : 0;
  }
  return mask;
}

}  // namespace isomesh::import::dicom
