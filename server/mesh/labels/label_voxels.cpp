#include "server/mesh/labels/label_voxels.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>

#include "server/mesh/labels/label_index.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kPlanesPerTask = 16;
constexpr std::size_t kMostValues = kMostLabels + 1;  // with the background

template <class T>
std::vector<LabelVoxels> count_planes(const Lattice<T>& lattice, std::uint32_t begin,
                                      std::uint32_t end) {
  ValueTable<T, LabelVoxels> table;
  const std::uint32_t width = lattice.dims.x;
  for (std::uint32_t z = begin; z < end; ++z) {
    for (std::uint32_t y = 0; y < lattice.dims.y; ++y) {
      const T* row = lattice.samples + (std::size_t{z} * lattice.dims.y + y) * width;
      for (std::uint32_t x = 0; x < width;) {
        const std::uint32_t first = x;
        while (++x < width && row[x] == row[first]) {
        }
        const LabelVoxels run = {.voxels = x - first, .low = {first, y, z}, .high = {x - 1, y, z}};
        add_voxels(run, table[row[first]]);
      }
      if (table.has_met_more_than(kMostValues)) throw_too_many_labels();
    }
  }
  std::vector<LabelVoxels> labels;
  table.visit([&](T value, const LabelVoxels& label) {
    if (label.voxels == 0) return;
    labels.push_back(label);
    labels.back().label = value;
  });
  return labels;
}

// Those that are not in `present`, as text; empty when all are.
std::string missing_labels(std::span<const std::int64_t> labels,
                           std::span<const LabelVoxels> present) {
  constexpr std::size_t kMostNamed = 20;
  std::string names;
  std::size_t missing = 0;
  for (const std::int64_t label : labels) {
    if (std::ranges::binary_search(present, label, {}, &LabelVoxels::label)) continue;
    if (++missing <= kMostNamed) names += (names.empty() ? "" : ", ") + std::to_string(label);
  }
  if (missing > kMostNamed) names += " and " + std::to_string(missing - kMostNamed) + " more";
  return names;
}

}  // namespace

void add_voxels(const LabelVoxels& part, LabelVoxels& whole) {
  if (whole.voxels == 0) whole.low = part.low;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    whole.low[axis] = std::min(whole.low[axis], part.low[axis]);
    whole.high[axis] = std::max(whole.high[axis], part.high[axis]);
  }
  whole.voxels += part.voxels;
  whole.volume_mm3 += part.volume_mm3;
}

void throw_too_many_labels() {
  throw Error(ErrorCode::kUnusableVolume,
              "the volume has more than " + std::to_string(kMostLabels) +
                  " different values besides its background, so they are not labels");
}

template <class T>
std::vector<LabelVoxels> count_labels(const Lattice<T>& lattice, const Context& context) {
  const std::uint32_t planes = lattice.dims.samples() == 0 ? 0 : lattice.dims.z;
  std::vector<std::vector<LabelVoxels>> parts(chunks_of(planes, kPlanesPerTask));
  const auto count = [&](std::size_t begin, std::size_t end) {
    parts[begin / kPlanesPerTask] =
        count_planes(lattice, static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end));
  };
  for_chunks(context, planes, count, kPlanesPerTask);
  std::unordered_map<std::int64_t, LabelVoxels> joined;
  for (std::vector<LabelVoxels>& part : parts) {
    for (const LabelVoxels& label : std::exchange(part, {})) add_voxels(label, joined[label.label]);
    if (joined.size() > kMostValues) throw_too_many_labels();
  }
  const double voxel_mm3 = std::abs(lattice.to_space.determinant());
  std::vector<LabelVoxels> labels;
  for (auto& [value, label] : joined) {
    label.label = value;
    label.volume_mm3 = static_cast<double>(label.voxels) * voxel_mm3;
    labels.push_back(label);
  }
  std::ranges::sort(labels, {}, &LabelVoxels::label);
  return labels;
}

std::vector<LabelVoxels> labels_of(std::span<const LabelVoxels> present, std::int64_t background,
                                   const LabelValues& values) {
  std::set<std::int64_t> taken = {background};
  std::vector<LabelVoxels> labels;
  for (const auto& [label, own] : values) {
    LabelVoxels whole = {.label = label};
    for (const std::int64_t value : own) {
      if (value == background) continue;
      taken.insert(value);
      const auto found = std::ranges::lower_bound(present, value, {}, &LabelVoxels::label);
      if (found == present.end() || found->label != value) continue;
      add_voxels(*found, whole);
    }
    taken.insert(label);
    if (whole.voxels > 0 && label != background) labels.push_back(whole);
  }
  for (const LabelVoxels& value : present) {
    if (!taken.contains(value.label)) labels.push_back(value);
  }
  if (labels.size() > kMostLabels) throw_too_many_labels();
  std::ranges::sort(labels, {}, &LabelVoxels::label);
  return labels;
}

std::vector<std::int64_t> select_labels(std::span<const LabelVoxels> present,
                                        std::int64_t background,
                                        const std::optional<std::vector<std::int64_t>>& wanted) {
  std::vector<std::int64_t> labels;
  if (!wanted) {
    for (const LabelVoxels& label : present) {
      if (label.label != background) labels.push_back(label.label);
    }
  } else {
    labels = *wanted;
    std::ranges::sort(labels);
    labels.erase(std::unique(labels.begin(), labels.end()), labels.end());
    if (labels.empty()) throw invalid_parameter("labels", "must name at least one label");
    if (std::ranges::binary_search(labels, background)) {
      throw invalid_parameter("labels",
                              "must not name the background, " + std::to_string(background));
    }
    if (const std::string missing = missing_labels(labels, present); !missing.empty()) {
      throw Error(ErrorCode::kUnusableVolume, "the volume has no voxels of the labels " + missing);
    }
  }
  if (labels.size() > kMostLabels) throw_too_many_labels();
  return labels;
}

std::vector<LabelVoxels> chosen_labels(std::span<const LabelVoxels> counted,
                                       const MeshParameters& parameters) {
  auto labels = labels_of(counted, parameters.background, parameters.label_values);
  std::optional<std::vector<std::int64_t>> wanted;
  if (!parameters.labels->is_all()) wanted = parameters.labels->values;
  const auto chosen = select_labels(labels, parameters.background, wanted);
  if (chosen.empty()) {
    throw Error(ErrorCode::kUnusableVolume,
                "the volume has no labels: all samples are background, " +
                    std::to_string(parameters.background));
  }
  std::erase_if(labels, [&](const LabelVoxels& label) {
    return !std::ranges::binary_search(chosen, label.label);
  });
  return labels;
}

#define ISOMESH_INSTANTIATE(T) \
  template std::vector<LabelVoxels> count_labels(const Lattice<T>&, const Context&);
ISOMESH_FOR_EACH_LABEL_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
