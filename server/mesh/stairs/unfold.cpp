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

WallNormals normals_of(const WallShape& shape, const Context& context) {
  const WallFans& fans = shape.fans();
  WallNormals normals;
  normals.own.resize_for_overwrite(fans.size());
  normals.near.resize_for_overwrite(fans.size());
  for_each(context, fans.size(), [&](std::size_t fan) {
    Lanes sum = {};
    for (const Spoke& spoke : fans.spokes(fan)) sum += shape.normal(fans.vertex(fan), spoke);
    normals.own[fan] = sum;
  });
  for_each(context, fans.size(), [&](std::size_t fan) {
    Lanes sum = normals.own[fan];
    fans.neighbors().visit(fan, [&](std::uint32_t each) { sum += normals.own[each]; });
    normals.near[fan] = sum;
  });
  return normals;
}

Lanes normal_of(const WallShape& shape, const std::array<std::uint32_t, 3>& corners) {
  return cross(shape.at[corners[1]] - shape.at[corners[0]],
               shape.at[corners[2]] - shape.at[corners[0]]);
}

// True if the cosine of the angle between two vectors is less than `cosine`.
bool is_less(Lanes a, Lanes b, float cosine) { return dot(a, b) < cosine * length(a) * length(b); }

// The triangles that may be folded: those that lie away from their corners' own normals.
std::vector<Suspect> find_suspects(const WallShape& shape, const Context& context) {
  constexpr float kSuspect = 0.7F;
  const WallNormals normals = normals_of(shape, context);
  const WallFans& fans = shape.fans();
  std::vector<std::vector<Suspect>> found(chunks_of(shape.vertices()));
  for_each(context, shape.vertices(), [&](std::size_t v) {
    shape.visit_spokes(v, [&](std::size_t fan, const Spoke& spoke) {
      // Each triangle once, at its first corner.
      if (spoke.next < v || spoke.previous < v) return;
      const std::array corners = {static_cast<std::uint32_t>(v), spoke.next, spoke.previous};
      const Wall& wall = fans.wall(fan);
      const std::array own = {static_cast<std::uint32_t>(fan), fans.find(spoke.next, wall),
                              fans.find(spoke.previous, wall)};
      Lanes near = {};
      for (const std::uint32_t each : own) near += normals.own[each];
      if (!is_less(normal_of(shape, corners), near, kSuspect)) return;
      Lanes wide = {};
      for (const std::uint32_t each : own) {  // of all within two edges
        wide += normals.near[each];
        fans.neighbors().visit(each, [&](std::uint32_t next) { wide += normals.near[next]; });
      }
      found[v / kChunk].push_back({corners, wide});
    });
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
