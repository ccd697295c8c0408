#include "server/codec/draco/residual_coder.h"

#include <algorithm>
#include <array>
#include <bit>

#include "server/codec/draco/bytes.h"
#include "server/codec/draco/rans.h"

namespace isomesh::codec::edgebreaker {
namespace {

constexpr std::uint32_t kTaggedSymbols = 0;
constexpr int kTagPrecision = 12;

// The bit length of a vertex's largest residual, at least one.
std::uint32_t bits_of(const std::uint16_t* symbols) {
  return static_cast<std::uint32_t>(
      std::bit_width(static_cast<std::uint32_t>(symbols[0] | symbols[1] | symbols[2] | 1)));
}

using TagCounts = std::array<std::uint64_t, 18>;

// The size of tagged values, in bits, estimated from a sample of the vertices.
double tagged_bits(const Residuals& residuals, std::uint32_t vertices) {
  constexpr std::uint32_t kLookedAt = 1 << 16;
  const std::uint32_t step = std::max(1U, vertices / kLookedAt);
  TagCounts counts = {};
  double values = 0;
  double looked_at = 0;
  for (std::uint32_t vertex = 0; vertex < vertices; vertex += step) {
    const std::uint32_t bits = bits_of(residuals.symbols() + 3 * std::size_t{vertex});
    ++counts[bits];
    values += 3 * bits;
    ++looked_at;
  }
  const Probabilities probabilities = probabilities_of(counts, kTagPrecision);
  return (values + probabilities.data_bits(counts)) * vertices / looked_at +
         probabilities.table_bits();
}

}  // namespace

CodedValues ResidualCoder::code(const Residuals& residuals, const ValueOrder& order,
                                std::span<const Histogram> histograms) {
  std::vector<std::uint64_t> counts(residuals.wrap().symbols());
  for (std::uint32_t symbol = 0; symbol < counts.size(); ++symbol) {
    for (const Histogram& histogram : histograms) counts[symbol] += histogram.count(symbol);
  }
  const RawCoding coding = best_coding(counts);
  if (tagged_bits(residuals, order.count()) < coding.all_bits()) {
    return code_tagged(residuals, order);
  }
  return code_raw(coding, residuals.symbols(), 3, order, coded_);
}

CodedValues ResidualCoder::code_tagged(const Residuals& residuals, const ValueOrder& order) {
  TagCounts counts = {};
  bits_.resize_for_overwrite(order.count());
  for (std::uint32_t vertex = 0; vertex < order.count(); ++vertex) {
    const std::uint32_t bits = bits_of(residuals.symbols() + 3 * std::size_t{vertex});
    bits_[vertex] = static_cast<std::uint16_t>(bits);
    ++counts[bits];
  }
  const Probabilities probabilities = probabilities_of(counts, kTagPrecision);
  std::uint64_t value_bits = 0;
  for (std::size_t tag = 0; tag < counts.size(); ++tag) value_bits += 3 * tag * counts[tag];
  std::vector<std::byte> tags(
      RansEncoder::most_bytes(probabilities.data_bits(counts), order.count()));
  RansEncoder encoder(probabilities, tags.data());
  for (const ValueRange& component : order.components()) {
    encoder.put_backwards(bits_.data() + component.begin, bits_.data() + component.end);
  }
  const std::byte* const end = encoder.finish();
  ByteWriter out;
  out.byte(kTaggedSymbols);
  probabilities.write(out);
  out.counted(std::span(tags).first(static_cast<std::size_t>(end - tags.data())));

  const std::size_t bytes = BitWriter::bytes_of(value_bits);
  BitWriter values(coded_.resize_for_overwrite(bytes));
  for (auto component = order.components().rbegin(); component != order.components().rend();
       ++component) {
    for (std::uint32_t vertex = component->begin; vertex < component->end; ++vertex) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        values.put(residuals.symbols()[3 * std::size_t{vertex} + axis], bits_[vertex]);
      }
    }
  }
  values.finish();
  return {out.take(), {coded_.data(), bytes}};
}

}  // namespace isomesh::codec::edgebreaker
