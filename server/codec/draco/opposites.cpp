#include "server/codec/draco/opposites.h"

#include <algorithm>
#include <atomic>

#include "server/mesh/parallel.h"

namespace isomesh::codec::edgebreaker {
namespace {

// After the table, one cache line per slab.
constexpr std::size_t kSpareWords = 16;

bool all_within(std::span<const mesh::Triangle> triangles, Vertex begin, Vertex end) {
  const Vertex count = end - begin;
  std::uint32_t outside = 0;
  for (const auto& [a, b, c] : triangles) {
    outside |= (a - begin >= count ? 1U : 0U) | (b - begin >= count ? 1U : 0U) |
               (c - begin >= count ? 1U : 0U);
  }
  return outside == 0;
}

// The first vertex whose layer is `layer` or higher.
Vertex vertices_below(const Surface& surface, std::size_t layer) {
  return static_cast<Vertex>(surface.layer_vertices[std::min(layer, surface.layers())]);
}

std::uint64_t most_vertices_of_two_layers(const Surface& surface) {
  std::uint64_t most = 0;
  for (std::size_t layer = 0; layer < surface.layers(); ++layer) {
    most = std::max<std::uint64_t>(
        most, vertices_below(surface, layer + 2) - vertices_below(surface, layer));
  }
  return most;
}

// The first layer with this share of the triangles below it.
std::size_t cut_at(const Surface& surface, std::size_t slab, std::size_t slabs) {
  const std::uint64_t below = surface.triangles.size() * slab / slabs;
  const auto cut = std::ranges::lower_bound(surface.layer_triangles, below);
  return static_cast<std::size_t>(cut - surface.layer_triangles.begin());
}

}  // namespace

bool Opposites::find(const Surface& surface, std::size_t slabs, const mesh::Context& context) {
  const std::size_t faces = surface.triangles.size();
  words_.resize_for_overwrite(kWordsPerFace * (faces + 1) + kSpareWords * slabs);
  boundary_.resize(slabs);
  for (std::vector<Corner>& corners : boundary_) corners.clear();
  while (rows_.size() < slabs) rows_.emplace_back();
  std::atomic<bool> manifold = true;
  const auto find_slab = [&](std::size_t slab) {
    const Layers layers = {slab == 0 ? 0 : cut_at(surface, slab, slabs),
                           slab + 1 == slabs ? surface.layers() : cut_at(surface, slab + 1, slabs)};
    const auto spare_word =
        static_cast<std::uint32_t>(kWordsPerFace * (faces + 1) + kSpareWords * slab);
    if (!find_in(surface, layers, spare_word, rows_[slab], boundary_[slab], context))
      manifold = false;
  };
  if (slabs == 1) {
    find_slab(0);
  } else {
    mesh::parallel_for(context, slabs, find_slab);
  }
  if (!manifold) return false;
  // Repeat the first words of the layer below each cut, which both slabs wrote to, and of the last
  // layer.
  for (std::size_t slab = 1; slab <= slabs; ++slab) {
    const std::size_t layer = slab == slabs ? surface.layers() : cut_at(surface, slab, slabs);
    if (layer == 0) continue;
    repeat_first_words(surface.layer_triangles[layer - 1], surface.layer_triangles[layer]);
  }
  std::fill_n(words_.data() + kWordsPerFace * faces, kWordsPerFace,
              static_cast<Corner>(kWordsPerFace * faces));
  return true;
}

bool Opposites::find_in(const Surface& surface, Layers layers, std::uint32_t spare_word,
                        EdgeRows& rows, std::vector<Corner>& boundary,
                        const mesh::Context& context) {
  if (layers.begin >= layers.end) return true;
  const auto none = static_cast<Corner>(kWordsPerFace * surface.triangles.size());
  const Vertex first = vertices_below(surface, layers.begin);
  rows.begin({.first = first,
              .owned = vertices_below(surface, layers.end) - first,
              .window = most_vertices_of_two_layers(surface),
              .spare_word = spare_word},
             words_.data());
  // The triangles of the layer below also have vertices of the first layer.
  for (std::size_t layer = layers.begin - (layers.begin > 0 ? 1 : 0); layer < layers.end; ++layer) {
    context.throw_if_stopped();
    const std::uint64_t begin = surface.layer_triangles[layer];
    const std::uint64_t end = surface.layer_triangles[layer + 1];
    const Vertex low = vertices_below(surface, layer);
    if (!all_within(surface.triangles.subspan(begin, end - begin), low,
                    vertices_below(surface, layer + 2))) {
      return false;
    }
    rows.add(surface.triangles.data(), static_cast<Face>(begin), static_cast<Face>(end));
    if (layer < layers.begin) continue;
    rows.finish(low, vertices_below(surface, layer + 1), none, boundary);
    if (layer > layers.begin) repeat_first_words(surface.layer_triangles[layer - 1], begin);
  }
  return rows.is_manifold();
}

void Opposites::repeat_first_words(std::uint64_t begin, std::uint64_t end) {
  std::uint32_t* const words = words_.data();
  for (std::uint64_t face = begin; face < end; ++face) {
    words[kWordsPerFace * face + 3] = words[kWordsPerFace * face];
  }
}

}  // namespace isomesh::codec::edgebreaker
