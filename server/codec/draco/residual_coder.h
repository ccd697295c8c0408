// Entropy coding of residuals; private to this folder.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "server/codec/draco/residuals.h"
#include "server/codec/draco/scratch.h"
#include "server/codec/draco/value_order.h"

namespace isomesh::codec::edgebreaker {

// How residuals are coded, and what they are coded to, which lives in the coder.
struct CodedResiduals {
  std::vector<std::byte> head;
  std::span<const std::byte> data;
};

// Codes the residuals of all components, in whichever of Draco's two forms is smaller: every value
// by rANS ("raw"), or, where values are few for their table, only the number of bits of each vertex
// ("tagged"). Keeps its memory. Not thread safe.
class ResidualCoder {
 public:
  CodedResiduals code(const Residuals& residuals, const ValueOrder& order,
                      std::span<const Histogram> histograms);

 private:
  CodedResiduals code_tagged(const Residuals& residuals, const ValueOrder& order);

  Scratch<std::byte> coded_;
  Scratch<std::uint16_t> bits_;  // of each vertex, where they are tagged
};

}  // namespace isomesh::codec::edgebreaker
