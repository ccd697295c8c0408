#include "server/mesh/collapse/history.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace isomesh::mesh::collapse {
namespace {

constexpr std::uint32_t kNone = ~std::uint32_t{0};

bool is_left(const Triangle& corners) {
  return corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0];
}

}  // namespace

History::History(std::size_t vertices) : into_(vertices, kNone), step_(vertices, kNone) {}

std::uint32_t History::kept(std::uint32_t vertex) const {
  while (into_[vertex] != kNone) vertex = into_[vertex];
  return vertex;
}

Triangle History::corners_of(Triangle original) const {
  for (std::uint32_t& corner : original) corner = kept(corner);
  return original;
}

// Calls visit(vertex, corners) for the collapses of a triangle's corners in their order, each with
// the corners before it; also after the triangle is gone.
template <class Visit>
void History::walk(Triangle corners, Visit visit) const {
  for (;;) {
    const std::uint32_t vertex =
        *std::ranges::min_element(corners, {}, [&](std::uint32_t v) { return step_[v]; });
    if (step_[vertex] == kNone) return;
    visit(vertex, corners);
    std::ranges::replace(corners, vertex, into_[vertex]);
  }
}

std::vector<std::uint32_t> History::undo(std::span<const Triangle> originals,
                                         std::span<const std::uint32_t> which, std::size_t count) {
  if (begins_.empty()) make_index(originals);
  find_children();
  for (const std::uint32_t t : which) {
    std::vector<std::uint32_t> vertices;
    walk(originals[t], [&](std::uint32_t v, const Triangle&) { vertices.push_back(v); });
    const std::size_t last = std::min(count, vertices.size());
    for (const std::uint32_t v : std::span(vertices).last(last)) undo(v);
  }
  std::vector<std::uint32_t> changed;
  for (std::size_t n = 0; n < undone_.size(); ++n) {
    visit_triangles(undone_[n], [&](std::uint32_t t) {
      changed.push_back(t);
      bool is_changed = false;
      walk(originals[t], [&](std::uint32_t v, const Triangle& corners) {
        if (is_changed) undo(v);
        is_changed = is_changed || (is_undone_[v] != 0 && is_left(corners));
      });
    });
  }
  for (const std::uint32_t v : undone_) {
    into_[v] = step_[v] = kNone;
    is_undone_[v] = 0;
  }
  undone_.clear();
  std::ranges::sort(changed);
  changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
  return changed;
}

void History::undo(std::uint32_t vertex) {
  if (is_undone_[vertex] == 0) undone_.push_back(vertex);
  is_undone_[vertex] = 1;
}

// Those that had a vertex, which has been drawn into another one, as a corner.
template <class Visit>
void History::visit_triangles(std::uint32_t vertex, Visit visit) {
  stack_.assign(1, vertex);
  while (!stack_.empty()) {
    const std::uint32_t v = stack_.back();
    stack_.pop_back();
    for (std::size_t n = begins_[v]; n < begins_[v + 1]; ++n) visit(triangles_[n]);
    for (std::uint32_t child = child_[v]; child != kNone; child = sibling_[child]) {
      stack_.push_back(child);
    }
  }
}

void History::make_index(std::span<const Triangle> originals) {
  begins_.assign(into_.size() + 1, 0);
  for (const Triangle& triangle : originals) {
    for (const std::uint32_t v : triangle) ++begins_[v];
  }
  std::partial_sum(begins_.begin(), begins_.end(), begins_.begin());
  triangles_.resize(begins_.back());
  for (auto t = static_cast<std::uint32_t>(originals.size()); t-- > 0;) {
    for (const std::uint32_t v : originals[t]) triangles_[--begins_[v]] = t;
  }
  is_undone_.assign(into_.size(), 0);
}

void History::find_children() {
  child_.assign(into_.size(), kNone);
  sibling_.assign(into_.size(), kNone);
  for (std::uint32_t v = 0; v < into_.size(); ++v) {
    if (into_[v] == kNone) continue;
    sibling_[v] = std::exchange(child_[into_[v]], v);
  }
}

}  // namespace isomesh::mesh::collapse
