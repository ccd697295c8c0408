#include "server/mesh/collapse/patches.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
namespace {

constexpr float kNearSeam = 0.12F;  // of a cube's side

// Each cube's triangles in their order, and last those that no cube takes.
struct Cubes {
  std::vector<std::size_t> begin;
  std::vector<std::uint32_t> members;

  std::size_t size() const { return begin.size() - 1; }
  std::span<const std::uint32_t> of(std::size_t cube) const {
    return std::span(members).subspan(begin[cube], begin[cube + 1] - begin[cube]);
  }
};

class Cutter {
 public:
  Cutter(Vecf size, const CubeCut& cut)
      : cut_(cut), counts_{along(size.x), along(size.y), along(size.z)} {}

  // The last one is for those of no cube.
  std::size_t count() const { return counts_[0] * counts_[1] * counts_[2] + 1; }

  std::uint32_t cube_at(Vecf sum_of_corners) const {
    const Vecf middle = sum_of_corners * (1 / (3 * cut_.side));
    const auto is_near = [](float x) { return std::abs(x - std::round(x)) < kNearSeam; };
    const std::size_t rest = count() - 1;
    if (cut_.is_for_seams && !is_near(middle.x) && !is_near(middle.y) && !is_near(middle.z)) {
      return static_cast<std::uint32_t>(rest);
    }
    const float shift = cut_.is_shifted ? 0.5F : 0;
    const auto cell = [&](float x) { return static_cast<std::size_t>(std::max(0.0F, x + shift)); };
    const std::size_t cube =
        cell(middle.x) + counts_[0] * (cell(middle.y) + counts_[1] * cell(middle.z));
    return static_cast<std::uint32_t>(std::min(cube, rest));
  }

 private:
  std::size_t along(float size) const { return static_cast<std::size_t>(size / cut_.side) + 2; }

  const CubeCut cut_;
  const std::array<std::size_t, 3> counts_;
};

// The numbers of the vertices of some triangles in their order.
class Ranks {
 public:
  // Appends the vertices to `names`.
  Ranks(std::span<const Triangle> triangles, std::span<const std::uint32_t> members,
        std::vector<std::uint32_t>& names) {
    std::uint32_t last = 0;
    for (const std::size_t t : members) {
      const auto [low, high] = std::ranges::minmax(triangles[t]);
      first_ = std::min(first_, low);
      last = std::max(last, high);
    }
    words_.resize((last - first_) / 64 + 1);
    for (const std::size_t t : members) {
      for (const std::uint32_t v : triangles[t]) {
        words_[(v - first_) / 64].set |= std::uint64_t{1} << ((v - first_) % 64);
      }
    }
    for (std::size_t w = 0; w < words_.size(); ++w) {
      words_[w].before = static_cast<std::uint32_t>(names.size());
      for (std::uint64_t rest = words_[w].set; rest != 0; rest &= rest - 1) {
        names.push_back(first_ + static_cast<std::uint32_t>(64 * w) +
                        static_cast<std::uint32_t>(std::countr_zero(rest)));
      }
    }
  }

  std::uint32_t of(std::uint32_t vertex) const {
    const auto& [set, before] = words_[(vertex - first_) / 64];
    const std::uint64_t lower = (std::uint64_t{1} << ((vertex - first_) % 64)) - 1;
    return before + static_cast<std::uint32_t>(std::popcount(set & lower));
  }

 private:
  struct Word {
    std::uint64_t set = 0;
    std::uint32_t before = 0;  // how many are set in earlier words
  };

  std::uint32_t first_ = ~std::uint32_t{0};
  std::vector<Word> words_;
};

Cubes cut_cubes(std::span<const Triangle> triangles,
                const std::function<Vecf(std::uint32_t)>& place, const Cutter& cutter,
                const Context& context) {
  const std::size_t count = triangles.size();
  // Fewer and larger chunks than elsewhere: each counts the members of all cubes.
  const std::size_t chunks = std::min<std::size_t>(64, chunks_of(count));
  const auto first_of = [&](std::size_t chunk) { return count * chunk / chunks; };
  std::vector<std::uint32_t> cube(count);
  std::vector<std::vector<std::size_t>> next(chunks);
  parallel_for(context, chunks, [&](std::size_t chunk) {
    next[chunk].assign(cutter.count(), 0);
    for (std::size_t t = first_of(chunk); t < first_of(chunk + 1); ++t) {
      const auto& [a, b, c] = triangles[t];
      cube[t] = cutter.cube_at(place(a) + place(b) + place(c));
      ++next[chunk][cube[t]];
    }
  });
  Cubes cubes{std::vector<std::size_t>(cutter.count() + 1, 0), std::vector<std::uint32_t>(count)};
  std::size_t sum = 0;
  for (std::size_t k = 0; k < cutter.count(); ++k) {
    for (auto& of_chunk : next) sum += std::exchange(of_chunk[k], sum);
    cubes.begin[k + 1] = sum;
  }
  parallel_for(context, chunks, [&](std::size_t chunk) {
    for (std::size_t t = first_of(chunk); t < first_of(chunk + 1); ++t) {
      cubes.members[next[chunk][cube[t]]++] = static_cast<std::uint32_t>(t);
    }
  });
  return cubes;
}

}  // namespace

void Patches::collapse(const CubeCut& cut, const Context& context,
                       const std::function<void(Patch&)>& collapse) {
  const Context quiet = {context.stop, nullptr};
  const Cubes cubes = cut_cubes(triangles_, place_, Cutter(size_, cut), quiet);
  std::vector<Result> results(cubes.size());
  parallel_for(context, cubes.size(), [&](std::size_t cube) {
    Result& result = results[cube];
    const auto members = cubes.of(cube);
    if (cube + 1 == cubes.size()) {
      for (const std::size_t t : members) {
        result.triangles.push_back(triangles_[t]);
        if (!numbers_.empty()) result.numbers.push_back(numbers_[t]);
      }
      return;
    }
    if (members.empty()) return;
    Patch patch = patch_of(members, cut.is_for_seams);
    collapse(patch);
    result.triangles.reserve(patch.triangles.size());
    for (const auto& [a, b, c] : patch.triangles) {
      result.triangles.push_back({patch.names[a], patch.names[b], patch.names[c]});
    }
    result.numbers = std::move(patch.numbers);
    for (std::size_t v = 0; v < patch.names.size(); ++v) {
      if (patch.stays[v] != 0) result.seams.push_back(patch.names[v]);
    }
  });
  take(results, quiet);
}

Patch Patches::patch_of(std::span<const std::uint32_t> members, bool is_for_seams) const {
  Patch patch;
  const Ranks ranks(triangles_, members, patch.names);
  patch.triangles.reserve(members.size());
  for (const std::size_t t : members) {
    const auto& [a, b, c] = triangles_[t];
    patch.triangles.push_back({ranks.of(a), ranks.of(b), ranks.of(c)});
    if (!numbers_.empty()) patch.numbers.push_back(numbers_[t]);
  }
  patch.stays.assign(patch.names.size(), 0);
  patch.first.assign(patch.names.size(), is_for_seams ? 0 : 1);
  for (const auto& [a, b, c] : patch.triangles) {
    const auto is_seam = [&](std::uint32_t v) { return is_seam_[patch.names[v]] != 0; };
    if (is_seam(a) || is_seam(b) || is_seam(c))
      patch.first[a] = patch.first[b] = patch.first[c] = 1;
  }
  return patch;
}

void Patches::take(const std::vector<Result>& results, const Context& context) {
  std::vector<std::size_t> begin = {0};
  for (const Result& result : results) begin.push_back(begin.back() + result.triangles.size());
  triangles_.resize(begin.back());
  if (!numbers_.empty()) numbers_.resize(begin.back());
  parallel_for(context, results.size(), [&](std::size_t k) {
    const auto at = static_cast<std::ptrdiff_t>(begin[k]);
    std::ranges::copy(results[k].triangles, triangles_.begin() + at);
    if (!numbers_.empty()) std::ranges::copy(results[k].numbers, numbers_.begin() + at);
  });
  for (const Result& result : results) {
    for (const std::uint32_t v : result.seams) is_seam_[v] = 1;
  }
}

}  // namespace isomesh::mesh::collapse
