// Measuring times on a machine that other people use too.
#pragma once

#include <array>
#include <functional>
#include <vector>

namespace isomesh::bench {

// The function that is timed, and one that runs before it each time untimed; may be empty.
struct Timed {
  std::function<void()> run;
  std::function<void()> prepare = nullptr;
};

double median(std::vector<double> values);  // 0 of none

double time_ms(const Timed& timed);
double median_ms(const Timed& timed, int runs);

// Two things in comparison. `ratio` is the median over the pairs of ours / peer, not the ratio of
// the medians: what slows the machine down slows both halves of a pair.
struct Paired {
  double ours_ms = 0;
  double peer_ms = 0;
  double ratio = 0;
};

// Runs both once to warm up, then in turn `pairs` times, each first in every other pair.
inline constexpr int kPairs = 9;
Paired time_in_pairs(const Timed& ours, const Timed& peer, int pairs = kPairs);

// The same for what times itself: each returns milliseconds, and nothing is warmed up.
Paired pair_times(const std::function<double()>& ours, const std::function<double()>& peer,
                  int pairs);

// The exponent b of the power law y = a * x^b that fits the points best; they must be positive.
double log_log_slope(const std::vector<std::array<double, 2>>& points);

}  // namespace isomesh::bench
