#include "server/mesh/extract/joined_layers.h"

#include <algorithm>
#include <cstddef>
#include <type_traits>

namespace isomesh::mesh {
namespace {

// Calls visit(number, array) for the layer's arrays.
template <class Visit>
void visit_arrays(ClusterLayer& layer, Visit visit) {
  visit(0, layer.words);
  visit(1, layer.row_begin);
  visit(2, layer.joined);
  visit(3, layer.points);
  visit(4, layer.points_begin);
}

}  // namespace

void JoinedLayers::put_aside(std::uint32_t z) {
  if (spool_ == nullptr || layers_.empty()) return;
  Place& place = places_[z];
  std::uint64_t bytes = 0;
  visit_arrays(layers_[z], [&](std::size_t number, auto& array) {
    place.sizes[number] = array.size();
    bytes += std::span(array).size_bytes();
  });
  place.begin = spool_->take(bytes);
  place.is_aside = bytes > 0;
  std::uint64_t at = place.begin;
  visit_arrays(layers_[z], [&](std::size_t /*number*/, auto& array) {
    const auto written = std::as_bytes(std::span(array));
    if (!written.empty()) spool_->write(at, written);
    at += written.size();
    array = std::remove_cvref_t<decltype(array)>();  // unlike {}, frees the memory
  });
}

void JoinedLayers::take_back(std::uint32_t begin, std::uint32_t end) {
  if (spool_ == nullptr) return;
  const Lock lock(mutex_);
  for (std::uint32_t z = begin; z < std::min<std::size_t>(end, layers_.size()); ++z) {
    Place& place = places_[z];
    if (!place.is_aside) continue;
    std::uint64_t at = place.begin;
    visit_arrays(layers_[z], [&](std::size_t number, auto& array) {
      array.resize(place.sizes[number]);
      const auto read = std::as_writable_bytes(std::span(array));
      if (!read.empty()) spool_->read(at, read);
      at += read.size();
    });
    place.is_aside = false;
  }
}

void JoinedLayers::forget(std::uint32_t begin, std::uint32_t end) {
  for (std::uint32_t z = begin; z < std::min<std::size_t>(end, layers_.size()); ++z) {
    layers_[z] = {};
  }
}

}  // namespace isomesh::mesh
