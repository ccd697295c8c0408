#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "server/codec/draco/residuals.h"
#include "server/codec/draco/scratch.h"
#include "server/codec/draco/value_order.h"

namespace isomesh::codec::edgebreaker {

// Encoded residuals; the coder owns the data.
struct CodedResiduals {
  std::vector<std::byte> head;
  std::span<const std::byte> data;
};

// Codes the residuals of all components in the smaller of Draco's two forms: every value by rANS
// ("raw"), or, if the values are too few for their table, only each vertex's number of bits
// ("tagged"). Keeps its memory. Not thread safe.
class ResidualCoder {
 public:
  CodedResiduals code(const Residuals& residuals, const ValueOrder& order,
                      std::span<const Histogram> histograms);

 private:
  CodedResiduals code_tagged(const Residuals& residuals, const ValueOrder& order);

  Scratch<std::byte> coded_;
  Scratch<std::uint16_t> bits_;  // per vertex, if tagged
};

}  // namespace isomesh::codec::edgebreaker
