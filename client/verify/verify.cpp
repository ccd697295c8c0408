#include "client/verify/verify.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <sstream>
#include <thread>
#include <unordered_set>
#include <utility>

#include "client/verify/nearest.h"

namespace isomesh::verify {
namespace {

constexpr double kSlack = 1e-6;  // of the bound

struct Finding {
  double distance = 0;
  Vec place = {0, 0, 0};
  bool is_far = false;  // else it is undecided
  std::uint32_t triangle = 0;
};

struct Direction {
  std::vector<Finding> findings;       // the farthest first; one for a triangle
  std::vector<std::uint32_t> nearest;  // for each triangle the nearest one to its centre
  double farthest = 0;                 // of all places that were measured
};

// Looks from some triangles of a surface to another surface. For one thread.
class Search {
 public:
  Search(const Surface& from, const Tree& to, double bound)
      : from_(from), to_(to), bound_(bound), most_(bound * (1 + kSlack)) {}

  // The distance to a triangle is convex. So a piece whose corners are all within the bound of one
  // triangle is within the bound. A piece that is not shown to be so is halved.
  void look(std::uint32_t triangle, std::uint32_t& nearest) {
    constexpr int kMostPieces = 1 << 20;
    const Corners whole = from_.corners(triangle);
    near_ = measure(centre_of(whole)).triangle;
    nearest = near_;
    pieces_.assign(1, whole);
    for (int done = 0; !pieces_.empty(); ++done) {
      const Corners piece = pieces_.back();
      pieces_.pop_back();
      if (is_within(piece)) continue;
      const Vec centre = centre_of(piece);
      const Nearest found = measure(centre);
      near_ = found.triangle;
      if (std::sqrt(found.squared) > most_) return note(triangle, whole, centre);
      if (is_within(piece)) continue;
      double radius = 0;
      for (const Vec& corner : piece) radius = std::max(radius, length(corner - centre));
      if (std::sqrt(found.squared) + radius <= most_) continue;
      if (radius < kSlack / 10 * bound_ || done > kMostPieces) {
        findings.push_back({std::sqrt(found.squared), centre, false, triangle});
        return;
      }
      halve(piece);
    }
  }

  std::vector<Finding> findings;
  double farthest = 0;

 private:
  bool is_within(const Corners& piece) const {
    if (to_.surface().triangles.empty()) return false;
    const Corners near = to_.surface().corners(near_);
    return std::ranges::all_of(
        piece, [&](const Vec& corner) { return squared_distance(corner, near) <= most_ * most_; });
  }

  Nearest measure(const Vec& place) {
    const Nearest found = to_.nearest(place, near_);
    farthest = std::max(farthest, std::sqrt(found.squared));
    return found;
  }

  // Notes the farthest of a place that is too far and the corners of its triangle.
  void note(std::uint32_t triangle, const Corners& whole, const Vec& place) {
    Finding finding = {0, place, true, triangle};
    for (const Vec& each : {place, whole[0], whole[1], whole[2]}) {
      const double distance = std::sqrt(measure(each).squared);
      if (distance > finding.distance) finding = {distance, each, true, triangle};
    }
    findings.push_back(finding);
  }

  void halve(const Corners& piece) {
    std::size_t longest = 0;
    const auto side = [&](std::size_t n) { return squared(piece[(n + 1) % 3] - piece[n]); };
    for (const std::size_t n : {1, 2}) longest = side(n) > side(longest) ? n : longest;
    const Vec& a = piece[longest];
    const Vec& b = piece[(longest + 1) % 3];
    const Vec& c = piece[(longest + 2) % 3];
    const Vec middle = 0.5 * (a + b);
    pieces_.push_back({a, middle, c});
    pieces_.push_back({middle, b, c});
  }

  const Surface& from_;
  const Tree& to_;
  const double bound_;
  const double most_;
  std::uint32_t near_ = 0;
  std::vector<Corners> pieces_;
};

Direction look(const Surface& from, const Tree& to, double bound) {
  constexpr std::size_t kBlock = 1024;
  std::vector<Search> searches(std::max(1U, std::thread::hardware_concurrency()),
                               {from, to, bound});
  Direction result;
  result.nearest.resize(from.triangles.size());
  std::atomic<std::size_t> next = 0;
  {
    std::vector<std::jthread> threads;
    for (Search& search : searches) {
      threads.emplace_back([&] {
        for (std::size_t t = 0; (t = next.fetch_add(kBlock)) < from.triangles.size();) {
          const std::size_t end = std::min(t + kBlock, from.triangles.size());
          for (; t < end; ++t) search.look(static_cast<std::uint32_t>(t), result.nearest[t]);
        }
      });
    }
  }
  for (const Search& search : searches) {
    result.findings.insert(result.findings.end(), search.findings.begin(), search.findings.end());
    result.farthest = std::max(result.farthest, search.farthest);
  }
  std::ranges::sort(result.findings, std::greater{}, [](const Finding& finding) {
    return std::tuple(finding.is_far, finding.distance, finding.triangle);
  });
  return result;
}

std::ostream& operator<<(std::ostream& out, const Vec& p) {
  return out << '(' << p[0] << ", " << p[1] << ", " << p[2] << ')';
}

class Verifier {
 public:
  Verifier(Surface& mesh, Surface& surface, const Field& field, const Question& question)
      : field_(field), question_(question), mesh_(mesh), surface_(surface) {}

  Verdict run() {
    const Surface& mesh = mesh_.surface();
    const Surface& surface = surface_.surface();
    const Direction there = look(mesh, surface_, question_.bound);
    Direction back = look(surface, mesh_, question_.bound);
    const auto components = components_of(surface);
    const auto component = [&](std::uint32_t t) { return components[surface.triangles[t][0]]; };
    std::unordered_set<std::uint32_t> all;
    std::unordered_set<std::uint32_t> met;
    for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) all.insert(component(t));
    for (const std::uint32_t t : there.nearest)
      if (!all.empty()) met.insert(component(t));
    text_ << "surface: " << surface.triangles.size() << " triangles in " << all.size()
          << " components; the mesh has " << mesh.triangles.size() << " triangles\n";
    if (question_.some_parts) {
      std::erase_if(back.findings,
                    [&](const Finding& each) { return !met.contains(component(each.triangle)); });
      back.farthest = 0;
      text_ << "the mesh comes near to " << met.size()
            << " of the components; the others are not looked for\n";
    }
    tell("from the mesh to the surface", there);
    tell("from the surface to the mesh", back);
    check_edges();
    check_sides(there.nearest);
    text_ << (holds_ ? "PASSED: every point is within " : "FAILED: not shown to be right within ")
          << question_.bound << " mm, both ways\n";
    return {holds_, text_.str()};
  }

 private:
  void tell(const char* name, const Direction& direction) {
    text_ << name << ": ";
    if (direction.findings.empty()) {
      text_ << "every point is within " << question_.bound << " mm";
      if (direction.farthest > 0)
        text_ << "; the farthest that was measured is at " << direction.farthest << " mm";
      text_ << '\n';
      return;
    }
    holds_ = false;
    const auto far = std::ranges::count_if(direction.findings, &Finding::is_far);
    text_ << far << " triangles have points that are farther than " << question_.bound
          << " mm, and " << direction.findings.size() - static_cast<std::size_t>(far)
          << " are undecided\n";
    // Findings beside each other tell the same.
    constexpr std::size_t kMostPlaces = 10;
    std::vector<Vec> told;
    for (const Finding& each : direction.findings) {
      if (told.size() == kMostPlaces) break;
      const auto is_beside = [&](const Vec& place) {
        return length(place - each.place) < 10 * question_.bound;
      };
      if (std::ranges::any_of(told, is_beside)) continue;
      told.push_back(each.place);
      text_ << "  " << each.distance << " mm at " << each.place
            << (each.is_far ? "\n" : ", undecided\n");
    }
  }

  bool is_on_border(const Vec& a, const Vec& b) const {
    constexpr double kTolerance = 1e-3;  // of a step
    const Vec one = field_.index_of(a);
    const Vec other = field_.index_of(b);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const double face : {0.0, static_cast<double>(field_.dims[axis] - 1)}) {
        if (std::abs(one[axis] - face) < kTolerance && std::abs(other[axis] - face) < kTolerance)
          return true;
      }
    }
    return false;
  }

  void check_edges() {
    const Surface& mesh = mesh_.surface();
    std::vector<std::array<std::uint32_t, 3>>
        edges;  // the lower point, the higher one, the direction
    for (const auto& triangle : mesh.triangles) {
      for (std::size_t n = 0; n < 3; ++n) {
        const auto [a, b] = std::pair(triangle[n], triangle[(n + 1) % 3]);
        if (a != b) edges.push_back({std::min(a, b), std::max(a, b), a < b ? 1U : 0U});
      }
    }
    std::ranges::sort(edges);
    std::array<std::size_t, 4> counts = {};
    std::array<std::optional<Vec>, 4> places;
    for (std::size_t at = 0; at < edges.size();) {
      const auto [a, b, unused] = edges[at];
      std::size_t uses = 0;
      std::size_t forward = 0;
      for (; at < edges.size() && edges[at][0] == a && edges[at][1] == b; ++at, ++uses)
        forward += edges[at][2];
      if (uses == 2 * forward) continue;
      const bool is_open = uses == 1;
      const std::size_t kind =
          uses % 2 == 0                                                          ? 3
          : uses > 1                                                             ? 2
          : !question_.is_closed && is_on_border(mesh.points[a], mesh.points[b]) ? 0
                                                                                 : 1;
      static_cast<void>(is_open);
      ++counts[kind];
      if (!places[kind]) places[kind] = 0.5 * (mesh.points[a] + mesh.points[b]);
    }
    constexpr std::array<const char*, 4> kKinds = {
        "open edges on the border of the volume", "open edges",
        "edges of an odd number of triangles",
        "edges where a triangle is turned against its neighbour"};
    for (std::size_t kind = 0; kind < 4; ++kind) {
      text_ << kKinds.at(kind) << ": " << counts[kind];
      if (kind > 0 && counts[kind] > 0) {
        holds_ = false;
        text_ << ", such as at " << *places[kind];
      }
      text_ << '\n';
    }
  }

  // Normals must point to lower values, as those of the surface do.
  void check_sides(const std::vector<std::uint32_t>& nearest) {
    const Surface& mesh = mesh_.surface();
    if (surface_.surface().triangles.empty()) return;
    const auto components = components_of(mesh);
    std::vector<double> area(components.size());
    std::size_t against = 0;
    for (std::size_t t = 0; t < nearest.size(); ++t) {
      const Vec normal = normal_of(mesh.corners(t));
      const double side = dot(normal, normal_of(surface_.surface().corners(nearest[t])));
      if (side < 0) ++against;
      if (side != 0) area[components[mesh.triangles[t][0]]] += std::copysign(length(normal), side);
    }
    const auto inside_out = std::ranges::count_if(area, [](double sum) { return sum < 0; });
    if (inside_out > 0) holds_ = false;
    text_ << "triangles that face higher values: " << against
          << "; components inside out: " << inside_out << '\n';
  }

  const Field& field_;
  const Question question_;
  const Tree mesh_;
  const Tree surface_;
  bool holds_ = true;
  std::ostringstream text_;
};

}  // namespace

Verdict verify(Surface& mesh, Surface& surface, const Field& field, const Question& question) {
  return Verifier(mesh, surface, field, question).run();
}

}  // namespace isomesh::verify
