// Draco's coding of whole symbols ("raw"). Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/codec/draco/rans.h"

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

// The header of `bytes` bytes of coded symbols.
std::vector<std::byte> head_of(const RawCoding& coding, std::size_t bytes);

}  // namespace isomesh::codec::edgebreaker
