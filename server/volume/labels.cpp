#include "server/volume/labels.h"

#include <limits>
#include <type_traits>
#include <unordered_set>

#include "proto/samples.h"

namespace isomesh::volume {
namespace {

constexpr std::size_t kMostLabels = 1024;
constexpr std::size_t kFewestValues = 3;
// Of the pairs of neighbours. Regions of five samples along x have a fifth of them at their
// borders; images of eight bits have hardly any pair of the same values.
constexpr double kFlat = 0.6;

// The distinct values of a walk through samples, most of which are the same as the one before.
template <class Sample>
class Values {
 public:
  void add(Sample value) {
    if (value == last_ && !seen_.empty()) return;
    last_ = value;
    seen_.insert(value);
  }
  std::size_t count() const { return seen_.size(); }

 private:
  Sample last_ = 0;
  std::unordered_set<Sample> seen_;
};

template <class Sample>
std::optional<std::size_t> count_labels(std::span<const Sample> samples, std::size_t row) {
  Values<Sample> values;
  const Sample background = samples.front();
  std::size_t pairs = 0;
  std::size_t same = 0;
  for (std::size_t begin = 0; begin < samples.size(); begin += row) {
    const std::span<const Sample> line = samples.subspan(begin, row);
    values.add(line[0]);
    for (std::size_t at = 1; at < row; ++at) {
      if (line[at] == background && line[at - 1] == background) continue;
      ++pairs;
      same += line[at] == line[at - 1] ? 1 : 0;
      values.add(line[at]);
    }
    if (values.count() > kMostLabels) return std::nullopt;
  }
  const bool is_flat = static_cast<double>(same) >= kFlat * static_cast<double>(pairs);
  if (values.count() < kFewestValues || !is_flat) return std::nullopt;
  return values.count();
}

}  // namespace

std::optional<std::size_t> label_count(std::span<const std::byte> samples, SampleType type,
                                       const std::array<std::uint32_t, 3>& dims) {
  return with_sample(type, [&](auto sample) -> std::optional<std::size_t> {
    using Sample = decltype(sample);
    if constexpr (std::is_integral_v<Sample>) {
      const auto* first = reinterpret_cast<const Sample*>(samples.data());
      return count_labels(std::span(first, samples.size() / sizeof(Sample)), dims[0]);
    } else {
      return std::nullopt;
    }
  });
}

}  // namespace isomesh::volume
