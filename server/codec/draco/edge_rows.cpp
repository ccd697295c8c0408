#include "server/codec/draco/edge_rows.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace isomesh::codec::edgebreaker {
namespace {

constexpr std::uint64_t key_of(Vertex lower, Vertex upper) {
  return std::uint64_t{lower} << 32 | upper;
}

// Four lanes: GCC and Clang compile them for every processor.
using Lanes = std::uint32_t __attribute__((vector_size(16)));

// Bit i is set if slots[i] == value.
std::uint32_t equal_slots(const std::array<std::uint32_t, 8>& slots, std::uint32_t value) {
  Lanes low;
  Lanes high;
  std::memcpy(&low, slots.data(), sizeof low);
  std::memcpy(&high, slots.data() + 4, sizeof high);
  const Lanes bits =
      ((low == value) & Lanes{1, 2, 4, 8}) | ((high == value) & Lanes{16, 32, 64, 128});
  const Lanes pairs = bits | __builtin_shufflevector(bits, bits, 2, 3, 0, 1);
  return pairs[0] | pairs[1];
}

}  // namespace

void EdgeRows::begin(const Range& range, std::uint32_t* words) {
  range_ = range;
  words_ = words;
  clash_ = false;
  waiting_.clear();
  crowded_.clear();
  // A ring if it is smaller than one row per vertex.
  const std::uint64_t ring = std::bit_ceil(std::max<std::uint64_t>(1, range.window));
  const std::uint64_t rows = std::min<std::uint64_t>(ring, std::max<Vertex>(1, range.owned));
  mask_ = rows == ring ? static_cast<std::uint32_t>(ring - 1) : ~std::uint32_t{0};
  spare_ = static_cast<std::uint32_t>(rows);
  rows_.resize_for_overwrite(rows + 1);
  std::memset(used_.resize_for_overwrite(rows + 1), 0, rows + 1);
  std::memset(found_.resize_for_overwrite(rows + 1), 0, rows + 1);
  downs_.resize_for_overwrite(3 * std::size_t{kBlock} + 1);
}

void EdgeRows::add(const mesh::Triangle* triangles, Face begin, Face end) {
  for (Face block = begin; block < end; block += std::min(kBlock, end - block)) {
    const std::size_t downs = scatter(triangles, block, std::min(end, block + kBlock));
    const std::size_t before = waiting_.size();
    waiting_.resize(before + downs + 1);
    const std::size_t alone = match(downs_.data(), downs, waiting_.data() + before);
    waiting_.resize(before + alone);
  }
}

std::size_t EdgeRows::scatter(const mesh::Triangle* triangles, Face begin, Face end) {
  // Local copies: the compiler assumes that byte stores may alias the members.
  const Vertex first = range_.first;
  const Vertex owned = range_.owned;
  const std::uint32_t mask = mask_;
  const std::uint32_t spare = spare_;
  Row* const rows = rows_.data();
  std::uint8_t* const used = used_.data();
  Down* down = downs_.data();
  bool degenerate = false;
  const auto edge = [&](Vertex from, Vertex to, Corner corner) {
    // All ones for an ascending half-edge. The direction is unpredictable, so arithmetic replaces a
    // comparison, which compilers would turn into a branch.
    const auto up = static_cast<std::uint32_t>((std::uint64_t{from} - to) >> 32);
    const Vertex lower = to ^ ((from ^ to) & up);
    const Vertex upper = from ^ to ^ lower;
    const Vertex own = lower - first;
    if (own >= owned) [[unlikely]] {
      return;  // of another slab
    }
    const std::uint32_t row = spare ^ (((own & mask) ^ spare) & up);
    const std::uint32_t slot = used[row];
    if (slot == kSlots) [[unlikely]] {
      return take_crowded(lower, upper, corner);
    }
    rows[row].upper[slot] = upper;
    rows[row].corner[slot] = corner;
    used[row] = static_cast<std::uint8_t>(slot - up);
    *down = {corner, lower, upper};
    down += 1 + static_cast<std::int32_t>(up);
  };
  for (Face face = begin; face < end; ++face) {
    const auto [a, b, c] = triangles[face];
    degenerate |= (a == b) | (b == c) | (c == a);
    edge(b, c, corner_of(face, 0));
    edge(c, a, corner_of(face, 1));
    edge(a, b, corner_of(face, 2));
  }
  clash_ |= degenerate;
  return static_cast<std::size_t>(down - downs_.data());
}

std::size_t EdgeRows::match(const Down* downs, std::size_t count, Down* rest) {
  const Vertex first = range_.first;
  const std::uint32_t mask = mask_;
  const Row* const rows = rows_.data();
  const std::uint8_t* const used = used_.data();
  std::uint8_t* const found = found_.data();
  std::uint32_t* const words = words_;
  const std::uint32_t spare = range_.spare_word;
  Down* alone = rest;
  std::uint32_t clash = 0;
  for (const Down *at = downs, *const end = downs + count; at != end; ++at) {
    const Down down = {at->corner, at->lower, at->upper};
    const std::uint32_t row = (down.lower - first) & mask;
    const std::uint32_t equal = equal_slots(rows[row].upper, down.upper) & ((1U << used[row]) - 1);
    const std::uint32_t one = equal & (0U - equal);
    // Two in the same direction, or a partner that was already matched.
    clash |= (equal ^ one) | (found[row] & one);
    found[row] = static_cast<std::uint8_t>(found[row] | one);
    const auto slot = static_cast<std::uint32_t>(std::countr_zero(one | 1U << (kSlots - 1)));
    const Corner partner = rows[row].corner[slot];
    words[previous(down.corner)] = partner;
    // 1 if there is one; again without a comparison.
    const std::uint32_t met = (0U - one) >> 31;
    words[spare ^ ((previous(partner) ^ spare) & (0U - met))] = down.corner;
    *alone = down;
    alone += 1 - met;
  }
  clash_ |= clash != 0;
  return static_cast<std::size_t>(alone - rest);
}

void EdgeRows::finish(Vertex begin, Vertex end, Corner none, std::vector<Corner>& boundary) {
  const std::size_t asking = match(waiting_.data(), waiting_.size(), waiting_.data());
  std::size_t kept = 0;
  for (std::size_t i = 0; i < asking; ++i) {
    const Down down = waiting_[i];
    if (down.lower >= end) {
      waiting_[kept++] = down;
    } else if (const auto partner = crowded_.find(key_of(down.lower, down.upper));
               partner != crowded_.end()) {
      words_[previous(down.corner)] = partner->second;
      words_[previous(partner->second)] = down.corner;
      crowded_.erase(partner);
    } else {
      set_boundary(down.corner, none, boundary);
    }
  }
  waiting_.resize(kept);
  for (Vertex vertex = begin; vertex < end; ++vertex) {
    const std::uint32_t row = row_of(vertex);
    std::uint32_t lonely = ((1U << used_[row]) - 1) & ~std::uint32_t{found_[row]};
    for (; lonely != 0; lonely &= lonely - 1) {
      const auto slot = static_cast<std::size_t>(std::countr_zero(lonely));
      set_boundary(rows_[row].corner[slot], none, boundary);
    }
    used_[row] = 0;
    found_[row] = 0;
  }
  if (!crowded_.empty()) [[unlikely]] {
    std::erase_if(crowded_, [&](const auto& up) {
      if (up.first >> 32 >= end) return false;
      set_boundary(up.second, none, boundary);
      return true;
    });
  }
}

void EdgeRows::take_crowded(Vertex lower, Vertex upper, Corner corner) {
  if (!crowded_.emplace(key_of(lower, upper), corner).second) clash_ = true;
}

void EdgeRows::set_boundary(Corner corner, Corner none, std::vector<Corner>& boundary) {
  words_[previous(corner)] = none;
  boundary.push_back(corner);
}

}  // namespace isomesh::codec::edgebreaker
