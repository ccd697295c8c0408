#include "server/mesh/stairs/unfold.h"

#include <algorithm>
#include <array>
#include <vector>

namespace isomesh::mesh {
namespace {

struct Suspect {
  std::array<std::uint32_t, 3> corners = {};
  Lanes wall_normal = {};
};

// By fan, the normals of a wall around its vertices.
struct WallNormals {
  Buffer<Lanes> own;
  Buffer<Lanes> near;  // its own and its neighbours'
};

Lanes normal_of(const WallShape& shape, const std::array<std::uint32_t, 3>& corners) {
  return cross(shape.at[corners[1]] - shape.at[corners[0]],
               shape.at[corners[2]] - shape.at[corners[0]]);
}

// True if the cosine of the angle between two vectors is less than `cosine`, which is not negative.
bool is_less(Lanes a, Lanes b, float cosine) {
  const float product = dot(a, b);
  return product < 0 || product * product < cosine * cosine * dot(a, a) * dot(b, b);
}

// A triangle that lies away from the normal of a fan that it is in, and its other two corners.
struct Candidate {
  std::uint32_t fan = 0;
  std::uint32_t next = 0;
  std::uint32_t previous = 0;
};

// If the triangle is away from the sum of its corners' own normals, it is away from one of them.
constexpr float kSuspect = 0.7F;

// Also lists the candidates, by chunk of fans.
WallNormals normals_of(const WallShape& shape, const Context& context,
                       std::vector<std::vector<Candidate>>& candidates) {
  const WallFans& fans = shape.fans();
  WallNormals normals;
  normals.own.resize_for_overwrite(fans.size());
  normals.near.resize_for_overwrite(fans.size());
  candidates.resize(chunks_of(fans.size()));
  for_chunks(context, fans.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<Lanes> each;  // of a fan's triangles
    for (std::size_t fan = begin; fan < end; ++fan) {
      each.clear();
      const Lanes sum = shape.visit_normals(fan, [&](Lanes normal) { each.push_back(normal); });
      normals.own[fan] = rotated(sum);
      if (std::ranges::none_of(each, [&](Lanes own) { return is_less(own, sum, kSuspect); }))
        continue;
      auto normal = each.begin();
      fans.visit_triangles(fan, std::identity(), [&](std::uint32_t a, std::uint32_t b) {
        if (!is_less(*normal++, sum, kSuspect)) return;
        candidates[begin / kChunk].push_back({static_cast<std::uint32_t>(fan), a, b});
      });
    }
  });
  for_each(context, fans.size(), [&](std::size_t fan) {
    Lanes sum = normals.own[fan];
    fans.neighbors().visit(fan, [&](std::uint32_t each) { sum += normals.own[each]; });
    normals.near[fan] = sum;
  });
  return normals;
}

// The triangles that may be folded: those that lie away from their corners' own normals.
std::vector<Suspect> find_suspects(const WallShape& shape, const Context& context) {
  std::vector<std::vector<Candidate>> candidates;
  const WallNormals normals = normals_of(shape, context, candidates);
  const WallFans& fans = shape.fans();
  std::vector<std::vector<Suspect>> found(candidates.size());
  const auto look_at = [&](const Candidate& candidate, std::vector<Suspect>& suspects) {
    const auto& [fan, next, previous] = candidate;
    const std::uint32_t v = fans.vertex(fan);
    const Wall& wall = fans.wall(fan);
    const std::array corners = {v, next, previous};
    const std::array own = {fan, fans.find(next, wall), fans.find(previous, wall)};
    const Lanes normal = normal_of(shape, corners);
    Lanes near = {};
    for (std::size_t i = 0; i < 3; ++i) {
      near += normals.own[own[i]];
      // Each triangle once, at the first of the corners that it is a candidate of.
      const bool is_before = corners[i] < v;
      if (is_before && is_less(normal, normals.own[own[i]], kSuspect)) return;
    }
    if (!is_less(normal, near, kSuspect)) return;
    Lanes wide = {};
    for (const std::uint32_t each : own) {  // of all within two edges
      wide += normals.near[each];
      fans.neighbors().visit(each, [&](std::uint32_t other) { wide += normals.near[other]; });
    }
    suspects.push_back({corners, wide});
  };
  parallel_for(context, candidates.size(), [&](std::size_t chunk) {
    for (const Candidate& each : candidates[chunk]) look_at(each, found[chunk]);
  });
  std::vector<Suspect> all;
  for (const auto& part : found) all.insert(all.end(), part.begin(), part.end());
  return all;
}

}  // namespace

void unfold(const Context& context, WallShape& shape) {
  constexpr int kRounds = 6;  // to the mean, and then as many back
  constexpr float kFolded = 0.1F;
  const std::vector<Suspect> suspects = find_suspects(shape, context);
  std::vector<std::uint8_t> is_hit(shape.vertices(), 0);
  for (int round = 0; round < 2 * kRounds; ++round) {
    std::vector<std::uint32_t> hit;
    for (const Suspect& suspect : suspects) {
      if (!is_less(normal_of(shape, suspect.corners), suspect.wall_normal, kFolded)) continue;
      for (const std::uint32_t v : suspect.corners) {
        if (is_hit[v] != 0 || shape.neighbors().degree(v) <= (shape.is_curve(v) ? 1U : 0U))
          continue;
        is_hit[v] = 1;
        hit.push_back(v);
      }
    }
    if (hit.empty()) return;
    std::vector<Lanes> moved;
    for (const std::uint32_t v : hit) {
      const Lanes goal = round < kRounds ? shape.mean(v, shape.at) : shape.start()[v];
      moved.push_back(shape.at[v] + shape.kept(v, 0.5F * (goal - shape.at[v])));
    }
    for (std::size_t i = 0; i < hit.size(); ++i) {
      shape.at[hit[i]] = moved[i];
      is_hit[hit[i]] = 0;
    }
    context.throw_if_stopped();
  }
}

std::size_t count_folded(const WallShape& shape, const Context& context) {
  std::size_t count = 0;
  for (const Suspect& suspect : find_suspects(shape, context)) {
    if (is_less(normal_of(shape, suspect.corners), suspect.wall_normal, 0)) ++count;
  }
  return count;
}

}  // namespace isomesh::mesh
