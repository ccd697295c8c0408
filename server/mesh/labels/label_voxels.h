// Finds the labels of a segmentation, and selects those to separate.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/mesh/context.h"
#include "server/mesh/lattice/lattice.h"

namespace isomesh::mesh {

// The voxels of one label: their number, volume and extent.
struct LabelVoxels {
  std::int64_t label = 0;
  std::uint64_t voxels = 0;
  double volume_mm3 = 0;  // of so many voxels
  // The smallest and the largest sample along x, y and z that has it.
  std::array<std::uint32_t, 3> low = {0, 0, 0};
  std::array<std::uint32_t, 3> high = {0, 0, 0};

  bool operator==(const LabelVoxels&) const = default;
};

// All values that the samples have, the background's too, ascending, in one walk. For the six
// integer types of SampleType. The same for any number of threads; O(labels) memory for each.
// Throws Error kUnusableVolume when there are more than kMostLabels (separate.h) beside one for the
// background, and kCancelled.
template <class T>
std::vector<LabelVoxels> count_labels(const Lattice<T>& lattice, const Context& context);

// Adds what another part of the same samples says of the same label, or of one that it is joined
// with.
void add_voxels(const LabelVoxels& part, LabelVoxels& whole);

// Throws Error kUnusableVolume: the samples have more than kMostLabels labels (separate.h).
[[noreturn]] void throw_too_many_labels();

// The labels that there are: those that are not the samples of their own value, `values`, and each
// value of `present` that is neither the background nor in those. Ascending; those without voxels
// are left out. What is said of a label of several values is what its values have together. Throws
// Error kUnusableVolume when there are more than kMostLabels.
std::vector<LabelVoxels> labels_of(std::span<const LabelVoxels> present, std::int64_t background,
                                   const LabelValues& values = {});

// The labels to separate, ascending: those that are wanted, or all. `labels` are those that there
// are. Throws Error kInvalidParameter, field "labels", when the background is among those that are
// wanted or none is, and kUnusableVolume when some of them are not there, naming them, or when
// there are more than kMostLabels.
std::vector<std::int64_t> select_labels(
    std::span<const LabelVoxels> labels, std::int64_t background,
    const std::optional<std::vector<std::int64_t>>& wanted = std::nullopt);

// The labels that a job chooses, with their voxels: `counted` are all values of the samples. Throws
// as select_labels does, field "labels", and Error kUnusableVolume when there are none.
std::vector<LabelVoxels> chosen_labels(std::span<const LabelVoxels> counted,
                                       const MeshParameters& parameters);

}  // namespace isomesh::mesh
