// Bits of 64 samples are turned around: from a word for each kind of bit to a byte for each sample,
// and back. Compiled once for each instruction set, see extract/slabs.cpp.
#if defined(ISOMESH_TRANSPOSE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_TRANSPOSE_INL_H_
#undef ISOMESH_TRANSPOSE_INL_H_
#else
#define ISOMESH_TRANSPOSE_INL_H_
#endif

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {

using Word = std::uint64_t;  // 64 samples of a row, the lowest bit the smallest x
inline constexpr unsigned kWordBits = 64;

using BitWords = std::array<Word, 8>;
using BitBytes = std::array<std::uint8_t, kWordBits>;

namespace squares {

// Swaps ever larger squares of bits across the diagonal (H. S. Warren, Hacker's Delight, 7-3).
HWY_INLINE Word turn(Word square) {
  Word swap = (square ^ square >> 7) & 0x00AA00AA00AA00AA;
  square ^= swap ^ swap << 7;
  swap = (square ^ square >> 14) & 0x0000CCCC0000CCCC;
  square ^= swap ^ swap << 14;
  swap = (square ^ square >> 28) & 0x00000000F0F0F0F0;
  return square ^ swap ^ swap << 28;
}

#if HWY_TARGET == HWY_AVX2
namespace hn = hwy::HWY_NAMESPACE;

using WideBytes = hn::CappedTag<std::uint8_t, 32>;
using Bytes = hn::Vec<WideBytes>;

template <int kShift>
HWY_INLINE Bytes swap_bits(Bytes bytes, Word mask) {
  const hn::Repartition<std::uint64_t, WideBytes> words;
  const auto square = hn::BitCast(words, bytes);
  const auto swap = hn::And(hn::Xor(square, hn::ShiftRight<kShift>(square)), hn::Set(words, mask));
  return hn::BitCast(WideBytes(), hn::Xor(square, hn::Xor(swap, hn::ShiftLeft<kShift>(swap))));
}

// Each of the four squares of eight bytes.
HWY_INLINE Bytes turn(Bytes bytes) {
  bytes = swap_bits<7>(bytes, 0x00AA00AA00AA00AA);
  bytes = swap_bits<14>(bytes, 0x0000CCCC0000CCCC);
  return swap_bits<28>(bytes, 0x00000000F0F0F0F0);
}

// One square of eight rows of eight bytes, of which four are in each register.
HWY_INLINE void turn_bytes(Bytes& low, Bytes& high) {
  const WideBytes bytes;
  const hn::Repartition<std::uint16_t, WideBytes> pairs;
  const hn::Repartition<std::uint32_t, WideBytes> fours;
  alignas(32) static constexpr std::array<std::uint8_t, 32> kPairs = {
      0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15,
      0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15};
  alignas(32) static constexpr std::array<std::uint32_t, 8> kFours = {0, 4, 1, 5, 2, 6, 3, 7};
  const auto in_pairs = hn::Load(bytes, kPairs.data());
  const auto a = hn::TableLookupBytes(low, in_pairs);
  const auto b = hn::TableLookupBytes(high, in_pairs);
  const auto even = hn::BitCast(pairs, hn::ConcatLowerLower(bytes, b, a));
  const auto odd = hn::BitCast(pairs, hn::ConcatUpperUpper(bytes, b, a));
  const auto in_fours = hn::SetTableIndices(fours, kFours.data());
  const auto gather = [&](auto rows) {
    return hn::BitCast(bytes, hn::TableLookupLanes(hn::BitCast(fours, rows), in_fours));
  };
  low = gather(hn::InterleaveLower(pairs, even, odd));
  high = gather(hn::InterleaveUpper(pairs, even, odd));
}
#endif

}  // namespace squares

// Bit i of byte j of the result is bit j of word i.
HWY_INLINE BitBytes transpose(const BitWords& words) {
  BitBytes bytes;
#if HWY_TARGET == HWY_AVX2
  const squares::WideBytes wide;
  const auto* from = reinterpret_cast<const std::uint8_t*>(words.data());
  auto low = squares::hn::LoadU(wide, from);
  auto high = squares::hn::LoadU(wide, from + 32);
  squares::turn_bytes(low, high);
  squares::hn::StoreU(squares::turn(low), wide, bytes.data());
  squares::hn::StoreU(squares::turn(high), wide, bytes.data() + 32);
#else
  for (unsigned group = 0; group < 8; ++group) {
    Word square = 0;  // row r: byte `group` of word r
    for (unsigned r = 0; r < 8; ++r) square |= (words[r] >> (group * 8) & 0xFF) << (r * 8);
    square = squares::turn(square);
    std::memcpy(bytes.data() + group * std::size_t{8}, &square, sizeof square);
  }
#endif
  return bytes;
}

// Bit j of word i of the result is bit i of byte j.
HWY_INLINE BitWords transpose(const BitBytes& bytes) {
  BitWords words = {};
#if HWY_TARGET == HWY_AVX2
  const squares::WideBytes wide;
  auto low = squares::turn(squares::hn::LoadU(wide, bytes.data()));
  auto high = squares::turn(squares::hn::LoadU(wide, bytes.data() + 32));
  squares::turn_bytes(low, high);
  auto* to = reinterpret_cast<std::uint8_t*>(words.data());
  squares::hn::StoreU(low, wide, to);
  squares::hn::StoreU(high, wide, to + 32);
#else
  for (unsigned group = 0; group < 8; ++group) {
    Word square = 0;
    std::memcpy(&square, bytes.data() + group * std::size_t{8}, sizeof square);
    square = squares::turn(square);
    for (unsigned r = 0; r < 8; ++r) words[r] |= (square >> (r * 8) & 0xFF) << (group * 8);
  }
#endif
  return words;
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
