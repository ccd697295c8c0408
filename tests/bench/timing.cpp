#include "tests/bench/timing.h"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace isomesh::bench {

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

double time_ms(const Timed& timed) {
  if (timed.prepare) timed.prepare();
  const auto begin = std::chrono::steady_clock::now();
  timed.run();
  const auto end = std::chrono::steady_clock::now();
  return std::chrono::duration<double, std::milli>(end - begin).count();
}

double median_ms(const Timed& timed, int runs) {
  std::vector<double> times;
  times.reserve(static_cast<std::size_t>(runs));
  for (int i = 0; i < runs; ++i) times.push_back(time_ms(timed));
  return median(times);
}

Paired time_in_pairs(const Timed& ours, const Timed& peer, int pairs) {
  time_ms(ours);
  time_ms(peer);
  return pair_times([&] { return time_ms(ours); }, [&] { return time_ms(peer); }, pairs);
}

Paired pair_times(const std::function<double()>& ours, const std::function<double()>& peer,
                  int pairs) {
  std::vector<double> our_times;
  std::vector<double> peer_times;
  std::vector<double> ratios;
  for (int i = 0; i < pairs; ++i) {
    double our_time = 0;
    double peer_time = 0;
    if (i % 2 == 0) {
      our_time = ours();
      peer_time = peer();
    } else {
      peer_time = peer();
      our_time = ours();
    }
    our_times.push_back(our_time);
    peer_times.push_back(peer_time);
    ratios.push_back(our_time / peer_time);
  }
  return {median(our_times), median(peer_times), median(ratios)};
}

double log_log_slope(const std::vector<std::array<double, 2>>& points) {
  double mean_x = 0;
  double mean_y = 0;
  const auto count = static_cast<double>(points.size());
  for (const auto& [x, y] : points) {
    mean_x += std::log(x) / count;
    mean_y += std::log(y) / count;
  }
  double covariance = 0;
  double variance = 0;
  for (const auto& [x, y] : points) {
    covariance += (std::log(x) - mean_x) * (std::log(y) - mean_y);
    variance += (std::log(x) - mean_x) * (std::log(x) - mean_x);
  }
  return variance > 0 ? covariance / variance : 0;
}

}  // namespace isomesh::bench
