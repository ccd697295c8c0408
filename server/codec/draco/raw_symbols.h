// Draco's coding of whole symbols ("raw"). Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/codec/draco/rans.h"
#include "server/codec/draco/value_order.h"
#include "server/mesh/buffer.h"

namespace isomesh::codec::edgebreaker {

// The smallest coding for the counts of symbols.
struct RawCoding {
  int length_bits = 0;
  double data_bits = 0;
  double table_bits = 0;
  Probabilities probabilities;

  double all_bits() const { return data_bits + table_bits; }
};

// At least one count is nonzero.
RawCoding best_coding(std::span<const std::uint64_t> counts);

// Encoded values of an attribute; the coder owns the data.
struct CodedValues {
  std::vector<std::byte> head;
  std::span<const std::byte> data;
};

// Codes the symbols of all components, `per_vertex` for each vertex; `memory` gets the data.
CodedValues code_raw(const RawCoding& coding, const std::uint16_t* symbols, std::size_t per_vertex,
                     const ValueOrder& order, mesh::Buffer<std::byte>& memory);

}  // namespace isomesh::codec::edgebreaker
