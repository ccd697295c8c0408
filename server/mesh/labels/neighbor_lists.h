// Lists of neighbours, laid out for loops over all of them; private to the kernels.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {

// The neighbours of a number of things. Each has eight places, filled up with the number of all
// things, so most loops have no end that a processor would have to guess. Safe to read from several
// threads.
class NeighborLists {
 public:
  NeighborLists() = default;

  // neighbors(i, list) appends those of thing i to an empty list; it is called from several
  // threads. `count` is less than 2^31. Throws Error kCancelled.
  template <class Neighbors>
  NeighborLists(std::size_t count, const Context& context, const Neighbors& neighbors)
      : count_(static_cast<std::uint32_t>(count)), more_(chunks_of(count)) {
    degrees_.resize_for_overwrite(count);
    places_.resize_for_overwrite(count * kPlaces);
    for_chunks(context, count, [&](std::size_t begin, std::size_t end) {
      std::vector<std::uint32_t>& more = more_[begin / kChunk];
      std::vector<std::uint32_t> list;
      for (std::size_t i = begin; i < end; ++i) {
        list.clear();
        neighbors(i, list);
        degrees_[i] = static_cast<std::uint16_t>(list.size());
        std::uint32_t* const places = &places_[i * kPlaces];
        const std::size_t first = list.size() > kPlaces ? kPlaces - 1 : list.size();
        std::copy_n(list.begin(), first, places);
        std::fill(places + first, places + kPlaces, count_);
        if (first == list.size()) continue;
        places[first] += static_cast<std::uint32_t>(more.size()) + 1;
        more.insert(more.end(), list.begin() + kPlaces - 1, list.end());
        more.push_back(count_);
      }
    });
  }

  std::size_t degree(std::size_t i) const { return degrees_[i]; }

  // Calls visit(neighbour) for each of i's, in their order, and then maybe visit(number of all).
  template <class Visit>
  void visit(std::size_t i, const Visit& visit) const {
    const std::uint32_t* const places = &places_[i * kPlaces];
    for (std::size_t n = 0; n < kPlaces - 1; ++n) visit(places[n]);
    const std::uint32_t last = places[kPlaces - 1];
    if (last <= count_) return visit(last);
    const std::vector<std::uint32_t>& more = more_[i / kChunk];
    for (std::size_t n = last - count_ - 1; more[n] != count_; ++n) visit(more[n]);
  }

  // The sum over the neighbours. A buffer has a zero behind its last element.
  template <class Value>
  Value sum(std::size_t i, const Buffer<Value>& values) const {
    Value sum = {};
    visit(i, [&](std::uint32_t neighbor) { sum += values[neighbor]; });
    return sum;
  }

  // An estimate of the memory for so many things.
  static std::uint64_t bytes(std::uint64_t count) {
    return count * (kPlaces * sizeof(std::uint32_t) + sizeof(std::uint16_t)) * 5 / 4;
  }

 private:
  static constexpr std::size_t kPlaces = 8;

  std::uint32_t count_ = 0;
  Buffer<std::uint16_t> degrees_;
  // If there are more neighbours, the last place tells where they follow in `more_`, counted from
  // count_ + 1. There count_ ends them.
  Buffer<std::uint32_t> places_;
  std::vector<std::vector<std::uint32_t>> more_;  // by chunk
};

}  // namespace isomesh::mesh
