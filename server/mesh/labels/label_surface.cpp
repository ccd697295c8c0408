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

// The vertices that some triangles name, renumbered from 0 in the same order.
class VertexChoice {
 public:
  explicit VertexChoice(std::span<const Triangle> triangles) {
    std::uint32_t low = std::numeric_limits<std::uint32_t>::max();
    std::uint32_t high = 0;
    for (const Triangle& triangle : triangles) {
      const auto& [a, b, c] = triangle;
      low = std::min({low, a, b, c});
      high = std::max({high, a, b, c});
    }
    if (triangles.empty()) return;
    first_ = low / kWordBits * kWordBits;
    words_.resize((high - first_) / kWordBits + 1);
    for (const Triangle& triangle : triangles) {
      for (const std::uint32_t v : triangle) word_of(v).chosen |= bit_of(v);
    }
    for (Word& word : words_) {
      word.before = count_;
      count_ += bits_in(word.chosen);
    }
  }

  std::uint32_t count() const { return count_; }

  // The number of a vertex that is chosen.
  std::uint32_t operator[](std::uint32_t vertex) const {
    const Word& word = words_[(vertex - first_) / kWordBits];
    return word.before + bits_in(word.chosen & (bit_of(vertex) - 1));
  }

  // In their order.
  template <class Visit>
  void visit(Visit visit) const {
    for (std::size_t w = 0; w < words_.size(); ++w) {
      for (std::uint32_t rest = words_[w].chosen; rest != 0; rest &= rest - 1) {
        visit(first_ + static_cast<std::uint32_t>(w * kWordBits) +
              static_cast<std::uint32_t>(std::countr_zero(rest)));
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
  static std::uint32_t bits_in(std::uint32_t set) {
    set -= set >> 1 & 0x55555555;
    set = (set & 0x33333333) + (set >> 2 & 0x33333333);
    return ((set + (set >> 4)) & 0x0f0f0f0f) * 0x01010101 >> 24;
  }
  static std::uint32_t bit_of(std::uint32_t v) { return std::uint32_t{1} << (v % kWordBits); }

  Word& word_of(std::uint32_t vertex) { return words_[(vertex - first_) / kWordBits]; }

  std::uint32_t first_ = 0;  // the vertex of the first word's first bit
  std::vector<Word> words_;
  std::uint32_t count_ = 0;
};

// The numbers of the triangles that have each label on either side.
void list_triangles(const SeparatingSurface& walls, std::vector<LabelSurface>& labels) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (walls.sides.size() > kMost) {
    throw Error(ErrorCode::kTooLarge, "the surfaces of the labels have " +
                                          std::to_string(walls.sides.size()) +
                                          " triangles; more than " + std::to_string(kMost) +
                                          " cannot be numbered with 32 bits");
  }
  std::vector<std::uint32_t> sizes(labels.size() + 1, 0);
  for (const auto& [front, back] : walls.sides) {
    walls.parts.visit_labels(front, back, [&](std::size_t label, bool) { ++sizes[label]; });
  }
  std::vector<std::uint32_t*> next(sizes.size());
  for (std::size_t n = 1; n < sizes.size(); ++n) {
    next[n] = labels[n - 1].triangles.resize_for_overwrite(sizes[n]);
  }
  for (std::uint32_t t = 0; t < walls.sides.size(); ++t) {
    const auto& [front, back] = walls.sides[t];
    walls.parts.visit_labels(front, back, [&](std::size_t label, bool) { *next[label]++ = t; });
  }
}

// How many of the chosen ones, ascending, are in front of each layer.
std::vector<std::uint64_t> layers_of(const Buffer<std::uint32_t>& chosen,
                                     const std::vector<std::uint64_t>& layers) {
  std::vector<std::uint64_t> own;
  for (const std::uint64_t first : layers) {
    const auto at = std::ranges::lower_bound(chosen, first);
    own.push_back(static_cast<std::uint64_t>(at - chosen.begin()));
  }
  return own;
}

// Takes the surface of the label of that number, from 1 on, whose triangles are listed.
void take_surface(const SeparatingSurface& walls, std::size_t number, LabelSurface& label) {
  const Mesh& from = walls.mesh;
  Mesh& mesh = label.mesh;
  mesh.origin = from.origin;
  mesh.triangles.resize_for_overwrite(label.triangles.size());
  for (std::size_t t = 0; t < label.triangles.size(); ++t) {
    const auto& [a, b, c] = from.triangles[label.triangles[t]];
    const bool is_inside_out = walls.parts.belongs(walls.sides[label.triangles[t]].front, number);
    mesh.triangles[t] = {a, is_inside_out ? c : b, is_inside_out ? b : c};
  }
  const VertexChoice choice(mesh.triangles.span());
  for (Triangle& triangle : mesh.triangles) {
    for (std::uint32_t& vertex : triangle) vertex = choice[vertex];
  }
  label.vertices.resize_for_overwrite(choice.count());
  mesh.positions.resize_for_overwrite(choice.count());
  mesh.on_border.assign(from.on_border.empty() ? 0 : (choice.count() + kFlagBits - 1) / kFlagBits,
                        0);
  std::size_t next = 0;
  choice.visit([&](std::uint32_t vertex) {
    label.vertices[next] = vertex;
    mesh.positions[next] = from.positions[vertex];
    if (from.is_on_border(vertex)) {
      mesh.on_border[next / kFlagBits] |= std::uint64_t{1} << (next % kFlagBits);
    }
    ++next;
  });
  mesh.layer_vertices = layers_of(label.vertices, from.layer_vertices);
  mesh.layer_triangles = layers_of(label.triangles, from.layer_triangles);
}

// Calls visit(the numbers of two labels, the background last) for each pair of a label that is on
// one side alone and one that is on the other side alone.
template <class Visit>
void visit_pairs(const LabelParts& parts, const WallSides& sides, Visit visit) {
  std::array<std::vector<std::size_t>, 2> labels;
  parts.visit_labels(sides.front, sides.back, [&](std::size_t label, bool is_front) {
    labels[is_front ? 0 : 1].push_back(label);
  });
  for (auto& side : labels) {
    if (side.empty()) side.push_back(0);
  }
  for (const std::size_t one : labels[0]) {
    for (const std::size_t other : labels[1]) {
      const auto [low, high] = std::minmax(one, other);
      visit(low == 0 ? std::pair(high, low) : std::pair(low, high));
    }
  }
}

}  // namespace

std::uint64_t LabelSurface::bytes(std::uint64_t vertices, std::uint64_t triangles) {
  return 2 * (triangles * (sizeof(Triangle) + sizeof(std::uint32_t)) +
              vertices * (sizeof(Vec3) + sizeof(std::uint32_t)));
}

std::vector<LabelSurface> label_surfaces(const SeparatingSurface& walls, const Context& context) {
  std::vector<LabelSurface> labels(walls.labels.size());
  list_triangles(walls, labels);
  parallel_for(context, labels.size(),
               [&](std::size_t n) { take_surface(walls, n + 1, labels[n]); });
  return labels;
}

Buffer<Vec3> shading_of(const LabelSurface& label, const SeparatingSurface& walls,
                        const Context& context) {
  const Mesh& mesh = label.mesh;
  Buffer<Vec3> normals;
  vertex_normals(mesh, context, normals);
  std::vector<Vec3> outside(mesh.positions.size(), Vec3{0, 0, 0});
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (walls.sides[label.triangles[t]].front != 0) continue;
    const Vec3 normal = area_normal(mesh, mesh.triangles[t]);
    for (const std::uint32_t vertex : mesh.triangles[t]) {
      for (std::size_t axis = 0; axis < 3; ++axis) outside[vertex][axis] += normal[axis];
    }
  }
  for (std::size_t v = 0; v < outside.size(); ++v) {
    if (outside[v] != Vec3{0, 0, 0}) normals[v] = unit(outside[v]);
  }
  return normals;
}

std::vector<LabelMeasure> measure_labels(const SeparatingSurface& walls,
                                         std::span<const LabelSurface> labels,
                                         const Context& context) {
  std::vector<LabelMeasure> measures(labels.size());
  const Context quiet = {context.stop, nullptr};
  parallel_for(context, labels.size(), [&](std::size_t n) {
    const OneThread alone;
    const Mesh& mesh = labels[n].mesh;
    measures[n] = {.label = walls.labels[n],
                   .vertices = mesh.positions.size(),
                   .triangles = mesh.triangles.size(),
                   .topology = measure_topology(mesh, quiet),
                   .extent = measure_extent(mesh, quiet)};
  });
  return measures;
}

std::vector<WallArea> measure_walls(const SeparatingSurface& surface, const VoxelFaces& faces,
                                    const Context& context) {
  const Mesh& mesh = surface.mesh;
  std::vector<std::map<WallSides, double>> layers(mesh.layers());
  parallel_for(context, layers.size(), [&](std::size_t layer) {
    WallSides last;
    double* area = nullptr;  // of those sides: neighbours mostly have the same
    for (std::uint64_t t = mesh.layer_triangles[layer]; t < mesh.layer_triangles[layer + 1]; ++t) {
      const auto at = [&](std::size_t i) { return to_point(mesh.positions[mesh.triangles[t][i]]); };
      const Point normal = normal_of(at(0), at(1), at(2));
      const WallSides& sides = surface.sides[t];
      if (sides != last || area == nullptr) area = &layers[layer][sides];
      last = sides;
      *area += std::sqrt(dot(normal, normal)) / 2;
    }
  });
  std::map<std::pair<std::size_t, std::size_t>, WallArea> found;
  for (const auto& layer : layers) {
    for (const auto& wall : layer) {
      visit_pairs(surface.parts, wall.first,
                  [&](auto pair) { found[pair].area_mm2 += wall.second; });
    }
  }
  for (const auto& wall : faces) {
    visit_pairs(surface.parts, wall.first, [&](auto pair) { found[pair].faces += wall.second; });
  }
  std::vector<WallArea> walls;
  for (const auto& [pair, wall] : found) {
    walls.push_back({pair.first, pair.second, wall.area_mm2, wall.faces});
  }
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
