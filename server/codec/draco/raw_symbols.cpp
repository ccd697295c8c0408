#include "server/codec/draco/raw_symbols.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "server/codec/draco/bytes.h"

namespace isomesh::codec::edgebreaker {
namespace {

constexpr std::uint32_t kRawSymbols = 1;

// The stream stores the precision as the bit length of the number of distinct values. Every length
// is valid; the best trade-off between precision and table size is taken.
constexpr int kMostLengthBits = 18;
constexpr int kLengthsTried = 3;
constexpr int kLeastPrecision = 12;
constexpr int kMostPrecision = 20;

int precision_of(int length_bits) {
  return std::clamp(3 * length_bits / 2, kLeastPrecision, kMostPrecision);
}

}  // namespace

RawCoding best_coding(std::span<const std::uint64_t> counts) {
  const auto different = static_cast<std::uint64_t>(
      std::ranges::count_if(counts, [](std::uint64_t count) { return count != 0; }));
  const int longest = std::min(kMostLengthBits, static_cast<int>(std::bit_width(different)));
  RawCoding best;
  for (int length = longest; length >= std::max(1, longest - kLengthsTried + 1); --length) {
    const int precision = precision_of(length);
    if (std::uint64_t{1} << precision < 2 * different) break;
    Probabilities probabilities = probabilities_of(counts, precision);
    RawCoding coding = {length, probabilities.data_bits(counts), probabilities.table_bits(), {}};
    if (best.length_bits == 0 || coding.all_bits() < best.all_bits()) {
      coding.probabilities = std::move(probabilities);
      best = std::move(coding);
    }
    if (precision == kLeastPrecision) break;
  }
  return best;
}

CodedValues code_raw(const RawCoding& coding, const std::uint16_t* symbols, std::size_t per_vertex,
                     const ValueOrder& order, mesh::Buffer<std::byte>& memory) {
  memory.resize_for_overwrite(
      RansEncoder::most_bytes(coding.data_bits, per_vertex * std::uint64_t{order.count()}));
  RansEncoder encoder(coding.probabilities, memory.data());
  // The decoder visits components from last to first.
  for (const ValueRange& component : order.components()) {
    encoder.put_backwards(symbols + per_vertex * component.begin,
                          symbols + per_vertex * component.end);
  }
  const auto bytes = static_cast<std::size_t>(encoder.finish() - memory.data());
  ByteWriter out;
  out.byte(kRawSymbols);
  out.byte(static_cast<std::uint32_t>(coding.length_bits));
  coding.probabilities.write(out);
  out.varint(bytes);
  return {out.take(), {memory.data(), bytes}};
}

}  // namespace isomesh::codec::edgebreaker
