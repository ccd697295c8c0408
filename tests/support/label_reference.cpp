#include "tests/support/label_reference.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "tests/support/points.h"

namespace isomesh::test {
namespace {

template <class T>
class LabelReferenceBuilder {
 public:
  LabelReferenceBuilder(const mesh::Lattice<T>& lattice, const mesh::SeparateOptions& options)
      : lattice_(lattice), options_(options), margin_(options.close ? 1 : 0) {
    dims_ = {lattice.dims.x + 2 * margin_, lattice.dims.y + 2 * margin_,
             lattice.dims.z + 2 * margin_};
    reference_.to_space = lattice.to_space;
  }

  LabelReference build() {
    for_each_tetrahedron(dims_, options_.scheme, margin_, [&](const Tetrahedron& tetrahedron) {
      groups_.clear();
      for (const Sample& sample : tetrahedron.samples) groups_[label(sample)].push_back(sample);
      layer_ = tetrahedron.layer;
      add_walls();
    });
    return std::move(reference_);
  }

 private:
  using Group = std::vector<Sample>;

  void add_walls() {
    for (auto front = groups_.begin(); front != groups_.end(); ++front) {
      for (auto back = std::next(front); back != groups_.end(); ++back) {
        LabelPatch patch = {.corners = {}, .sides = {front->first, back->first}, .layer = layer_};
        if (groups_.size() == 2) patch.corners = between_two(front->second, back->second);
        if (groups_.size() == 3) patch.corners = among_three(front->second, back->second);
        if (groups_.size() == 4) {
          patch.corners = among_four(front->second[0], back->second[0]);
          patch.only_first_cut = true;
        }
        turn_to_front(front->second, back->second, patch);
        reference_.patches.push_back(std::move(patch));
      }
    }
  }

  std::vector<std::uint32_t> between_two(const Group& a, const Group& b) {
    if (a.size() == 2) {
      return {vertex({a[0], b[0]}), vertex({a[0], b[1]}), vertex({a[1], b[1]}),
              vertex({a[1], b[0]})};
    }
    std::vector<std::uint32_t> corners;
    for (const Sample& one : a) {
      for (const Sample& other : b) corners.push_back(vertex({one, other}));
    }
    return corners;
  }

  // The samples with neither label.
  Group others(const Group& a, const Group& b) const {
    Group others;
    for (const auto& [label, group] : groups_) {
      if (group != a && group != b) others.insert(others.end(), group.begin(), group.end());
    }
    return others;
  }

  std::vector<std::uint32_t> among_three(const Group& a, const Group& b) {
    const Group third = others(a, b);
    if (third.size() == 2) {
      return {vertex({a[0], b[0]}), vertex({a[0], b[0], third[0]}), vertex({a[0], b[0], third[1]})};
    }
    const Group& twins = a.size() == 2 ? a : b;
    const Sample& single = a.size() == 2 ? b[0] : a[0];
    return {vertex({twins[0], single}), vertex({twins[1], single}),
            vertex({twins[1], single, third[0]}), vertex({twins[0], single, third[0]})};
  }

  std::vector<std::uint32_t> among_four(const Sample& a, const Sample& b) {
    const Group rest = others({a}, {b});
    return {vertex({a, b}), vertex({a, b, rest[0]}), vertex({a, b, rest[0], rest[1]}),
            vertex({a, b, rest[1]})};
  }

  // Oriented by the means of the samples, regardless of how border vertices move.
  void turn_to_front(const Group& front, const Group& back, LabelPatch& patch) const {
    const auto spot = [&](std::size_t n) {
      return to_space(reference_.to_space, mean(reference_.vertices[patch.corners[n]].samples));
    };
    const Point normal = cross(minus(spot(1), spot(0)), minus(spot(2), spot(0)));
    const Point to_front = minus(to_space(reference_.to_space, mean(front)),
                                 to_space(reference_.to_space, mean(back)));
    if (dot(normal, to_front) > 0) return;
    // Keeps the first corner, so a cut from it stays the same.
    std::reverse(patch.corners.begin() + 1, patch.corners.end());
  }

  std::uint32_t vertex(Group samples) {
    std::ranges::sort(samples);
    const auto [place, is_new] =
        numbers_.try_emplace(samples, static_cast<std::uint32_t>(reference_.vertices.size()));
    if (is_new) reference_.vertices.push_back({samples, place_of(samples), is_on_border(samples)});
    return place->second;
  }

  // In the volume's own indices.
  Point mean(const Group& samples) const {
    Point sum = {0, 0, 0};
    for (const Sample& sample : samples) {
      for (std::size_t axis = 0; axis < 3; ++axis)
        sum[axis] += static_cast<double>(sample[axis]) - margin_;
    }
    for (double& coordinate : sum) coordinate /= static_cast<double>(samples.size());
    return sum;
  }

  // Half-way to an adjacent phantom, otherwise the mean of all.
  Point place_of(const Group& samples) const {
    Group inner;
    Group phantoms;
    for (const Sample& sample : samples) (is_phantom(sample) ? phantoms : inner).push_back(sample);
    return phantoms.empty() ? mean(inner) : between(mean(inner), mean(phantoms), 0.5);
  }

  bool is_phantom(const Sample& sample) const {
    const std::array counts = {dims_.x, dims_.y, dims_.z};
    for (std::size_t axis = 0; axis < 3 && margin_ > 0; ++axis) {
      if (sample[axis] == 0 || sample[axis] + 1 == counts[axis]) return true;
    }
    return false;
  }

  bool is_on_border(const Group& samples) const {
    if (margin_ == 0) return false;
    if (std::ranges::any_of(samples, [&](const Sample& s) { return is_phantom(s); })) return true;
    const std::array counts = {dims_.x, dims_.y, dims_.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const std::uint32_t face : {margin_, counts[axis] - 1 - margin_}) {
        if (std::ranges::all_of(samples, [&](const Sample& s) { return s[axis] == face; })) {
          return true;
        }
      }
    }
    return false;
  }

  std::uint16_t label(const Sample& s) const {
    if (is_phantom(s)) return 0;
    const mesh::Dims& dims = lattice_.dims;
    const std::int64_t value =
        lattice_.samples[((std::size_t{s[2]} - margin_) * dims.y + (s[1] - margin_)) * dims.x +
                         (s[0] - margin_)];
    const auto found = std::ranges::find(options_.labels, value);
    if (found == options_.labels.end()) return 0;
    return static_cast<std::uint16_t>(found - options_.labels.begin() + 1);
  }

  const mesh::Lattice<T>& lattice_;
  const mesh::SeparateOptions& options_;
  const std::uint32_t margin_;  // layers of phantoms
  mesh::Dims dims_;
  std::map<std::uint16_t, Group> groups_;  // of the tetrahedron, by label
  std::uint32_t layer_ = 0;
  LabelReference reference_;
  std::map<Group, std::uint32_t> numbers_;
};

// The error, or empty.
using Complaint = std::string;

// All positions are multiples of a twelfth of the lattice's steps.
using Twelfths = std::array<std::int64_t, 3>;

Twelfths twelfths(const Point& at) {
  Twelfths result;
  for (std::size_t axis = 0; axis < 3; ++axis) result[axis] = std::llround(at[axis] * 12);
  return result;
}

Complaint name_vertices(const mesh::Mesh& mesh, const LabelReference& reference,
                        std::vector<std::uint32_t>& names) {
  std::map<Twelfths, std::uint32_t> places;
  for (std::uint32_t v = 0; v < reference.vertices.size(); ++v) {
    places[twelfths(reference.vertices[v].at)] = v;
  }
  if (places.size() != reference.vertices.size()) return "the reference has vertices in one place";
  for (std::size_t layer = 0; layer < mesh.layers(); ++layer) {
    for (std::size_t v = mesh.layer_vertices[layer]; v < mesh.layer_vertices[layer + 1]; ++v) {
      const mesh::Vec3& p = mesh.positions[v];
      const Point at = to_lattice(reference.to_space, {p[0], p[1], p[2]});
      const auto found = places.find(twelfths(at));
      const std::string which = "vertex " + std::to_string(v);
      if (found == places.end()) return which + " is not the reference's, or there twice";
      names.push_back(found->second);
      places.erase(found);
      const LabelVertex& vertex = reference.vertices[names.back()];
      constexpr double kRounding = 0.01;
      if (length(minus(at, vertex.at)) > kRounding) return which + " is not in its place";
      if (mesh.is_on_line(v) != (vertex.samples.size() > 2)) return which + ": on_line is wrong";
      if (mesh.is_on_border(v) != vertex.on_border) return which + ": on_border is wrong";
      std::uint32_t plane = vertex.samples[0][2];
      for (const Sample& sample : vertex.samples) plane = std::min(plane, sample[2]);
      if (plane != layer) return which + " is in another layer";
    }
  }
  return {};
}

// A triangle by the reference's vertices, the smallest first, with its labels and its layer.
using NamedTriangle = std::array<std::uint64_t, 6>;

NamedTriangle named(std::array<std::uint64_t, 3> v, const mesh::WallSides& sides,
                    std::uint64_t layer) {
  std::rotate(v.begin(), std::ranges::min_element(v), v.end());
  return {v[0], v[1], v[2], sides.front, sides.back, layer};
}

class TriangleBag {
 public:
  void add(const NamedTriangle& triangle) { ++counts_[triangle]; }

  bool take(const std::vector<NamedTriangle>& triangles) {
    for (const NamedTriangle& triangle : triangles) {
      if (!counts_.contains(triangle)) return false;
    }
    for (const NamedTriangle& triangle : triangles) {
      const auto found = counts_.find(triangle);
      if (--found->second == 0) counts_.erase(found);
    }
    return true;
  }

  bool is_empty() const { return counts_.empty(); }

 private:
  std::map<NamedTriangle, int> counts_;
};

std::vector<NamedTriangle> cut(const LabelPatch& patch, std::size_t first) {
  const auto corner = [&](std::size_t n) -> std::uint64_t {
    return patch.corners[(first + n) % patch.corners.size()];
  };
  std::vector<NamedTriangle> triangles = {
      named({corner(0), corner(1), corner(2)}, patch.sides, patch.layer)};
  if (patch.corners.size() == 4) {
    triangles.push_back(named({corner(0), corner(2), corner(3)}, patch.sides, patch.layer));
  }
  return triangles;
}

Complaint match_triangles(const mesh::SeparatingSurface& surface, const LabelReference& reference,
                          const std::vector<std::uint32_t>& names) {
  TriangleBag bag;
  const mesh::Mesh& mesh = surface.mesh;
  for (std::size_t layer = 0; layer < mesh.layers(); ++layer) {
    for (std::size_t t = mesh.layer_triangles[layer]; t < mesh.layer_triangles[layer + 1]; ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      if (std::max({a, b, c}) >= names.size()) return "a triangle names no vertex";
      bag.add(named({names[a], names[b], names[c]}, surface.sides[t], layer));
    }
  }
  for (std::size_t p = 0; p < reference.patches.size(); ++p) {
    const LabelPatch& patch = reference.patches[p];
    const bool found =
        bag.take(cut(patch, 0)) ||
        (!patch.only_first_cut && patch.corners.size() == 4 && bag.take(cut(patch, 1)));
    if (!found) {
      return "patch " + std::to_string(p) + " of " + std::to_string(patch.corners.size()) +
             " corners between labels " + std::to_string(patch.sides.front) + " and " +
             std::to_string(patch.sides.back) + " is not there";
    }
  }
  return bag.is_empty() ? "" : "there are other triangles too";
}

}  // namespace

std::uint64_t LabelReference::triangles() const {
  std::uint64_t count = 0;
  for (const LabelPatch& patch : patches) count += patch.corners.size() - 2;
  return count;
}

template <class T>
LabelReference label_reference(const mesh::Lattice<T>& lattice,
                               const mesh::SeparateOptions& options) {
  return LabelReferenceBuilder<T>(lattice, options).build();
}

testing::AssertionResult matches(const mesh::SeparatingSurface& surface,
                                 const LabelReference& reference) {
  const mesh::Mesh& mesh = surface.mesh;
  if (mesh.positions.size() != reference.vertices.size() ||
      mesh.triangles.size() != reference.triangles() ||
      surface.sides.size() != mesh.triangles.size()) {
    return testing::AssertionFailure()
           << mesh.positions.size() << " vertices and " << mesh.triangles.size()
           << " triangles instead of " << reference.vertices.size() << " and "
           << reference.triangles();
  }
  std::vector<std::uint32_t> names;
  Complaint complaint = name_vertices(mesh, reference, names);
  if (complaint.empty()) complaint = match_triangles(surface, reference, names);
  if (complaint.empty()) return testing::AssertionSuccess();
  return testing::AssertionFailure() << complaint;
}

std::vector<std::uint32_t> names_of_vertices(const mesh::Mesh& mesh,
                                             const LabelReference& reference) {
  std::vector<std::uint32_t> names;
  name_vertices(mesh, reference, names);
  return names;
}

template LabelReference label_reference(const mesh::Lattice<std::uint8_t>&,
                                        const mesh::SeparateOptions&);
template LabelReference label_reference(const mesh::Lattice<std::int8_t>&,
                                        const mesh::SeparateOptions&);
template LabelReference label_reference(const mesh::Lattice<std::uint16_t>&,
                                        const mesh::SeparateOptions&);
template LabelReference label_reference(const mesh::Lattice<std::int16_t>&,
                                        const mesh::SeparateOptions&);
template LabelReference label_reference(const mesh::Lattice<std::uint32_t>&,
                                        const mesh::SeparateOptions&);
template LabelReference label_reference(const mesh::Lattice<std::int32_t>&,
                                        const mesh::SeparateOptions&);

}  // namespace isomesh::test
