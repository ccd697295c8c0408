// Regions are found by runs of outside samples in rows: a run is joined with the runs of the rows
// before it. Slabs of planes are swept by themselves, and joined in their order at the planes that
// two of them share. So the memory is that of the runs of two planes, and of as many of centres,
// for each slab, of those planes that threads are at, and of the nodes.
#include "server/mesh/extract/open_cavities.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <limits>
#include <optional>
#include <utility>

#include "proto/samples.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

using Word = std::uint64_t;
using Node = std::uint32_t;

constexpr std::size_t kWordBits = 64;
constexpr Node kNone = std::numeric_limits<Node>::max();
constexpr std::uint32_t kSlabPlanes = 32;

// Disjoint sets of nodes; each node points to a smaller one of its set, the smallest to itself.
class Sets {
 public:
  void add() { parents_.push_back(static_cast<Node>(parents_.size())); }

  Node find(Node node) {
    while (parents_[node] != node) node = parents_[node] = parents_[parents_[node]];
    return node;
  }

  void join(Node a, Node b) {
    a = find(a);
    b = find(b);
    parents_[std::max(a, b)] = std::min(a, b);
  }

  // Adds the other's sets behind these.
  void append(const Sets& other) {
    const auto offset = static_cast<Node>(parents_.size());
    for (const Node parent : other.parents_) parents_.push_back(offset + parent);
  }

 private:
  std::vector<Node> parents_;
};

// Samples or centres [begin, end) of a row, all outside.
struct Run {
  std::uint32_t begin = 0;
  std::uint32_t end = 0;
  Node node = kNone;
};

bool overlap(const Run& a, const Run& b) { return a.begin < b.end && b.begin < a.end; }

// True if a run of centres has a cell with a corner in the run of samples.
bool touch(const Run& centres, const Run& samples) {
  return samples.begin <= centres.end && centres.begin < samples.end;
}

// The runs of one plane, row by row.
struct Plane {
  std::vector<Run> runs;
  std::vector<std::size_t> ends;  // of each row, in `runs`

  std::size_t bytes() const { return runs.size() * sizeof(Run) + ends.size() * sizeof ends[0]; }

  void shrink_to_fit() {
    runs.shrink_to_fit();
    ends.shrink_to_fit();
  }

  std::span<Run> row(std::size_t y) {
    if (y >= ends.size()) return {};
    const std::size_t begin = y == 0 ? 0 : ends[y - 1];
    return std::span(runs).subspan(begin, ends[y] - begin);
  }

  // Adds a row of those `count` bits that are zero.
  void add_row(std::span<const Word> inside, std::uint32_t count) {
    Run run = {count, count};
    for (std::uint32_t x = 0; x < count;) {
      const Word rest = inside[x / kWordBits] >> x % kWordBits;
      const bool is_in_run = run.begin != count;
      // In a run, the next bit that is set ends it; before it, the next that is not begins it.
      const auto same = static_cast<std::uint32_t>(std::min<std::size_t>(
          is_in_run ? std::countr_zero(rest) : std::countr_one(rest), kWordBits - x % kWordBits));
      x = std::min(count, x + same);
      if (x == count || (same > 0 && x % kWordBits == 0)) continue;
      if (is_in_run) {
        runs.push_back({run.begin, x});
        run.begin = count;
      } else {
        run.begin = x;
      }
    }
    if (run.begin != count) runs.push_back(run);
    ends.push_back(runs.size());
  }
};

// Calls visit(one of `before`, one of `runs`) for all that overlap or follow each other.
template <class Visit>
void visit_near(std::span<Run> before, std::span<Run> runs, Visit visit) {
  std::size_t first = 0;
  for (Run& run : runs) {
    while (first < before.size() && before[first].end < run.begin) ++first;
    for (std::size_t n = first; n < before.size() && before[n].begin <= run.end; ++n) {
      visit(before[n], run);
    }
  }
}

// From a row of samples to one behind it.
struct RowStep {
  int y = 0;
  int z = 0;

  bool is_of_faces() const { return (y == 0) != (z == 0); }
};
constexpr std::array kRowSteps = {RowStep{1, 0}, RowStep{0, 1}, RowStep{1, 1}, RowStep{-1, 1}};

// True if one of the lattice's diagonals joins the runs of two rows. `parity`: of the sample x = 0
// in the first row.
bool joins(Scheme scheme, const Run& from, const Run& to, const RowStep& step, unsigned parity) {
  const auto is_even = [parity](std::uint32_t x) { return ((x + parity) & 1) == 0; };
  if (scheme == Scheme::kSix) {  // to the same x, and to the next
    return step.y >= 0 && to.begin <= from.end && from.begin < to.end;
  }
  if (scheme != Scheme::kFive) return false;
  if (step.is_of_faces()) {
    return (to.begin == from.end && is_even(from.end - 1)) ||
           (to.end == from.begin && is_even(from.begin));
  }
  const std::uint32_t begin = std::max(from.begin, to.begin);
  const std::uint32_t end = std::min(from.end, to.end);
  return begin < end && (end - begin > 1 || is_even(begin));
}

// Sums over all slabs, which only rise: if they exceed a bound does not depend on their order.
struct Held {
  std::atomic<std::size_t> starts = 0;  // of regions
  std::atomic<std::size_t> bytes = 0;   // of runs that are kept for the slabs beside

  bool is_too_much() const { return starts > kMostRegionStarts || bytes > kMostRunBytes; }
};

// The regions of a slab of planes, or of several that follow each other.
class Regions {
 public:
  Regions(const SignRows& rows, std::span<const Scheme> schemes)
      : rows_(rows), schemes_(schemes), lattices_(schemes.size()) {}

  // Sweeps the planes [begin, end), and the one behind them, which is not counted. Adds what it
  // holds to that of all slabs, and ends early if that is too much.
  void sweep(std::uint32_t begin, std::uint32_t end, Held& held) {
    const std::uint32_t last = std::min(end, rows_.dims.z - 1);
    for (std::uint32_t z = begin; z <= last && !held.is_too_much(); ++z) {
      const std::size_t before = samples_.size();
      add_plane(z, z < end);
      if (z > begin && bcc()) add_centres(z - 1);
      if (z == begin) first_ = now_;
      if (z == begin + 1) first_centres_ = centres_;
      if (z < end) held.starts += samples_.size() - before;
    }
    before_ = {};
    signs_ = {};
    signs_before_ = {};
    for (Plane* plane : {&first_, &first_centres_, &now_, &centres_}) {
      plane->shrink_to_fit();
      held.bytes += plane->bytes();
    }
  }

  // Adds the slab behind this one, whose first plane is this one's last.
  void append(Regions& next) {
    const auto offset = static_cast<Node>(samples_.size());
    faces_.append(next.faces_);
    for (std::size_t n = 0; n < lattices_.size(); ++n) lattices_[n].append(next.lattices_[n]);
    samples_.insert(samples_.end(), next.samples_.begin(), next.samples_.end());
    at_border_.insert(at_border_.end(), next.at_border_.begin(), next.at_border_.end());
    for (Plane* plane : {&next.first_, &next.first_centres_, &next.now_, &next.centres_}) {
      for (Run& run : plane->runs) run.node += offset;
    }
    for (std::size_t n = 0; n < next.first_.runs.size(); ++n) {
      join_all(now_.runs[n].node, next.first_.runs[n].node);
    }
    join_centres(centres_, next.first_centres_);
    now_ = std::move(next.now_);
    centres_ = std::move(next.centres_);
  }

  CavityCount count() {
    struct Region {
      std::uint64_t samples = 0;
      bool is_at_border = false;
    };
    const std::size_t nodes = samples_.size();
    std::vector<Region> regions(nodes);
    for (Node node = 0; node < nodes; ++node) {
      Region& region = regions[faces_.find(node)];
      region.samples += samples_[node];
      region.is_at_border |= at_border_[node] != 0;
    }
    const auto is_cavity = [&](Node node) {
      return regions[node].samples >= kLeastCavity && !regions[node].is_at_border;
    };
    CavityCount count;
    for (Node node = 0; node < nodes; ++node) count.cavities += is_cavity(node) ? 1 : 0;
    for (Sets& sets : lattices_) {
      std::vector<std::uint8_t> is_open(nodes, 0);
      for (Node node = 0; node < nodes; ++node) is_open[sets.find(node)] |= at_border_[node];
      CavityCount::Open& open = count.open.emplace_back();
      for (Node node = 0; node < nodes; ++node) {
        if (!is_cavity(node) || is_open[sets.find(node)] == 0) continue;
        ++open.cavities;
        open.samples += regions[node].samples;
      }
    }
    return count;
  }

 private:
  // The sets of the body-centred lattice; null if it is not asked for.
  Sets* bcc() {
    const auto found = std::ranges::find(schemes_, Scheme::kBcc);
    return found == schemes_.end() ? nullptr : &lattices_[found - schemes_.begin()];
  }

  void join_all(Node a, Node b) {
    if (a == b) return;
    faces_.join(a, b);
    for (Sets& sets : lattices_) sets.join(a, b);
  }

  std::size_t words() const { return (rows_.dims.x + kWordBits - 1) / kWordBits; }

  void add_plane(std::uint32_t z, bool is_counted) {
    const Dims& dims = rows_.dims;
    before_ = std::exchange(now_, {});
    signs_before_ = std::exchange(signs_, std::vector<Word>(words() * dims.y));
    for (std::uint32_t y = 0; y < dims.y; ++y) {
      const auto signs = std::span(signs_).subspan(y * words(), words());
      rows_.classify(y, z, signs.data());
      now_.add_row(signs, dims.x);
      const std::span<Run> runs = now_.row(y);
      for (const RowStep& step : kRowSteps) {
        if (step.is_of_faces()) join_faces(row_before(y, step), runs);
      }
      const bool is_at_border = y == 0 || z == 0 || y + 1 == dims.y || z + 1 == dims.z;
      for (Run& run : runs) {
        if (run.node == kNone) run.node = add_node();
        if (is_counted) samples_[run.node] += run.end - run.begin;
        if (is_at_border || run.begin == 0 || run.end == dims.x) at_border_[run.node] = 1;
      }
      for (const RowStep& step : kRowSteps) join_diagonals(step, y, z);
    }
  }

  std::span<Run> row_before(std::uint32_t y, const RowStep& step) {
    Plane& plane = step.z == 0 ? now_ : before_;
    return plane.row(static_cast<std::size_t>(std::int64_t{y} - step.y));
  }

  Node add_node() {
    faces_.add();
    for (Sets& sets : lattices_) sets.add();
    samples_.push_back(0);
    at_border_.push_back(0);
    return static_cast<Node>(samples_.size() - 1);
  }

  void join_faces(std::span<Run> before, std::span<Run> runs) {
    visit_near(before, runs, [&](const Run& from, Run& to) {
      if (!overlap(from, to)) return;
      // The smallest of its set, so that runs side by side mostly have the same.
      if (to.node == kNone) to.node = faces_.find(from.node);
      join_all(from.node, to.node);
    });
  }

  void join_diagonals(const RowStep& step, std::uint32_t y, std::uint32_t z) {
    const auto parity = static_cast<unsigned>(std::int64_t{y} - step.y + z - step.z) + rows_.parity;
    visit_near(row_before(y, step), now_.row(y), [&](const Run& from, const Run& to) {
      if (from.node == to.node) return;
      for (std::size_t n = 0; n < schemes_.size(); ++n) {
        if (joins(schemes_[n], from, to, step, parity)) lattices_[n].join(from.node, to.node);
      }
    });
  }

  // Adds the centres of the cells that begin in plane z, the one before the present plane.
  void add_centres(std::uint32_t z) {
    Plane below = std::exchange(centres_, {});
    std::vector<Word> inside(words());
    std::vector<Word> uncertain(words());
    for (std::uint32_t y = 0; y + 1 < rows_.dims.y; ++y) {
      const std::size_t first = y * words();
      for (std::size_t w = 0; w < words(); ++w) {
        Word any = 0;
        Word all = ~Word{0};
        for (const std::vector<Word>* signs : {&signs_before_, &signs_}) {
          for (const std::size_t row : {first, first + words()}) {
            const Word own = (*signs)[row + w];
            const Word next = w + 1 < words() ? (*signs)[row + w + 1] : 0;
            const Word right = own >> 1 | next << (kWordBits - 1);
            any |= own | right;
            all &= own & right;
          }
        }
        inside[w] = all;
        uncertain[w] = any & ~all;
      }
      // The last sample of a row begins no cell.
      const std::uint32_t cells = rows_.dims.x - 1;
      if (cells % kWordBits != 0)
        uncertain[cells / kWordBits] &= (Word{1} << cells % kWordBits) - 1;
      else if (cells / kWordBits < words())
        uncertain[cells / kWordBits] = 0;
      rows_.add_centres(y, z, uncertain, inside.data());
      centres_.add_row(inside, cells);
      for (Run& run : centres_.row(y)) join_corners(run, y);
      join_rows(centres_.row(y - std::size_t{1}), centres_.row(y));
    }
    join_centres(below, centres_);
  }

  // A centre outside has a corner outside, which gives its run a node.
  void join_corners(Run& centres, std::uint32_t y) {
    const std::span<Run> one(&centres, 1);
    for (Plane* plane : {&before_, &now_}) {
      for (const std::uint32_t row : {y, y + 1}) {
        const std::span<Run> samples = plane->row(row);
        const auto first = std::ranges::lower_bound(samples, centres.begin + 1, {}, &Run::end);
        visit_near(samples.subspan(first - samples.begin()), one, [&](const Run& corner, Run& run) {
          if (!touch(run, corner)) return;
          if (run.node == kNone) run.node = corner.node;
          bcc()->join(run.node, corner.node);
        });
      }
    }
  }

  void join_rows(std::span<Run> before, std::span<Run> runs) {
    visit_near(before, runs, [&](const Run& from, const Run& to) {
      if (overlap(from, to)) bcc()->join(from.node, to.node);
    });
  }

  void join_centres(Plane& before, Plane& plane) {
    for (std::size_t y = 0; y < plane.ends.size(); ++y) join_rows(before.row(y), plane.row(y));
  }

  const SignRows& rows_;
  const std::span<const Scheme> schemes_;
  Sets faces_;
  std::vector<Sets> lattices_;           // of each scheme
  std::vector<std::uint64_t> samples_;   // of each node
  std::vector<std::uint8_t> at_border_;  // of each node: 1 if it has a sample on the border
  Plane first_;                          // of the slab
  Plane first_centres_;
  Plane before_;
  Plane now_;      // in the end, the plane that the next slab begins with
  Plane centres_;  // between the two
  std::vector<Word> signs_before_;
  std::vector<Word> signs_;
};

}  // namespace

CavityCount count_cavities(const SignRows& rows, std::span<const Scheme> schemes,
                           const Context& context) {
  CavityCount none = {.open = std::vector<CavityCount::Open>(schemes.size())};
  if (!rows.classify || !rows.dims.has_cells()) return none;
  const std::size_t slabs = chunks_of(rows.dims.z, kSlabPlanes);
  std::vector<std::optional<Regions>> parts(slabs);
  Held held;
  parallel_for(context, slabs, [&](std::size_t slab) {
    const auto begin = static_cast<std::uint32_t>(slab) * kSlabPlanes;
    const std::uint32_t end = std::min(begin + kSlabPlanes, rows.dims.z);
    parts[slab].emplace(rows, schemes).sweep(begin, end, held);
  });
  context.throw_if_stopped();
  if (held.is_too_much()) return none;
  Regions& whole = *parts.front();
  for (std::size_t slab = 1; slab < slabs; ++slab) {
    whole.append(*parts[slab]);
    parts[slab].reset();
  }
  return whole.count();
}

std::uint64_t cavity_search_memory(const CavitySearches& searches) {
  constexpr std::uint64_t kGrown = 2;       // arrays have room to grow
  constexpr std::uint64_t kKeptPlanes = 4;  // of a slab, those of centres included
  const Dims& dims = searches.dims;
  const std::uint64_t rows = dims.y;
  const std::uint64_t most_runs = rows * (dims.x / 2 + 1);
  const auto bytes = [&](std::uint64_t planes, std::uint64_t vertices) {
    // A row has a run more than pairs of vertices.
    const std::uint64_t runs = std::min(planes * most_runs, planes * rows + vertices);
    return planes * rows * sizeof(std::size_t) + runs * sizeof(Run);
  };

  const std::uint64_t signs = kGrown * rows * chunks_of(dims.x, kWordBits) * sizeof(Word);
  const std::uint64_t of_threads =
      static_cast<std::uint64_t>(thread_count()) *
      (kGrown * bytes(kCavityPlanes, kCavityPlanes * searches.vertices_at_work) + signs);

  // The planes that two slabs share are kept twice.
  const std::uint64_t planes = searches.at_once * kKeptPlanes * chunks_of(dims.z, kSlabPlanes);
  const std::uint64_t kept = bytes(planes, kKeptPlanes * searches.vertices);

  // A node takes this, and that while they are counted. A start of a region has two vertices.
  const std::uint64_t node = sizeof(Node) * (1 + searches.schemes) + sizeof(std::uint64_t) + 1;
  constexpr std::uint64_t kCounted = 2 * sizeof(std::uint64_t) + 1;
  const std::uint64_t nodes =
      std::min<std::uint64_t>(searches.at_once * kMostRegionStarts, planes + searches.vertices);
  return of_threads + std::min<std::uint64_t>(kept, searches.at_once * kMostRunBytes) +
         nodes * (kGrown * node + sizeof(std::uint64_t) + kCounted);
}

template <class T>
bool is_mask(const Lattice<T>& lattice, const Context& context) {
  const std::span all(lattice.samples, lattice.dims.samples());
  if (all.empty()) return false;
  const T one = all.front();
  const auto found = std::ranges::find_if(all, [one](T sample) { return sample != one; });
  if (found == all.end()) return false;
  const T other = *found;
  std::atomic<bool> has_third = false;
  for_chunks(context, all.size(), [&](std::size_t begin, std::size_t end) {
    if (has_third) return;
    bool has_two = true;  // without a branch, so that the compiler compares several at once
    for (const T sample : all.subspan(begin, end - begin)) {
      has_two &= (sample == one) | (sample == other);
    }
    if (!has_two) has_third = true;
  });
  return !has_third;
}

#define ISOMESH_INSTANTIATE(T, name, kType) \
  template bool is_mask(const Lattice<T>&, const Context&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
