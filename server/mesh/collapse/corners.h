// The table of which triangles of a block are neighbours; private to this folder.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_set>
#include <utility>
#include <vector>

#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

// A table of corners: corner c is the corner c % 3 of the triangle c / 3. Vertices that have not
// one closed fan of triangles are on the seam, which stays.
class Corners {
 public:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};
  static constexpr std::size_t kMostNeighbours = 28;  // that a loop takes

  // Vertices with fewer neighbours than `least`, 3 or more, neither go nor gain triangles; those
  // with more than `most` do not go.
  Corners(std::span<const Triangle> triangles, std::size_t vertices, std::size_t least,
          std::size_t most)
      : least_(least),
        most_(most),
        table_(8 * triangles.size(), kNone),
        corner_(vertices, kNone),
        is_seam_(vertices, 0),
        left_(triangles.size()) {
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      std::ranges::copy(triangles[t], table_.begin() + static_cast<std::ptrdiff_t>(8 * t));
    }
    join();
    find_seam();
  }

  std::size_t left() const { return left_; }
  // Takes those that are left, and of their `numbers`, if any, the same.
  void take(std::vector<Triangle>& triangles, std::vector<std::uint32_t>& numbers) const {
    std::size_t count = 0;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      const std::size_t c = 8 * t;
      if (table_[c] == kNone) continue;
      triangles[count] = {table_[c], table_[c + 1], table_[c + 2]};
      if (!numbers.empty()) numbers[count] = numbers[t];
      ++count;
    }
    triangles.resize(count);
    if (!numbers.empty()) numbers.resize(count);
  }

  void put_on_seam(std::uint32_t a) { is_seam_[a] = 1; }
  // An edge between two vertices of the seam may come if all triangles of one of them are here,
  // which these flags tell.
  void set_whole(std::vector<std::uint8_t> is_whole) {
    is_whole_ = std::move(is_whole);
    visit_corners([&](std::uint32_t c) { note_edge(at(next(c)), at(previous(c))); });
  }

  bool is_on_seam(std::uint32_t a) const { return is_seam_[a] != 0; }
  bool is_gone(std::uint32_t a) const { return corner_[a] == kNone; }

  // Calls visit(b) for each neighbour of `a`, which has a closed fan.
  template <class Visit>
  void visit_neighbours(std::uint32_t a, Visit visit) const {
    const std::uint32_t begin = corner_[a];
    std::uint32_t c = begin;
    do {
      visit(at(next(c)));
      c = turn(c);
    } while (c != begin);
  }

  // The neighbours of `a` in order, and its corners in the triangles between each and the next.
  // False where there are too many.
  bool walk_around(std::uint32_t a) {
    ring_.clear();
    star_.clear();
    std::uint32_t c = corner_[a];
    do {
      if (star_.size() == most_) return false;
      ring_.push_back(at(next(c)));
      star_.push_back(c);
      c = turn(c);
    } while (c != corner_[a]);
    return ring_.size() >= least_;
  }
  const std::vector<std::uint32_t>& ring() const { return ring_; }
  // The number of the triangle between ring()[k] and the next.
  std::uint32_t triangle_behind(std::size_t k) const { return star_[k] / 8; }

  // Link condition: true if the vertex that was walked around may become ring()[k]. No new edge may
  // exist already, and of the seam only vertices are joined of which that is known.
  bool keeps_topology(std::size_t k) const {
    const std::uint32_t b = ring_[k];
    const std::uint32_t left = ring_[before(k)];
    const std::uint32_t right = ring_[after(k)];
    const auto is_other = [&](std::uint32_t x) { return x != b && x != left && x != right; };
    bool joins = false;
    if (!is_on_seam(b)) {
      std::size_t degree = 0;
      visit_neighbours(b, [&](std::uint32_t x) {
        ++degree;
        joins = joins || (is_other(x) && std::ranges::find(ring_, x) != ring_.end());
      });
      return !joins && degree >= least_ && degree + ring_.size() > 6;
    }
    for (const std::uint32_t r : ring_) {
      if (!is_other(r)) continue;
      if (is_on_seam(r)) {
        if (!may_join_on_seam(r, b)) return false;
        continue;
      }
      visit_neighbours(r, [&](std::uint32_t x) { joins = joins || x == b; });
    }
    // The three neighbours may have a triangle already, which only a fan of their own can tell.
    return !joins && (ring_.size() > 3 || has_more_than_three(left) || has_more_than_three(right));
  }

  // The vertices around the one that was walked around and ring()[k], in order: first the others of
  // ring() behind ring()[k], then, if `both`, those around ring()[k] only. False where they are too
  // many.
  bool make_loop(std::size_t k, bool both, std::vector<std::uint32_t>& loop) const {
    const auto at_k = ring_.begin() + static_cast<std::ptrdiff_t>(k);
    loop.assign(at_k + 1, ring_.end());
    loop.insert(loop.end(), ring_.begin(), at_k);
    if (!both) return true;
    const std::size_t most = loop.size() + kMostNeighbours;
    std::uint32_t c = turn(turn(previous(star_[before(k)])));
    for (; at(next(c)) != loop.front(); c = turn(c)) {
      if (loop.size() == most) return false;
      loop.push_back(at(next(c)));
    }
    return true;
  }

  // Gives the triangles of the vertex that was walked around to ring()[k].
  void collapse(std::size_t k) {
    const std::uint32_t b = ring_[k];
    const std::uint32_t first = star_[k];         // of the triangle a, b, after
    const std::uint32_t last = star_[before(k)];  // of the triangle a, before, b
    const std::uint32_t second = star_[after(k)];
    corner_[at(first)] = kNone;
    for (const std::uint32_t r : ring_) note_edge(r, b);
    pair(opposite(first), opposite(next(first)));
    pair(opposite(last), opposite(previous(last)));
    for (const std::uint32_t c : star_) table_[c] = b;
    table_[first / 8 * 8] = table_[last / 8 * 8] = kNone;
    left_ -= 2;
    corner_[b] = second;
    corner_[ring_[after(k)]] = next(second);
    corner_[ring_[before(k)]] = previous(star_[before(before(k))]);
  }

 private:
  static std::uint32_t next(std::uint32_t c) { return c % 8 == 2 ? c - 2 : c + 1; }
  static std::uint32_t previous(std::uint32_t c) { return c % 8 == 0 ? c + 2 : c - 1; }
  std::uint32_t at(std::uint32_t corner) const { return table_[corner]; }
  std::uint32_t opposite(std::uint32_t corner) const { return table_[corner + 4]; }

  template <class Visit>
  void visit_corners(Visit visit) const {
    for (std::uint32_t c = 0; c < table_.size(); c += 8) {
      for (std::uint32_t i = 0; i < 3; ++i) visit(c + i);
    }
  }

  std::uint32_t turn(std::uint32_t corner) const { return next(opposite(next(corner))); }
  std::size_t before(std::size_t k) const { return k == 0 ? ring_.size() - 1 : k - 1; }
  std::size_t after(std::size_t k) const { return k + 1 == ring_.size() ? 0 : k + 1; }

  static std::uint64_t edge(std::uint32_t a, std::uint32_t b) {
    return std::uint64_t{std::min(a, b)} << 32 | std::max(a, b);
  }
  void note_edge(std::uint32_t a, std::uint32_t b) {
    if (a != b && !is_whole_.empty() && is_on_seam(a) && is_on_seam(b)) {
      seam_edges_.insert(edge(a, b));
    }
  }
  bool may_join_on_seam(std::uint32_t a, std::uint32_t b) const {
    if (is_whole_.empty() || (is_whole_[a] == 0 && is_whole_[b] == 0)) return false;
    return !seam_edges_.contains(edge(a, b));
  }

  bool has_more_than_three(std::uint32_t a) const {
    std::size_t degree = 0;
    if (!is_on_seam(a)) visit_neighbours(a, [&](std::uint32_t) { ++degree; });
    return degree > 3;
  }

  void pair(std::uint32_t c, std::uint32_t d) {
    if (c != kNone) table_[c + 4] = d;
    if (d != kNone) table_[d + 4] = c;
  }

  void join() {
    std::vector<std::uint32_t> head(corner_.size(), kNone);  // of the edges from a vertex
    std::vector<std::uint32_t> follow(table_.size());
    visit_corners([&](std::uint32_t c) {
      std::uint32_t& first = head[at(next(c))];
      follow[c] = first;
      first = c;
      corner_[at(c)] = c;
    });
    visit_corners([&](std::uint32_t c) {  // the edge a -> b opposite c; its twin is b -> a
      const std::uint32_t a = at(next(c));
      const std::uint32_t b = at(previous(c));
      int twins = 0;
      for (std::uint32_t d = head[b]; d != kNone; d = follow[d]) {
        if (at(previous(d)) != a) continue;
        table_[c + 4] = d;
        ++twins;
      }
      if (twins != 1) is_seam_[a] = is_seam_[b] = 1;
    });
  }

  void find_seam() {
    std::vector<std::uint32_t> degree(corner_.size(), 0);
    visit_corners([&](std::uint32_t c) { ++degree[at(c)]; });
    for (std::uint32_t a = 0; a < corner_.size(); ++a) {
      if (is_gone(a)) is_seam_[a] = 1;
      if (is_on_seam(a)) continue;
      std::uint32_t count = 0;
      std::uint32_t c = corner_[a];
      do {
        c = turn(c);
        ++count;
      } while (c != corner_[a] && count <= degree[a]);
      if (count != degree[a]) is_seam_[a] = 1;
    }
  }

  const std::size_t least_;
  const std::size_t most_;
  std::vector<std::uint32_t> table_;
  std::vector<std::uint32_t> corner_;             // by vertex: one of its corners
  std::vector<std::uint8_t> is_seam_;             // by vertex
  std::vector<std::uint8_t> is_whole_;            // by vertex; empty if nothing is known
  std::unordered_set<std::uint64_t> seam_edges_;  // of two vertices of the seam, if that is known
  std::size_t left_;
  std::vector<std::uint32_t> ring_, star_;
};

}  // namespace isomesh::mesh::collapse
