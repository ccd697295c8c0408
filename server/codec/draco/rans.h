// rANS, the entropy coder of Draco's streams (Duda, "Asymmetric numeral systems", 2013). Private to
// this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/codec/draco/bytes.h"

namespace isomesh::codec::edgebreaker {

// The symbols' probabilities, as parts of 2^precision.
struct Probabilities {
  int precision = 0;
  std::vector<std::uint32_t> parts;  // of the symbols 0, 1, ...; the last is not 0

  // The size of the symbols with these counts, and of the table, in bits.
  double data_bits(std::span<const std::uint64_t> counts) const;
  double table_bits() const;
  void write(ByteWriter& out) const;
};

// Returns parts with the exact sum, at least one for each symbol that occurs. Requires at least one
// nonzero count and at most 2^precision of them. `precision` is 12..20.
Probabilities probabilities_of(std::span<const std::uint64_t> counts, int precision);

// Codes symbols backwards, because the decoder reads them forwards. Not thread safe.
class RansEncoder {
 public:
  // `out` has room for most_bytes of all symbols.
  RansEncoder(const Probabilities& probabilities, std::byte* out);

  // The largest size of that many symbols with that many data_bits. The state is at least four
  // times as large as any symbol's parts, so rounding costs at most log2(5 / 4) bits per symbol.
  static std::size_t most_bytes(double data_bits, std::uint64_t symbols) {
    constexpr double kRoundingBits = 0.33;
    constexpr std::size_t kSlack = 64;
    return kSlack +
           static_cast<std::size_t>((data_bits + kRoundingBits * static_cast<double>(symbols)) / 8);
  }

  // Codes end[-1], end[-2], ... begin[0].
  void put_backwards(const std::uint16_t* begin, const std::uint16_t* end);

  // Writes the final state. Returns the end of the bytes.
  std::byte* finish();

 private:
  // Divides by a symbol's parts as a multiplication with their reciprocal, after Giesen's ryg_rans.
  struct Step {
    std::uint32_t limit = 0;  // from this state on a byte is written
    std::uint32_t reciprocal = 0;
    std::uint32_t bias = 0;
    std::uint32_t rest : 24 = 0;  // 2^precision - parts
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

// Writes bits as Draco's binary rANS, with a probability of eight bits. For few bits.
void write_bits(const std::vector<bool>& bits, ByteWriter& out);

}  // namespace isomesh::codec::edgebreaker
