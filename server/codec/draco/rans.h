// rANS, the entropy coder of Draco's streams (Duda, "Asymmetric numeral systems", 2013); private to
// this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/codec/draco/bytes.h"

namespace isomesh::codec::edgebreaker {

// How often each symbol occurs, as parts of 2^precision.
struct Probabilities {
  int precision = 0;
  std::vector<std::uint32_t> parts;  // of the symbols 0, 1, ...; the last is not 0

  // What the symbols take when they occur that often, and the table, in bits.
  double data_bits(std::span<const std::uint64_t> counts) const;
  double table_bits() const;
  void write(ByteWriter& out) const;
};

// Parts that sum up exactly, at least one for what occurs. At least one count is not 0, and as many
// as are not are at most 2^precision. `precision` is 12..20.
Probabilities probabilities_of(std::span<const std::uint64_t> counts, int precision);

// Codes symbols backwards: the decoder reads them forwards. Not thread safe.
class RansEncoder {
 public:
  // `out` has room for most_bytes of what is put.
  RansEncoder(const Probabilities& probabilities, std::byte* out);

  // What that many symbols of so many data_bits can take: the state is at least four times as large
  // as any symbol's parts, so rounding costs at most the logarithm of 5 / 4 a symbol.
  static std::size_t most_bytes(double data_bits, std::uint64_t symbols) {
    constexpr double kRoundingBits = 0.33;
    constexpr std::size_t kSlack = 64;
    return kSlack +
           static_cast<std::size_t>((data_bits + kRoundingBits * static_cast<double>(symbols)) / 8);
  }

  // Takes end[-1], end[-2], ... begin[0].
  void put_backwards(const std::uint16_t* begin, const std::uint16_t* end);

  // Writes what is left. Returns where the bytes end.
  std::byte* finish();

 private:
  // Division by a symbol's parts as a multiplication by their reciprocal, after Giesen's ryg_rans.
  struct Step {
    std::uint32_t limit = 0;  // from which on the state gives a byte away
    std::uint32_t reciprocal = 0;
    std::uint32_t bias = 0;
    std::uint32_t rest : 24 = 0;  // 2^precision less the parts
    std::uint32_t shift : 8 = 0;
  };

  static Step step_of(std::uint32_t parts, std::uint32_t below, int precision);
  template <int kMostBytes>
  void put_all(const std::uint16_t* begin, const std::uint16_t* end);

  std::vector<Step> steps_;
  int precision_;
  std::uint32_t state_;
  std::byte* out_;
};

// Bits in Draco's form of a binary rANS, for when there are few: eight bits of precision.
void write_bits(const std::vector<bool>& bits, ByteWriter& out);

}  // namespace isomesh::codec::edgebreaker
