#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/mesh/collapse/kept_volume.h"
#include "server/mesh/collapse/misses.h"
#include "server/mesh/collapse/part_volumes.h"
#include "server/mesh/collapse/proposal.h"
#include "server/mesh/collapse/simplify.h"
#include "server/mesh/collapse/simplify_layers.h"
#include "server/mesh/measure/marked_cubes.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr int kMostRepairs = 24;
constexpr int kMostMoves = 6;  // rounds that only move vertices back
constexpr int kMostProposals = 4;
// A part's volume changes by no larger share, if that can be reached in so many further rounds and
// with so few more triangles, a fourth. The first rounds undo nothing.
constexpr double kMostChange = 0.003;
constexpr int kMostRestorations = 10;
constexpr int kMovesAlone = 2;
constexpr std::size_t kMostRestored = 4;

bool is_left(const Triangle& corners) {
  return corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0];
}

// Moved vertices go half of the way back, and then all of it.
constexpr std::uint8_t kMostPulls = 2;

// Some triangles of a surface, those that are left of collapses and near marked cubes, if any.
class Part {
 public:
  Part(const WalledSurface& whole, const MarkedCubes* cubes) : positions_(whole.view.positions) {
    for (std::uint32_t t = 0; t < whole.view.triangles.size(); ++t) {
      const Triangle& triangle = whole.view.triangles[t];
      if (!is_left(triangle)) continue;
      if (cubes != nullptr && !cubes->are_near(box_of(whole.view, triangle))) continue;
      numbers_.push_back(t);
      triangles_.push_back(triangle);
      if (!whole.sides.empty()) sides_.push_back(whole.sides[t]);
    }
  }

  WalledSurface surface() const { return {{positions_, triangles_}, sides_}; }
  // A triangle's number in the whole surface.
  std::uint32_t number(std::uint32_t triangle) const { return numbers_[triangle]; }

 private:
  const std::span<const Vec3> positions_;
  std::vector<std::uint32_t> numbers_;
  std::vector<Triangle> triangles_;
  std::vector<WallSides> sides_;
};

// Looks at all points of a proposal, and of the original surface. If a point is beyond the limit of
// the error, or if a triangle that changed intersects another one, it moves vertices there back. It
// undoes collapses once all of them are back. From the second round on, it only looks at what may
// have changed.
class Checker {
 public:
  Checker(const SimplifyOptions& options, const Context& context, const Mesh& mesh,
          const Original& original)
      : within_mm_(options.max_error_mm),
        context_(context),
        mesh_(mesh),
        original_(original.surface),
        grids_(original.grids) {}

  // Returns true if all points are within the error then.
  bool repair(Proposal& proposal) {
    begin(proposal);
    int moves = 0;
    for (int round = 0;;) {
      context_.throw_if_stopped();
      find_faults();
      if ((faults_.empty() && lost_.empty()) || round == kMostRepairs) break;
      // Collapses may be no fault where only a moved vertex is.
      if (moves++ < kMostMoves && change(0, proposal.history)) continue;
      // More at a time later, so that nothing is left to undo in the end.
      change(std::size_t{1} << (round++ / 2), proposal.history);
    }
    take(proposal);
    return grids_ != nullptr && lost_.empty() && !is_beyond_;
  }

  // Undoes no collapse. Triangles that intersect without moved vertices do so afterwards.
  void move_back(Proposal& proposal) {
    begin(proposal);
    do {
      context_.throw_if_stopped();
      find_faults();
    } while (change(0, proposal.history));
    take(proposal);
  }

 private:
  // Looks at what differs from the last proposal, if there was one.
  void begin(const Proposal& proposal) {
    std::vector<Triangle> corners(mesh_.triangles.size(), Triangle{});
    for (std::size_t n = 0; n < proposal.numbers.size(); ++n) {
      corners[proposal.numbers[n]] = proposal.triangles[n];
    }
    const bool is_new = corners_.empty();
    const auto is_same = [&](std::uint32_t t) {
      if (!is_left(corners[t]) && !is_left(corners_[t])) return true;
      return corners[t] == corners_[t] && std::ranges::all_of(corners[t], [&](std::uint32_t v) {
               return proposal.places[v] == places_[v];
             });
    };
    fresh_ = std::exchange(faults_, {});
    std::vector<Box> changed;
    for (std::uint32_t t = 0; t < corners.size(); ++t) {
      if (is_new || is_same(t)) continue;
      note_box(t, changed);
      fresh_.push_back(t);
    }
    corners_ = std::move(corners);
    places_ = proposal.places;
    pulls_.assign(places_.size(), 0);
    for (const std::uint32_t t : fresh_) note_box(t, changed);
    make_fresh_a_set();
    is_first_ = is_new || 2 * fresh_.size() > proposal.numbers.size();
    if (is_first_) {
      fresh_ = proposal.numbers;
      std::ranges::sort(fresh_);
      doubtful_.resize(corners_.size());
      std::iota(doubtful_.begin(), doubtful_.end(), 0U);
    } else {
      doubt_near(changed);
    }
  }

  void note_box(std::uint32_t t, std::vector<Box>& boxes) const {
    if (is_left(corners_[t])) boxes.push_back(box_of({places_, corners_}, corners_[t]));
  }

  void make_fresh_a_set() {
    std::ranges::sort(fresh_);
    fresh_.erase(std::unique(fresh_.begin(), fresh_.end()), fresh_.end());
    std::erase_if(fresh_, [&](std::uint32_t t) { return !is_left(corners_[t]); });
  }

  // Triangles of the original surface near these boxes may have lost what they were near to.
  void doubt_near(std::span<const Box> changed) {
    if (grids_ == nullptr) return;
    const MarkedCubes near_changed(changed, within_mm_);
    std::vector<std::uint8_t> is_doubtful(corners_.size());
    for_each(context_, corners_.size(), [&](std::size_t t) {
      const Box box = box_of(original_.view, original_.view.triangles[t]);
      is_doubtful[t] = near_changed.are_near(box) ? 1 : 0;
    });
    for (const std::uint32_t t : lost_) is_doubtful[t] = 1;
    doubtful_.clear();
    for (std::uint32_t t = 0; t < corners_.size(); ++t) {
      if (is_doubtful[t] != 0) doubtful_.push_back(t);
    }
  }

  void take(Proposal& proposal) const {
    proposal.places = places_;
    proposal.is_moved_back.resize(places_.size());
    for (std::size_t v = 0; v < pulls_.size(); ++v) {
      if (pulls_[v] != 0) proposal.is_moved_back[v] = 1;
    }
    proposal.numbers.clear();
    proposal.triangles.clear();
    for (std::uint32_t t = 0; t < corners_.size(); ++t) {
      if (!is_left(corners_[t])) continue;
      proposal.numbers.push_back(t);
      proposal.triangles.push_back(corners_[t]);
    }
  }

  void find_faults() {
    const WalledSurface left = {{places_, corners_}, original_.sides};
    faults_.clear();
    for (const std::uint32_t t : fresh_) {
      if (collapse::is_turned(mesh_, places_, corners_[t])) faults_.push_back(t);
    }
    find_crossings(left);
    if (grids_ != nullptr) {
      const auto added = find_misses(left, fresh_, *grids_, within_mm_, context_);
      for (const Miss& miss : added) faults_.push_back(miss.triangle);
      is_beyond_ = !added.empty();
      find_losses(left);
    }
    is_first_ = false;
  }

  // Between triangles of which a collapse changed one.
  void find_crossings(const WalledSurface& left) {
    const auto fresh = near(left, fresh_, 0);
    const Part part(left, fresh ? &*fresh : nullptr);
    for (const std::uint32_t n : find_intersecting_triangles(part.surface().view, context_)) {
      const std::uint32_t t = part.number(n);
      if (corners_[t] != mesh_.triangles[t] || has_moved(corners_[t])) faults_.push_back(t);
    }
  }

  void find_losses(const WalledSurface& left) {
    const auto doubtful = near(original_, doubtful_, within_mm_);
    const Part part(left, doubtful ? &*doubtful : nullptr);
    const WallGrids grids(part.surface(), context_);
    lost_.clear();
    for (const Miss& miss : find_misses(original_, doubtful_, grids, within_mm_, context_)) {
      lost_.push_back(miss.triangle);
    }
  }

  // Around these triangles of the surface; nothing if they are all.
  std::optional<MarkedCubes> near(const WalledSurface& surface,
                                  std::span<const std::uint32_t> which, double reach_mm) const {
    if (is_first_) return {};
    std::vector<Box> boxes;
    for (const std::uint32_t t : which) {
      boxes.push_back(box_of(surface.view, surface.view.triangles[t]));
    }
    return MarkedCubes(boxes, reach_mm);
  }

  bool has_moved(std::uint32_t vertex) const { return places_[vertex] != mesh_.positions[vertex]; }
  bool has_moved(const Triangle& corners) const {
    return std::ranges::any_of(corners, [&](std::uint32_t v) { return has_moved(v); });
  }

  // Moves vertices of faulty triangles back; returns true if there were any. Undoes the last
  // `count` collapses of those without moved vertices.
  bool change(std::size_t count, collapse::History& history) {
    std::vector<std::uint32_t> which;
    std::vector<std::uint8_t> is_pulled(places_.size(), 0);
    const auto sort_out = [&](std::uint32_t t, const Triangle& corners) {
      if (!has_moved(corners)) return which.push_back(t);
      for (const std::uint32_t v : corners) is_pulled[v] = has_moved(v) ? 1 : 0;
    };
    for (const std::uint32_t t : faults_) sort_out(t, corners_[t]);
    for (const std::uint32_t t : lost_) sort_out(t, history.corners_of(mesh_.triangles[t]));
    const bool are_any_moved = std::ranges::find(is_pulled, 1) != is_pulled.end();
    if (count == 0 && !are_any_moved) return false;
    std::vector<Box> changed;
    fresh_.clear();
    if (count > 0 && !which.empty()) {
      fresh_ = history.undo(mesh_.triangles.span(), which, count);
    }
    for (std::uint32_t t = 0; t < corners_.size(); ++t) {
      const auto& [a, b, c] = corners_[t];
      const bool is_moved =
          is_left(corners_[t]) && (is_pulled[a] | is_pulled[b] | is_pulled[c]) != 0;
      if (is_moved) fresh_.push_back(t);
    }
    for (const std::uint32_t t : fresh_) note_box(t, changed);
    for (std::uint32_t v = 0; v < is_pulled.size(); ++v) {
      if (is_pulled[v] != 0) pull(v);
    }
    for (const std::uint32_t t : fresh_) {
      corners_[t] = history.corners_of(mesh_.triangles[t]);
      note_box(t, changed);
    }
    fresh_.insert(fresh_.end(), faults_.begin(), faults_.end());
    make_fresh_a_set();
    doubt_near(changed);
    return are_any_moved;
  }

  void pull(std::uint32_t vertex) {
    const Vec3& own = mesh_.positions[vertex];
    const bool is_last = ++pulls_[vertex] == kMostPulls;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      places_[vertex][axis] =
          is_last ? own[axis] : own[axis] + (places_[vertex][axis] - own[axis]) / 2;
    }
  }

  const double within_mm_;
  const Context context_;
  const Mesh& mesh_;
  const WalledSurface& original_;
  const WallGrids* const grids_;  // of it, if the error is measured
  // By number of the original triangle, which tells its wall, too.
  std::vector<Triangle> corners_;        // what is left of it
  std::vector<Vec3> places_;             // of the vertices, by number
  std::vector<std::uint8_t> pulls_;      // how often each vertex was moved back
  std::vector<std::uint32_t> fresh_;     // of what is left: to look at
  std::vector<std::uint32_t> doubtful_;  // of the original: to look at
  std::vector<std::uint32_t> faults_;    // of what is left: beyond the error or across another one
  std::vector<std::uint32_t> lost_;      // of the original: beyond the error
  bool is_beyond_ = false;               // some of what is left
  bool is_first_ = true;
};

// Vertices that were moved back, and those that are not beside a changed part.
std::vector<std::uint8_t> held(std::span<const std::uint8_t> are_changed,
                               std::span<const WallSides> sides, const Proposal& proposal) {
  std::vector<std::uint8_t> is_held(proposal.places.size(), 1);
  for (std::size_t n = 0; n < proposal.triangles.size(); ++n) {
    const WallSides& beside = sides[proposal.numbers[n]];
    if ((are_changed[beside.front] | are_changed[beside.back]) == 0) continue;
    for (const std::uint32_t v : proposal.triangles[n]) is_held[v] = proposal.is_moved_back[v];
  }
  return is_held;
}

void undo(std::span<const std::uint32_t> which, const Mesh& mesh, Proposal& proposal) {
  proposal.history.undo(mesh.triangles.span(), which, 1);
  proposal.triangles.clear();
  proposal.numbers.clear();
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle corners = proposal.history.corners_of(mesh.triangles[t]);
    if (!is_left(corners)) continue;
    proposal.numbers.push_back(t);
    proposal.triangles.push_back(corners);
  }
}

// Moves vertices so that the surface keeps its volume, and repairs what that spoils. What repairs
// take from a part is given back by the other vertices beside it, and then by undone collapses, if
// these leave few more triangles and no more than asked for. Returns true if all points are within
// the error.
bool move_and_repair(const SimplifyOptions& options, const Context& context,
                     const WalledSurface& surface, const Mesh& mesh,
                     const collapse::PartVolumes& volumes, Checker& checker, Proposal& proposal) {
  proposal.places.assign(mesh.positions.begin(), mesh.positions.end());
  if (!options.keeps_volume) return checker.repair(proposal);
  std::vector<std::uint8_t> is_held;
  std::size_t most = 0;  // triangles
  Proposal before;
  bool is_within_before = false;
  for (int round = 0;; ++round) {
    collapse::keep_volume(mesh, surface.sides, proposal.history, is_held, options.max_error_mm,
                          context, proposal.places);
    const bool is_within = checker.repair(proposal);
    const std::size_t count = proposal.triangles.size();
    if (round == kMovesAlone) {
      most = options.triangles > 0 ? std::max<std::size_t>(count, options.triangles)
                                   : count + count / kMostRestored;
    } else if (round > kMovesAlone && count > most) {
      proposal = std::move(before);
      return is_within_before;
    }
    const std::vector<double> changes =
        volumes.changes(proposal.places, proposal.triangles, proposal.numbers);
    const std::vector<std::uint8_t> are_changed = volumes.beyond(kMostChange, changes);
    const bool is_any = std::ranges::find(are_changed, 1) != are_changed.end();
    if (!is_any || round == kMostRestorations) return is_within;
    if (round >= kMovesAlone) {
      before = proposal;
      is_within_before = is_within;
      undo(volumes.to_undo(kMostChange, changes, mesh, proposal.history, proposal.places), mesh,
           proposal);
    }
    is_held = held(are_changed, surface.sides, proposal);
  }
}

// Proposals with fewer triangles than asked for, if repairs add some. Where only the number counts,
// it goes first: the proposal is as it was if repairs add too many.
Proposal propose_and_repair(const SimplifyOptions& options, const Context& context,
                            const Mesh& mesh, const SeparatingSurface* walls) {
  const Context quiet = {context.stop, nullptr};
  const WalledSurface surface = {
      {options.before.empty() ? mesh.positions.span() : options.before, mesh.triangles.span()},
      walls == nullptr ? std::span<const WallSides>() : walls->sides.span()};
  std::optional<WallGrids> grids;
  if (std::isfinite(options.max_error_mm)) grids.emplace(surface, quiet);
  const Original original = {surface, grids ? &*grids : nullptr};
  Checker checker(options, quiet, mesh, original);
  SimplifyOptions asked = options;
  std::optional<Proposal> first;  // as it was proposed, where only the number counts
  const collapse::PartVolumes volumes(mesh, surface.sides);
  const auto as_proposed = [&](Proposal proposal) {
    proposal.places.assign(mesh.positions.begin(), mesh.positions.end());
    if (!options.keeps_volume) return proposal;
    collapse::keep_volume(mesh, surface.sides, proposal.history, {}, options.max_error_mm, quiet,
                          proposal.places);
    checker.move_back(proposal);
    return proposal;
  };
  for (int attempt = 1;; ++attempt) {
    const Context part = context.part(1 - std::pow(0.5, attempt - 1), 1 - std::pow(0.5, attempt));
    Proposal proposal = propose(asked, part, mesh, walls, original);
    SimplificationEffect& effect = proposal.effect;
    const bool was_reached = effect.reached_triangles;
    if (!grids && !was_reached) return as_proposed(std::move(first ? *first : proposal));
    if (!grids && !first && options.triangles > 0) first = proposal;
    effect.is_within = move_and_repair(options, quiet, surface, mesh, volumes, checker, proposal);
    effect.triangles_after = proposal.triangles.size();
    if (options.triangles == 0) return proposal;
    effect.reached_triangles = effect.triangles_after <= options.triangles;
    effect.is_least = effect.is_least && !effect.reached_triangles;
    if (!was_reached || effect.reached_triangles) return proposal;
    const std::uint64_t more = effect.triangles_after - options.triangles;
    const bool is_too_far = !grids && more > options.triangles / 2;
    if (attempt == kMostProposals || is_too_far) {
      return first ? as_proposed(std::move(*first)) : std::move(proposal);
    }
    asked.triangles -= std::min(asked.triangles - 1, more + more / 4 + 1);
  }
}

SimplificationEffect simplify(const SimplifyOptions& options, const Context& context, Mesh& mesh,
                              SeparatingSurface* walls) {
  const std::uint64_t points = std::uint64_t{mesh.positions.size()} + mesh.triangles.size();
  if (points >= TriangleGrid::kNone) {
    throw Error(ErrorCode::kTooLarge, "the surface has " + std::to_string(points) +
                                          " vertices and triangles; more than 32 bits can number");
  }
  context.throw_if_stopped();
  if (mesh.triangles.size() == 0) return {};
  Proposal proposal = propose_and_repair(options, context, mesh, walls);
  context.throw_if_stopped();
  std::ranges::copy(proposal.places, mesh.positions.begin());
  std::vector<WallSides> sides;
  if (walls != nullptr) {
    for (const std::uint32_t number : proposal.numbers) sides.push_back(walls->sides[number]);
  }
  replace_triangles(proposal.triangles, sides, mesh);
  if (walls != nullptr) {
    walls->sides.shrink(mesh.triangles.size());
    std::ranges::copy(sides, walls->sides.begin());
  }
  return proposal.effect;
}

}  // namespace

SimplificationEffect simplify(const SimplifyOptions& options, const Context& context, Mesh& mesh) {
  return simplify(options, context, mesh, nullptr);
}

SimplificationEffect simplify(const SimplifyOptions& options, const Context& context,
                              SeparatingSurface& walls) {
  return simplify(options, context, walls.mesh, &walls);
}

}  // namespace isomesh::mesh
