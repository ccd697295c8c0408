// Regularised walls between labels the slow and obvious way, to hold the kernels against: the rule
// of server/mesh/labels/label_clusters-inl.h over links that are gathered from the tetrahedra
// themselves. Shares no code with the kernels.
#pragma once

#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/labels/separate.h"
#include "server/mesh/lattice/lattice.h"
#include "tests/support/label_reference.h"

namespace isomesh::test {

struct RegularLabelReference {
  LabelReference plain;
  // The vertices that become one, by their numbers in `plain`.
  std::vector<std::vector<std::uint32_t>> clusters;
};

// For 8-bit labels of their own values.
RegularLabelReference regular_label_reference(const mesh::Lattice<std::uint8_t>& lattice,
                                              const mesh::SeparateOptions& options);

// `regular` is what `plain`, the kernels' surface without joining, becomes when the reference's
// clusters are joined: a cluster lies at the mean of its vertices with the most samples, the others
// are where they were, and the triangles are the same in the same order without those that vanish.
testing::AssertionResult matches(const mesh::SeparatingSurface& regular,
                                 const mesh::SeparatingSurface& plain,
                                 const RegularLabelReference& reference);

// joined.h's has_topology of each label's own surface, and of the background's.
testing::AssertionResult has_topology_of(const mesh::SeparatingSurface& regular,
                                         const mesh::SeparatingSurface& plain,
                                         const RegularLabelReference& reference);

}  // namespace isomesh::test
