// How near samples are to the iso-value, as small integers; private to this folder.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

namespace isomesh::mesh {

// A power of two to multiply distances from the iso-value with: 1 if single precision holds some of
// them as they are, otherwise one that makes their median about 1. A part of the samples tells.
// Neither follows from the largest, which may be a fill value.
template <class T>
double power_for(const T* samples, std::uint64_t count, double iso) {
  if constexpr (std::is_integral_v<T>) return 1;
  constexpr std::uint64_t kLookedAt = 4096;
  constexpr int kHeld = 64;  // half of single precision's exponents
  constexpr int kMost = std::numeric_limits<double>::max_exponent - 1;
  std::vector<int> exponents;
  for (std::uint64_t at = 0; at < count; at += count / kLookedAt | 1) {
    const double distance = std::abs(static_cast<double>(samples[at]) - iso);
    if (distance == 0) continue;
    exponents.push_back(std::isinf(distance) ? kMost : std::ilogb(distance));
    if (std::abs(exponents.back()) <= kHeld) return 1;
  }
  if (exponents.empty()) return 1;
  const auto median = exponents.begin() + static_cast<std::ptrdiff_t>(exponents.size() / 2);
  std::ranges::nth_element(exponents, median);
  return std::ldexp(1.0, std::min(-*median, kMost));
}

// Ranks samples of type T by their distance from the iso-value in single precision. Here values of
// at least the iso-value are inside, whatever the extraction has inside: they come first of those
// that are equally near, so both sides of a surface have the same vertices. Ranks are signed
// integers of bytes() each. Only those of samples on different sides can be compared. Immutable.
//
// Integers of up to 16 bits are a whole number of steps from the iso-value's neighbours, so which
// is nearer follows from the steps. A rank is then the number of values that are nearer. Other
// ranks are the bits of the distance.
template <class T>
class Nearness {
 public:
  // `has_centres`: means of eight samples are ranked, too. Then steps are eighths. `power`: of two;
  // ranks that are bits are those of the distance times it.
  Nearness(double iso, bool has_centres, double power = 1)
      : iso_(iso), power_(power), parts_(has_centres ? 8 : 1) {
    if constexpr (std::is_integral_v<T> && sizeof(T) <= 2) {
      const double low = parts_ * static_cast<double>(std::numeric_limits<T>::lowest());
      const double high = parts_ * static_cast<double>(std::numeric_limits<T>::max());
      if (high - low <= std::numeric_limits<std::uint16_t>::max()) count_steps(low, high);
    }
  }

  std::size_t bytes() const { return bytes_; }

  // Only if bytes() is less than 4; Rank must have bytes() bytes.
  template <class Rank>
  Rank of_sample(T sample) const {
    return of_steps<Rank>(static_cast<std::int32_t>(sample) * parts_);
  }
  template <class Rank>
  Rank of_sum(std::int32_t eight_samples) const {
    return of_steps<Rank>(eight_samples);
  }

  // Only if bytes() is 4.
  std::int32_t of_value(double value) const {
    const auto distance = static_cast<float>(std::abs(value * power_ - iso_ * power_));
    // Its bits rise with a number that is not negative; they are moved down to where signed
    // numbers begin, since those are what processors compare.
    const std::uint32_t rank =
        std::bit_cast<std::uint32_t>(distance) << 1 | static_cast<std::uint32_t>(value < iso_);
    return std::bit_cast<std::int32_t>(rank ^ std::uint32_t{1} << 31);
  }

 private:
  void count_steps(double low, double high) {
    const double iso = parts_ * iso_;
    const double first_inside = std::ceil(iso);
    // How much farther the first one inside is than the first one outside, -1 to 1 steps. From it
    // follows which of two is nearer, unless rounding to single precision makes them equal.
    const double farther = (first_inside - iso) - (iso - (first_inside - 1));
    const double apart = std::abs(farther - std::round(farther));
    constexpr double kResolved = 1.0 / 128;  // of 65536 steps
    if (apart != 0 && apart < kResolved) return;
    first_inside_ = static_cast<std::int32_t>(std::clamp(first_inside, low, high + 1));
    inside_ = static_cast<std::int32_t>(high + 1) - first_inside_;
    outside_ = first_inside_ - static_cast<std::int32_t>(low);
    lead_ = farther <= -1 ? 2 : farther <= 0 ? 1 : 0;
    bytes_ = high - low <= std::numeric_limits<std::uint8_t>::max() ? 1 : 2;
  }

  template <class Rank>
  Rank of_steps(std::int32_t at) const {
    const std::int32_t steps = at - first_inside_;
    const bool is_inside = steps >= 0;
    // `own` counts the nearer values on the same side. `others` counts those on the other side,
    // before it is limited to the values that exist.
    const std::int32_t own = is_inside ? steps : -1 - steps;
    const std::int32_t others = own + (is_inside ? 1 - lead_ : lead_);
    const std::int32_t most = is_inside ? outside_ : inside_;
    return static_cast<Rank>(own + std::clamp(others, 0, most) +
                             std::numeric_limits<Rank>::lowest());
  }

  double iso_;
  double power_;
  std::int32_t parts_;
  std::size_t bytes_ = sizeof(std::int32_t);
  std::int32_t first_inside_ = 0;
  std::int32_t inside_ = 0;  // so many values
  std::int32_t outside_ = 0;
  // Counted from 0 on: value i inside is nearer than value j outside if i < j + lead_.
  std::int32_t lead_ = 0;
};

}  // namespace isomesh::mesh
