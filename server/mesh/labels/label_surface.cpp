#include "server/mesh/labels/label_surface.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>

#include "server/mesh/measure/extent-inl.h"
#include "server/mesh/measure/normals.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

// The vertices that some triangles name, renumbered from 0 in the same order. A thread may have one
// at a time.
class VertexChoice {
 public:
  VertexChoice(std::span<const Triangle> all, std::span<const std::uint32_t> triangles) {
    std::uint32_t low = std::numeric_limits<std::uint32_t>::max();
    std::uint32_t high = 0;
    for (const std::uint32_t t : triangles) {
      for (const std::uint32_t v : all[t]) {
        low = std::min(low, v);
        high = std::max(high, v);
      }
    }
    if (triangles.empty()) return;
    first_word_ = low / kWordBits;
    words_.resize(high / kWordBits - first_word_ + 1);
    for (const std::uint32_t t : triangles) {
      for (const std::uint32_t v : all[t]) {
        words_[v / kWordBits - first_word_].chosen |= std::uint32_t{1} << (v % kWordBits);
      }
    }
    for (Word& word : words_) {
      word.before = count_;
      count_ += bits_of(word.chosen);
    }
    thread_local std::vector<std::uint32_t> numbers;  // keeps its memory
    numbers.resize(std::max<std::size_t>(numbers.size(), words_.size() * kWordBits));
    numbers_ = numbers.data();
    std::uint32_t next = 0;
    visit([&](std::uint64_t vertex) { numbers_[vertex - first_word_ * kWordBits] = next++; });
  }

  std::uint32_t count() const { return count_; }

  // The number of a vertex that is chosen.
  std::uint32_t operator[](std::uint32_t vertex) const {
    return numbers_[vertex - first_word_ * kWordBits];
  }

  // How many there are before `vertex`, chosen or not.
  std::uint32_t before(std::uint64_t vertex) const {
    const std::uint64_t at = vertex / kWordBits;
    if (at < first_word_) return 0;
    if (at >= first_word_ + words_.size()) return count_;
    const Word& word = words_[at - first_word_];
    return word.before + bits_of(word.chosen & ((std::uint32_t{1} << (vertex % kWordBits)) - 1));
  }

  // In their order.
  template <class Visit>
  void visit(Visit visit) const {
    for (std::size_t w = 0; w < words_.size(); ++w) {
      for (std::uint32_t rest = words_[w].chosen; rest != 0; rest &= rest - 1) {
        visit((first_word_ + w) * kWordBits + static_cast<unsigned>(std::countr_zero(rest)));
      }
    }
  }

 private:
  static constexpr std::uint32_t kWordBits = 32;
  struct Word {
    std::uint32_t chosen = 0;
    std::uint32_t before = 0;
  };

  // As std::popcount, which is a call on processors that need not have the instruction.
  static std::uint32_t bits_of(std::uint32_t set) {
    set -= set >> 1 & 0x55555555;
    set = (set & 0x33333333) + (set >> 2 & 0x33333333);
    return ((set + (set >> 4)) & 0x0f0f0f0f) * 0x01010101 >> 24;
  }

  std::uint64_t first_word_ = 0;
  std::vector<Word> words_;
  std::uint32_t* numbers_ = nullptr;  // from that of the first word's first vertex on
  std::uint32_t count_ = 0;
};

void take_vertices(const Mesh& from, const VertexChoice& choice, Mesh& to) {
  to.positions.resize_for_overwrite(choice.count());
  to.on_line.clear();
  to.normals.clear();
  to.on_border.assign(from.on_border.empty() ? 0 : (choice.count() + kFlagBits - 1) / kFlagBits, 0);
  std::size_t next = 0;
  choice.visit([&](std::uint64_t vertex) {
    to.positions[next] = from.positions[vertex];
    if (from.is_on_border(vertex)) {
      to.on_border[next / kFlagBits] |= std::uint64_t{1} << (next % kFlagBits);
    }
    ++next;
  });
  to.layer_vertices.clear();
  for (const std::uint64_t first : from.layer_vertices) {
    to.layer_vertices.push_back(choice.before(first));
  }
}

LabelMeasure measure(const SeparatingSurface& surface, const LabelTriangles& triangles,
                     std::size_t number, const Context& context) {
  const OneThread alone;
  Mesh mesh;
  extract_label(surface, triangles, number, mesh);
  return {.label = surface.labels[number - 1],
          .vertices = mesh.positions.size(),
          .triangles = mesh.triangles.size(),
          .topology = measure_topology(mesh, context),
          .extent = measure_extent(mesh, context)};
}

}  // namespace

LabelTriangles::LabelTriangles(const SeparatingSurface& surface)
    : ends_(surface.labels.size() + 1, 0) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (surface.sides.size() > kMost) {
    throw Error(ErrorCode::kTooLarge, "the surfaces of the labels have " +
                                          std::to_string(surface.sides.size()) +
                                          " triangles; more than " + std::to_string(kMost) +
                                          " cannot be numbered with 32 bits");
  }
  for (const auto& [front, back] : surface.sides) {
    surface.parts.visit_labels(front, back, [&](std::size_t label, bool) { ++ends_[label]; });
  }
  // While the lists are filled, an end is where its list goes on.
  std::uint64_t begin = 0;
  for (std::size_t n = 1; n < ends_.size(); ++n) {
    const std::uint64_t size = ends_[n];
    ends_[n] = begin;
    begin += size;
  }
  triangles_.resize_for_overwrite(begin);
  for (std::uint32_t t = 0; t < surface.sides.size(); ++t) {
    const auto& [front, back] = surface.sides[t];
    surface.parts.visit_labels(front, back,
                               [&](std::size_t label, bool) { triangles_[ends_[label]++] = t; });
  }
}

void extract_label(const SeparatingSurface& surface, const LabelTriangles& triangles,
                   std::size_t number, Mesh& mesh) {
  const Mesh& from = surface.mesh;
  const std::span<const std::uint32_t> own = triangles.of(number);
  const VertexChoice choice(from.triangles.span(), own);
  mesh.origin = from.origin;
  take_vertices(from, choice, mesh);
  mesh.triangles.resize_for_overwrite(own.size());
  for (std::size_t t = 0; t < own.size(); ++t) {
    const auto& [a, b, c] = from.triangles[own[t]];
    const bool is_inside_out = surface.parts.belongs(surface.sides[own[t]].front, number);
    mesh.triangles[t] = {choice[a], choice[is_inside_out ? c : b], choice[is_inside_out ? b : c]};
  }
  mesh.layer_triangles.clear();
  for (const std::uint64_t first : from.layer_triangles) {
    const auto at = std::ranges::lower_bound(own, first);
    mesh.layer_triangles.push_back(static_cast<std::uint64_t>(at - own.begin()));
  }
}

void shade_label(const SeparatingSurface& surface, const LabelTriangles& triangles,
                 std::size_t number, const Context& context, Mesh& mesh) {
  Buffer<Vec3> normals;
  vertex_normals(mesh, context, normals);
  std::vector<Vec3> outside(mesh.positions.size(), Vec3{0, 0, 0});
  const std::span<const std::uint32_t> own = triangles.of(number);
  for (std::size_t t = 0; t < own.size(); ++t) {
    if (surface.sides[own[t]].front != 0) continue;
    const Vec3 normal = area_normal(mesh, mesh.triangles[t]);
    for (const std::uint32_t vertex : mesh.triangles[t]) {
      for (std::size_t axis = 0; axis < 3; ++axis) outside[vertex][axis] += normal[axis];
    }
  }
  for (std::size_t v = 0; v < outside.size(); ++v) {
    outside[v] = outside[v] == Vec3{0, 0, 0} ? normals[v] : unit(outside[v]);
  }
  mesh.normals = std::move(outside);
}

std::vector<std::uint32_t> vertices_of_label(const SeparatingSurface& surface,
                                             const LabelTriangles& triangles, std::size_t number) {
  std::vector<std::uint32_t> vertices;
  const VertexChoice choice(surface.mesh.triangles.span(), triangles.of(number));
  vertices.reserve(choice.count());
  choice.visit([&](std::uint64_t v) { vertices.push_back(static_cast<std::uint32_t>(v)); });
  return vertices;
}

std::vector<LabelMeasure> measure_labels(const SeparatingSurface& surface,
                                         const LabelTriangles& triangles, const Context& context) {
  std::vector<LabelMeasure> measures(surface.labels.size());
  const Context quiet = {context.stop, nullptr};
  parallel_for(context, measures.size(),
               [&](std::size_t n) { measures[n] = measure(surface, triangles, n + 1, quiet); });
  return measures;
}

std::vector<WallArea> measure_walls(const SeparatingSurface& surface, const Context& context) {
  const Mesh& mesh = surface.mesh;
  using Sides = std::pair<PartNumber, PartNumber>;
  std::vector<std::map<Sides, double>> layers(mesh.layers());
  parallel_for(context, layers.size(), [&](std::size_t layer) {
    for (std::uint64_t t = mesh.layer_triangles[layer]; t < mesh.layer_triangles[layer + 1]; ++t) {
      const auto at = [&](std::size_t i) { return to_point(mesh.positions[mesh.triangles[t][i]]); };
      const Point normal = normal_of(at(0), at(1), at(2));
      const WallSides& sides = surface.sides[t];
      layers[layer][{sides.front, sides.back}] += std::sqrt(dot(normal, normal)) / 2;
    }
  });
  std::map<std::pair<std::size_t, std::size_t>, double> areas;
  for (const auto& layer : layers) {
    for (const auto& [sides, area] : layer) {
      std::array<std::vector<std::size_t>, 2> labels;  // on one side alone
      surface.parts.visit_labels(sides.first, sides.second, [&](std::size_t label, bool is_front) {
        labels[is_front ? 0 : 1].push_back(label);
      });
      for (auto& side : labels) {
        if (side.empty()) side.push_back(0);
      }
      for (const std::size_t one : labels[0]) {
        for (const std::size_t other : labels[1]) {
          const auto [low, high] = std::minmax(one, other);
          areas[low == 0 ? std::pair(high, low) : std::pair(low, high)] += area;
        }
      }
    }
  }
  std::vector<WallArea> walls;
  for (const auto& [pair, area] : areas) walls.push_back({pair.first, pair.second, area});
  return walls;
}

double enclosed_by_all(const SeparatingSurface& surface, const Context& context) {
  const Mesh& mesh = surface.mesh;
  std::vector<LayerExtent> layers(mesh.layers());
  parallel_for(context, layers.size(), [&](std::size_t layer) {
    std::vector<Triangle> outer;
    for (std::uint64_t t = mesh.layer_triangles[layer]; t < mesh.layer_triangles[layer + 1]; ++t) {
      if (surface.sides[t].front == 0) outer.push_back(mesh.triangles[t]);
    }
    layers[layer].add_triangles(outer, mesh.origin,
                                [&](std::uint32_t v) { return load(mesh.positions[v]); });
    for (std::uint64_t v = mesh.layer_vertices[layer]; v < mesh.layer_vertices[layer + 1]; ++v) {
      layers[layer].add_vertex(load(mesh.positions[v]));
    }
  });
  LayerExtent whole;
  for (const LayerExtent& layer : layers) whole.add(layer);
  return whole.extent().volume_mm3;
}

}  // namespace isomesh::mesh
