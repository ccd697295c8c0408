#include "client/verify/verify.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <sstream>
#include <thread>
#include <utility>

namespace isomesh::verify {
namespace {

constexpr double kSlack = 1e-6;  // of the bound

struct Finding {
  bool is_far = false;  // else it is undecided
  double distance = 0;
  std::uint32_t triangle = 0;
  Vec place = {0, 0, 0};

  auto operator<=>(const Finding&) const = default;
};

struct Direction {
  std::vector<Finding> findings;  // at most one for a triangle; the farthest first
  std::vector<Nearest> nearest;   // for each triangle the nearest one to its centre
};

// Looks from triangles of a surface to another surface. For one thread.
class Search {
 public:
  Search(const Surface& from, const Tree& to, double bound)
      : from_(from), to_(to), most_(bound * (1 + kSlack)) {}

  // The distance to a triangle is convex. So a piece whose corners are all within the bound of one
  // triangle is within the bound. A piece that is not shown to be so is halved.
  Nearest look(std::uint32_t triangle) {
    constexpr int kMostPieces = 1 << 20;
    const Corners whole = from_.corners(triangle);
    const Nearest at_centre = near_ = to_.nearest(centre_of(whole), near_.triangle);
    pieces_.assign(1, whole);
    for (int done = 0; !pieces_.empty(); ++done) {
      const Corners piece = pieces_.back();
      pieces_.pop_back();
      if (is_within(piece)) continue;
      const Vec centre = centre_of(piece);
      near_ = to_.nearest(centre, near_.triangle);
      const double distance = std::sqrt(near_.squared);
      if (distance > most_) {
        note_farthest({centre, whole[0], whole[1], whole[2]}, triangle);
        break;
      }
      double radius = 0;
      for (const Vec& p : piece) radius = std::max(radius, std::sqrt(squared(p - centre)));
      if (is_within(piece) || distance + radius <= most_) continue;
      if (radius < kSlack / 10 * most_ || done > kMostPieces) {
        findings.push_back({false, distance, triangle, centre});
        break;
      }
      halve(piece);
    }
    return at_centre;
  }

  std::vector<Finding> findings;

 private:
  bool is_within(const Corners& piece) const {
    if (to_.surface().triangles.empty()) return false;
    const Corners near = to_.surface().corners(near_.triangle);
    return std::ranges::all_of(piece, [&](const Vec& p) {
      return squared_distance(p, near, most_ * most_) <= most_ * most_;
    });
  }

  void note_farthest(const std::array<Vec, 4>& places, std::uint32_t triangle) {
    Finding farthest;
    for (const Vec& place : places) {
      const double distance = std::sqrt(to_.nearest(place, near_.triangle).squared);
      if (distance > farthest.distance) farthest = {true, distance, triangle, place};
    }
    findings.push_back(farthest);
  }

  void halve(const Corners& piece) {
    const auto side = [&](std::size_t n) { return squared(piece[(n + 1) % 3] - piece[n]); };
    std::size_t n = side(1) > side(0) ? 1 : 0;
    if (side(2) > side(n)) n = 2;
    const auto& [a, b, c] = Corners{piece[n], piece[(n + 1) % 3], piece[(n + 2) % 3]};
    const Vec middle = 0.5 * (a + b);
    pieces_.push_back({a, middle, c});
    pieces_.push_back({middle, b, c});
  }

  const Surface& from_;
  const Tree& to_;
  const double most_;
  Nearest near_;
  std::vector<Corners> pieces_;
};

Direction look(const Surface& from, const Tree& to, double bound) {
  constexpr std::size_t kBlock = 1024;
  std::vector<Search> searches(std::max(1U, std::thread::hardware_concurrency()),
                               {from, to, bound});
  Direction result = {{}, std::vector<Nearest>(from.triangles.size())};
  std::atomic<std::size_t> next = 0;
  std::vector<std::thread> threads;
  for (Search& search : searches) {
    threads.emplace_back([&] {
      for (std::size_t t = 0; (t = next.fetch_add(kBlock)) < from.triangles.size();) {
        const std::size_t end = std::min(t + kBlock, from.triangles.size());
        for (; t < end; ++t) result.nearest[t] = search.look(static_cast<std::uint32_t>(t));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const Search& search : searches) {
    result.findings.insert(result.findings.end(), search.findings.begin(), search.findings.end());
  }
  std::ranges::sort(result.findings, std::greater{});
  return result;
}

std::string text_of(const Vec& p) {
  std::ostringstream text;
  text << " at (" << p[0] << ", " << p[1] << ", " << p[2] << ")";
  return text.str();
}

// The connected components of a surface, by size.
class Components {
 public:
  explicit Components(const Surface& surface) : of_point_(components_of(surface)) {
    std::vector<std::uint64_t> sizes(of_point_.size());
    for (const Indices& triangle : surface.triangles) ++sizes[of_point_[triangle[0]]];
    for (std::uint32_t n = 0; n < sizes.size(); ++n) {
      if (sizes[n] > 0) by_size_.emplace_back(sizes[n], n);
    }
    std::ranges::stable_sort(by_size_, std::greater{}, [](const auto& one) { return one.first; });
  }

  std::size_t count() const { return by_size_.size(); }

  // Names the component of a triangle with that corner.
  std::string name_of(std::uint32_t corner) const {
    const auto found =
        std::ranges::find(by_size_, of_point_[corner], [](const auto& one) { return one.second; });
    return "component " + std::to_string(found - by_size_.begin() + 1) + " of " +
           std::to_string(count()) + ", of " + std::to_string(found->first) + " triangles";
  }

 private:
  std::vector<std::uint32_t> of_point_;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> by_size_;  // triangles, component
};

class Verifier {
 public:
  Verifier(Surface& mesh, Surface& surface, const Field& field, const Question& question)
      : field_(field), question_(question), mesh_(mesh), surface_(without(surface)) {}

  Verdict run() {
    const Surface& surface = surface_.surface();
    const Direction there = look(mesh_.surface(), surface_, question_.bound);
    const Direction back = look(surface, mesh_, question_.bound);
    tell("mesh to the surface", there, mesh_.surface(), "the mesh's ");
    tell("surface to the mesh", back, surface, "the surface's ");
    check_edges();
    check_sides(there.nearest);
    text_ << (holds_ ? "PASSED: every point is within " : "FAILED: see above; the bound is ")
          << question_.bound << (holds_ ? " mm, both ways\n" : " mm\n");
    return {holds_, text_.str()};
  }

 private:
  // Removes components that the mesh need not have.
  Surface& without(Surface& surface) {
    const std::size_t triangles = surface.triangles.size();
    const std::size_t components = Components(surface).count();
    keep_components(question_.components, surface);
    text_ << "The mesh has " << mesh_.surface().triangles.size() << " triangles, the surface "
          << triangles << " in " << components << " components";
    if (!question_.components.keeps_all()) {
      text_ << ", of which the job keeps " << Components(surface).count() << ", of "
            << surface.triangles.size() << " triangles";
    }
    text_ << ".\n";
    return surface;
  }

  void tell(const char* ways, const Direction& direction, const Surface& from, const char* whose) {
    const auto& findings = direction.findings;
    text_ << "From the " << ways << ": ";
    if (findings.empty()) text_ << "every point is within " << question_.bound << " mm.\n";
    if (findings.empty()) return;
    holds_ = false;
    const auto far = std::ranges::count_if(findings, &Finding::is_far);
    text_ << far << " triangles have points farther than " << question_.bound << " mm, "
          << findings.size() - static_cast<std::size_t>(far) << " are undecided:\n";
    const Components components(from);
    // Findings beside each other tell the same.
    std::vector<Vec> told;
    for (const Finding& each : findings) {
      const auto is_beside = [&](const Vec& p) {
        return squared(p - each.place) < 100 * question_.bound * question_.bound;
      };
      if (told.size() == 10 || std::ranges::any_of(told, is_beside)) continue;
      told.push_back(each.place);
      text_ << "  " << each.distance << " mm" << text_of(each.place)
            << (each.is_far ? ", in " : ", undecided, in ") << whose
            << components.name_of(from.triangles[each.triangle][0]) << '\n';
    }
  }

  void count(const std::string& what, const std::vector<Vec>& places, bool is_fault) {
    text_ << what << ": " << places.size();
    if (is_fault && !places.empty()) text_ << ", such as" << text_of(places[0]);
    text_ << '\n';
    holds_ = holds_ && (!is_fault || places.empty());
  }

  bool is_on_border(const Vec& a, const Vec& b) const {
    const Vec one = field_.index_of(a);
    const Vec other = field_.index_of(b);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const double face : {0.0, static_cast<double>(field_.dims[axis] - 1)}) {
        const double off = std::max(std::abs(one[axis] - face), std::abs(other[axis] - face));
        if (off < 1e-3) return true;  // of a step; single precision is finer
      }
    }
    return false;
  }

  void check_edges() {
    const Surface& mesh = mesh_.surface();
    std::vector<Indices> edges;  // the lower point, the higher one, the direction
    for (const Indices& t : mesh.triangles) {
      for (std::size_t n = 0; n < 3; ++n) {
        const auto [low, high] = std::minmax(t[n], t[(n + 1) % 3]);
        if (low != high) edges.push_back({low, high, low == t[n] ? 1U : 0U});
      }
    }
    std::ranges::sort(edges);
    std::array<std::vector<Vec>, 4> places;
    for (std::size_t first = 0, at = 0; at < edges.size(); first = at) {
      const auto [a, b, direction] = edges[first];
      std::size_t forward = 0;
      for (; at < edges.size() && edges[at][0] == a && edges[at][1] == b; ++at) {
        forward += edges[at][2];
      }
      const std::size_t uses = at - first;
      if (uses == 2 * forward) continue;
      const bool is_border =
          uses == 1 && !question_.is_closed && is_on_border(mesh.points[a], mesh.points[b]);
      const std::size_t kind = is_border ? 0 : uses == 1 ? 1 : uses % 2 != 0 ? 2 : 3;
      places.at(kind).push_back(0.5 * (mesh.points[a] + mesh.points[b]));
    }
    count("Open edges on the border of the volume", places[0], false);
    count("Other open edges", places[1], true);
    count("Edges of three triangles, or five and so on", places[2], true);
    count("Edges where a triangle is turned against its neighbour", places[3], true);
  }

  // Normals must point outwards, as those of the surface do. If both sides of the
  // surface are within the bound, as at a thin wall, a triangle may face either.
  void check_sides(const std::vector<Nearest>& nearest) {
    const Surface& mesh = mesh_.surface();
    const auto components = components_of(mesh);
    std::vector<double> area(components.size());
    std::vector<Vec> against;
    std::vector<Vec> inside_out;
    for (std::size_t t = 0; t < nearest.size() && !surface_.surface().triangles.empty(); ++t) {
      const Vec normal = normal_of(mesh.corners(t));
      const Vec centre = centre_of(mesh.corners(t));
      double side = dot(normal, normal_of(surface_.surface().corners(nearest[t].triangle)));
      if (side < 0 && surface_.has_near(centre, question_.bound, normal)) side = 0;
      if (side < 0) against.push_back(centre);
      const double sign = side > 0 ? 1 : side < 0 ? -1 : 0;
      area[components[mesh.triangles[t][0]]] += sign * std::sqrt(squared(normal));
    }
    for (std::size_t point = 0; point < area.size(); ++point) {
      if (area[point] < 0) inside_out.push_back(mesh.points[point]);
    }
    count("Triangles that face the inside", against, false);
    count("Components inside out", inside_out, true);
  }

  const Field& field_;
  const Question question_;
  bool holds_ = true;
  std::ostringstream text_;
  const Tree mesh_;
  const Tree surface_;
};

}  // namespace

Verdict verify(Surface& mesh, Surface& surface, const Field& field, const Question& question) {
  return Verifier(mesh, surface, field, question).run();
}

}  // namespace isomesh::verify
