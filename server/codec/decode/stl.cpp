#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <numeric>
#include <vector>

#include "proto/error.h"
#include "server/codec/decode/formats.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec::decoding {
namespace {

constexpr std::size_t kHeaderBytes = 84;
constexpr std::size_t kFacetBytes = 50;
constexpr std::size_t kNormalBytes = 12;
constexpr std::size_t kFacetsPerTask = std::size_t{1} << 14;
// Places are dealt out by their hashes, so that those of each share are found in a table of its own
// that stays in the cache.
constexpr int kShareBits = 8;
constexpr std::size_t kShares = std::size_t{1} << kShareBits;

class Facets {
 public:
  explicit Facets(Bytes file) : file_(file) {}

  std::size_t size() const { return (file_.size() - kHeaderBytes) / kFacetBytes; }

  // Negative zeros as positive ones, which are the same place.
  mesh::Vec3 place(std::uint32_t corner) const {
    const std::size_t facet = kHeaderBytes + corner / 3 * kFacetBytes;
    auto place =
        value_at<mesh::Vec3>(file_, facet + kNormalBytes + corner % 3 * sizeof(mesh::Vec3));
    for (float& coordinate : place) coordinate += 0.0F;
    return place;
  }

 private:
  Bytes file_;
};

using Key = std::array<std::uint32_t, 3>;

std::uint64_t hash_of(const Key& key) {
  // Odd constants near 2^64 divided by the golden ratio; the upper bits are well mixed.
  std::uint64_t hash = (std::uint64_t{key[0]} << 32 | key[1]) * 0x9E3779B97F4A7C15U;
  hash = (hash ^ hash >> 32 ^ key[2]) * 0xD6E8FEB86659FD93U;
  return hash ^ hash >> 32;
}

// Finds the first corner at each corner's place: within some facets, most of whose corners have
// company near by, and then of those that were found there across all.
class Weld {
 public:
  Weld(const Facets& facets, const mesh::Context& context, std::span<std::uint32_t> first)
      : facets_(facets),
        quiet_{context.stop, nullptr},
        first_(first),
        tasks_(tasks_of(facets.size(), kFacetsPerTask)) {}

  void run() {
    std::vector<std::array<std::uint32_t, kShares>> counts(tasks_);
    mesh::parallel_for(quiet_, tasks_, [&](std::size_t task) { weld_task(task, counts[task]); });
    deal(counts);
    mesh::parallel_for(quiet_, kShares, [&](std::size_t share) {
      weld_share({dealt_.data() + ends_[share], dealt_.data() + ends_[share + 1]});
    });
    // What was first among some facets knows by now what is first among all.
    mesh::parallel_for(quiet_, tasks_, [&](std::size_t task) {
      for_each_corner(task, [&](std::uint32_t corner) {
        if (first_[corner] != corner) first_[corner] = first_[first_[corner]];
      });
    });
  }

 private:
  struct Place {
    Key key;
    std::uint32_t corner;
  };
  static constexpr std::uint32_t kFree = std::numeric_limits<std::uint32_t>::max();

  template <class Visit>
  void for_each_corner(std::size_t task, const Visit& visit) const {
    const std::size_t end = std::min(first_.size(), (task + 1) * 3 * kFacetsPerTask);
    for (std::size_t corner = task * 3 * kFacetsPerTask; corner < end; ++corner) {
      visit(static_cast<std::uint32_t>(corner));
    }
  }

  void weld_task(std::size_t task, std::array<std::uint32_t, kShares>& count) {
    count.fill(0);
    Table table(3 * kFacetsPerTask);
    for_each_corner(task, [&](std::uint32_t corner) {
      const Key key = std::bit_cast<Key>(facets_.place(corner));
      const std::uint64_t hash = hash_of(key);
      first_[corner] = table.find_or_insert(hash, {key, corner});
      if (first_[corner] == corner) ++count[share_of(hash)];
    });
  }

  // Those that are first among their facets to their shares, in their order.
  void deal(std::vector<std::array<std::uint32_t, kShares>>& next) {
    std::uint32_t begin = 0;
    for (std::size_t share = 0; share < kShares; ++share) {
      ends_[share] = begin;
      for (auto& counts : next) begin += std::exchange(counts[share], begin);
    }
    ends_[kShares] = begin;
    dealt_.resize_for_overwrite(begin);
    mesh::parallel_for(quiet_, tasks_, [&](std::size_t task) {
      for_each_corner(task, [&](std::uint32_t corner) {
        if (first_[corner] != corner) return;
        const Key key = std::bit_cast<Key>(facets_.place(corner));
        dealt_[next[task][share_of(hash_of(key))]++] = {key, corner};
      });
    });
  }

  void weld_share(std::span<const Place> places) {
    Table table(places.size());
    for (const Place& place : places) {
      first_[place.corner] = table.find_or_insert(hash_of(place.key), place);
    }
  }

  static std::size_t share_of(std::uint64_t hash) { return hash >> (64 - kShareBits); }

  // Open addressing; at most half of it is filled.
  class Table {
   public:
    explicit Table(std::size_t most)
        : slots_(std::bit_ceil(2 * most + 1), {{}, kFree}), mask_(slots_.size() - 1) {}

    // The corner that came first with its place.
    std::uint32_t find_or_insert(std::uint64_t hash, const Place& place) {
      std::size_t at = hash & mask_;
      while (slots_[at].corner != kFree && slots_[at].key != place.key) at = (at + 1) & mask_;
      if (slots_[at].corner == kFree) slots_[at] = place;
      return slots_[at].corner;
    }

   private:
    std::vector<Place> slots_;
    const std::size_t mask_;
  };

  const Facets& facets_;
  const mesh::Context quiet_;
  std::span<std::uint32_t> first_;
  const std::size_t tasks_;
  std::array<std::size_t, kShares + 1> ends_ = {};
  mesh::Buffer<Place> dealt_;
};

// Numbers the places in the order of their first corners.
void number_vertices(const Facets& facets, std::span<const std::uint32_t> first,
                     const mesh::Context& context, DecodedSurface& surface) {
  const mesh::Context quiet = {context.stop, nullptr};
  const std::size_t tasks = tasks_of(facets.size(), kFacetsPerTask);
  const auto corners_of = [&](std::size_t task) {
    return std::pair(task * 3 * kFacetsPerTask,
                     std::min(first.size(), (task + 1) * 3 * kFacetsPerTask));
  };
  std::vector<std::uint32_t> begins(tasks + 1, 0);
  mesh::parallel_for(quiet, tasks, [&](std::size_t task) {
    const auto [begin, end] = corners_of(task);
    for (std::size_t c = begin; c < end; ++c) begins[task + 1] += first[c] == c ? 1 : 0;
  });
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  surface.positions.resize_for_overwrite(begins.back());
  mesh::Buffer<std::uint32_t> number;  // of a place, at its first corner
  number.resize_for_overwrite(first.size());
  mesh::parallel_for(quiet, tasks, [&](std::size_t task) {
    const auto [begin, end] = corners_of(task);
    std::uint32_t next = begins[task];
    for (std::size_t c = begin; c < end; ++c) {
      if (first[c] != c) continue;
      surface.positions[next] = facets.place(static_cast<std::uint32_t>(c));
      number[c] = next++;
    }
  });
  surface.triangles.resize_for_overwrite(facets.size());
  mesh::parallel_for(quiet, tasks, [&](std::size_t task) {
    const auto [begin, end] = corners_of(task);
    for (std::size_t c = begin; c < end; ++c) surface.triangles[c / 3][c % 3] = number[first[c]];
  });
}

}  // namespace

DecodedSurface decode_stl(Bytes file, const mesh::Context& context) {
  if (file.size() < kHeaderBytes) refuse(MeshFormat::kStl, "it ends within its header");
  const auto count = value_at<std::uint32_t>(file, kHeaderBytes - 4);
  if (file.size() != kHeaderBytes + count * kFacetBytes) {
    refuse(MeshFormat::kStl, "it has " + std::to_string(file.size()) + " bytes, but its " +
                                 std::to_string(count) + " triangles take " +
                                 std::to_string(kHeaderBytes + count * kFacetBytes));
  }
  if (count > std::numeric_limits<std::uint32_t>::max() / 3) {
    throw Error(ErrorCode::kTooLarge, "The surface has " + std::to_string(count) +
                                          " triangles, more corners than 32 bits can number.");
  }
  const Facets facets(file);
  mesh::Buffer<std::uint32_t> first;
  first.resize_for_overwrite(3 * facets.size());
  Weld(facets, context, first.span()).run();
  DecodedSurface surface;
  number_vertices(facets, first.span(), context, surface);
  return surface;
}

}  // namespace isomesh::codec::decoding
