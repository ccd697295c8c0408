#include "server/codec/draco/rans.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace isomesh::codec::edgebreaker {
namespace {

// The state stays within [4, 1024) * 2^precision.
constexpr std::uint32_t kLeastState = 4;
constexpr std::uint32_t kMostStateBits = 10;

// Two bits of a table's byte hold the number of bytes that follow, or mark a run of zeros.
constexpr std::uint32_t kZeros = 3;
constexpr std::uint32_t kMostZeros = 63;

int extra_bytes(std::uint32_t parts) { return parts < (1U << 6) ? 0 : parts < (1U << 14) ? 1 : 2; }

// A number of at most 30 bits; its first two bits hold its number of bytes.
std::byte* write_state(std::uint32_t state, std::byte* out) {
  const int bytes = state < (1U << 6) ? 1 : state < (1U << 14) ? 2 : state < (1U << 22) ? 3 : 4;
  state |= static_cast<std::uint32_t>(bytes - 1) << (8 * bytes - 2);
  std::memcpy(out, &state, sizeof state);
  return out + bytes;
}

// Reduces the most probable symbols' parts so that their sum becomes `sum` - `excess`.
void take_away(std::vector<std::uint32_t>& parts, std::int64_t sum, std::int64_t excess) {
  if (excess == 0) return;
  // Most symbols of a large alphabet have only one part, which they keep.
  std::vector<std::uint32_t> order;
  for (std::uint32_t symbol = 0; symbol < parts.size(); ++symbol) {
    if (parts[symbol] > 1) order.push_back(symbol);
  }
  std::ranges::stable_sort(order, std::greater<>(), [&](std::uint32_t i) { return parts[i]; });
  const std::int64_t wanted = sum - excess;
  while (excess > 0) {
    const double keep = static_cast<double>(wanted) / static_cast<double>(sum);
    for (const std::uint32_t symbol : order) {
      const std::int64_t has = parts[symbol];
      if (has <= 1 || excess == 0) break;
      const auto kept = static_cast<std::int64_t>(std::floor(keep * static_cast<double>(has)));
      const std::int64_t away =
          std::clamp<std::int64_t>(has - kept, 1, std::min<std::int64_t>(excess, has - 1));
      parts[symbol] -= static_cast<std::uint32_t>(away);
      sum -= away;
      excess -= away;
    }
  }
}

}  // namespace

Probabilities probabilities_of(std::span<const std::uint64_t> counts, int precision) {
  Probabilities result = {precision, std::vector<std::uint32_t>(counts.size())};
  const auto whole = std::int64_t{1} << precision;
  std::uint64_t total = 0;
  for (const std::uint64_t count : counts) total += count;
  const double scale = static_cast<double>(whole) / static_cast<double>(total);
  std::int64_t sum = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    const double parts = std::floor(static_cast<double>(counts[i]) * scale + 0.5);
    result.parts[i] = static_cast<std::uint32_t>(std::max(1.0, parts));
    sum += result.parts[i];
  }
  if (sum < whole) {
    *std::ranges::max_element(result.parts) += static_cast<std::uint32_t>(whole - sum);
  } else {
    take_away(result.parts, sum, sum - whole);
  }
  while (result.parts.back() == 0) result.parts.pop_back();
  return result;
}

double Probabilities::data_bits(std::span<const std::uint64_t> counts) const {
  double bits = 0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (counts[i] == 0) continue;
    bits += static_cast<double>(counts[i]) * (precision - std::log2(static_cast<double>(parts[i])));
  }
  return bits;
}

double Probabilities::table_bits() const {
  double bits = 0;
  for (const std::uint32_t part : parts) bits += part == 0 ? 0 : 8 * (1 + extra_bytes(part));
  return bits;
}

void Probabilities::write(ByteWriter& out) const {
  out.varint(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const std::uint32_t part = parts[i];
    if (part == 0) {
      std::uint32_t more = 0;  // zeros; the last part is never zero
      while (more < kMostZeros && parts[i + more + 1] == 0) ++more;
      out.byte(more << 2 | kZeros);
      i += more;
      continue;
    }
    const int extra = extra_bytes(part);
    out.byte((part << 2 | static_cast<std::uint32_t>(extra)) & 0xFFU);
    for (int byte = 0; byte < extra; ++byte) out.byte(part >> (8 * byte + 6) & 0xFFU);
  }
}

RansEncoder::RansEncoder(const Probabilities& probabilities, std::byte* out)
    : precision_(probabilities.precision),
      state_(kLeastState << probabilities.precision),
      out_(out) {
  std::uint32_t below = 0;
  for (const std::uint32_t parts : probabilities.parts) {
    steps_.push_back(step_of(parts, below, precision_));
    below += parts;
  }
}

// Coding a symbol is state -> state / parts * 2^precision + below + state % parts, which equals
// state + bias + quotient * (2^precision - parts).
RansEncoder::Step RansEncoder::step_of(std::uint32_t parts, std::uint32_t below, int precision) {
  const std::uint32_t whole = 1U << precision;
  if (parts == 0) return {};
  Step step;
  step.limit = parts << kMostStateBits;
  step.rest = whole - parts;
  if (parts == 1) {
    // The reciprocal gives state - 1.
    step.reciprocal = ~std::uint32_t{0};
    step.bias = below + whole - 1;
  } else {
    const auto bits = static_cast<std::uint32_t>(std::bit_width(parts - 1));
    step.reciprocal =
        static_cast<std::uint32_t>(((std::uint64_t{1} << (bits + 31)) + parts - 1) / parts);
    step.bias = below;
    step.shift = bits - 1;
  }
  return step;
}

// The number of bytes to write is unpredictable, so there are no branches.
template <int kMostBytes>
void RansEncoder::put_all(const std::uint16_t* begin, const std::uint16_t* end) {
  const Step* const steps = steps_.data();
  std::uint32_t state = state_;
  std::byte* out = out_;
  for (const std::uint16_t* symbol = end; symbol != begin;) {
    const Step& step = steps[*--symbol];
    std::memcpy(out, &state, sizeof state);
    std::uint32_t bytes = (state >= step.limit ? 1U : 0U) + (state >> 8 >= step.limit ? 1U : 0U);
    if constexpr (kMostBytes == 3) bytes += state >> 16 >= step.limit ? 1U : 0U;
    out += bytes;
    const std::uint32_t rest = state >> (8 * bytes);
    const auto quotient =
        static_cast<std::uint32_t>((std::uint64_t{rest} * step.reciprocal >> 32) >> step.shift);
    state = rest + step.bias + quotient * step.rest;
  }
  state_ = state;
  out_ = out;
}

void RansEncoder::put_backwards(const std::uint16_t* begin, const std::uint16_t* end) {
  // A state below 2^(10 + precision) is at least 2^10 after two bytes for precisions up to 16.
  if (precision_ <= 16) {
    put_all<2>(begin, end);
  } else {
    put_all<3>(begin, end);
  }
}

std::byte* RansEncoder::finish() {
  out_ = write_state(state_ - (kLeastState << precision_), out_);
  return out_;
}

void write_bits(const std::vector<bool>& bits, ByteWriter& out) {
  constexpr std::uint32_t kWhole = 256;
  constexpr std::uint32_t kLeast = 4096;
  const auto zeros = static_cast<double>(std::ranges::count(bits, false));
  const double share = zeros / static_cast<double>(std::max<std::size_t>(1, bits.size()));
  const std::uint32_t zero =
      std::clamp(static_cast<std::uint32_t>(share * kWhole + 0.5), 1U, kWhole - 1);
  const std::uint32_t one = kWhole - zero;
  std::vector<std::byte> bytes;
  std::uint32_t state = kLeast;
  for (std::size_t i = bits.size(); i-- > 0;) {
    const std::uint32_t parts = bits[i] ? one : zero;
    if (state >= kLeast * parts) {
      bytes.push_back(static_cast<std::byte>(state & 0xFFU));
      state >>= 8;
    }
    state = state / parts * kWhole + state % parts + (bits[i] ? 0 : one);
  }
  std::byte last[4];
  bytes.insert(bytes.end(), last, write_state(state - kLeast, last));
  out.byte(zero);
  out.counted(bytes);
}

}  // namespace isomesh::codec::edgebreaker
