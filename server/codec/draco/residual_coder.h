#pragma once

#include <cstddef>
#include <span>

#include "server/codec/draco/raw_symbols.h"
#include "server/codec/draco/residuals.h"
#include "server/codec/draco/value_order.h"
#include "server/mesh/buffer.h"

namespace isomesh::codec::edgebreaker {

// Codes the residuals of all components in the smaller of Draco's two forms: every value by rANS
// ("raw"), or, if the values are too few for their table, only each vertex's number of bits
// ("tagged"). Keeps its memory. Not thread safe.
class ResidualCoder {
 public:
  CodedValues code(const Residuals& residuals, const ValueOrder& order,
                   std::span<const Histogram> histograms);

 private:
  CodedValues code_tagged(const Residuals& residuals, const ValueOrder& order);

  mesh::Buffer<std::byte> coded_;
  mesh::Buffer<std::uint16_t> bits_;  // per vertex, if tagged
};

}  // namespace isomesh::codec::edgebreaker
