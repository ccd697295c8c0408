#include "server/mesh/stairs/missing_volume.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "server/mesh/extract/links.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

// A tetrahedron around a sample: the directions to its other corners, and in voxels how large it is
// and how much of the sample's voxel it has.
struct CornerShare {
  Directions others = 0;
  float volume = 0;
  float share = 0;
};

// The tetrahedra of one cell share the eighth of the voxel in it, so the shares are right in the
// outermost cells, too. Of Kuhn's six, all have the ends of the cell's long diagonal, and two each
// of the other corners. Of the five, one has a corner whose edges are the cell's own.
CornerShare share_of(Scheme scheme, const Links& links, Directions others) {
  std::array<int, 4> edges = {};  // by the number of axes that they are along
  for (Directions rest = others; rest != 0; rest &= rest - 1) {
    const auto& step = links.directions()[static_cast<std::size_t>(std::countr_zero(rest))].step;
    ++edges[3 - static_cast<std::size_t>(std::ranges::count(step, 0))];
  }
  if (scheme != Scheme::kFive) return {others, 1 / 6.F, edges[3] == 1 ? 1 / 48.F : 1 / 16.F};
  if (edges[1] == 0) return {others, 1 / 3.F, 1 / 12.F};
  return {others, 1 / 6.F, edges[1] == 3 ? 1 / 8.F : 1 / 72.F};
}

// Finds out what walls owe samples, in voxels.
class VoxelShares {
 public:
  VoxelShares(const SampleParts& parts, Scheme scheme, bool closed)
      : parts_(parts), scheme_(scheme), links_(links_of(scheme)), closed_(closed) {
    for (unsigned parity = 0; parity < 2; ++parity) {
      for (const auto& triangles : {links_.above(parity), links_.below(parity)}) {
        for (const Directions others : triangles) {
          corners_[parity].push_back(share_of(scheme, links_, others));
        }
      }
    }
    if (scheme != Scheme::kSix) return;
    whole_.resize(std::size_t{1} << links_.directions().size());
    for (std::size_t set = 0; set < whole_.size(); ++set) {
      whole_[set] = sum_of(corners_[0], static_cast<Directions>(set));
    }
  }

  // Where the owner is, by axis.
  std::array<std::uint64_t, 3> index(const VertexOwner& owner) const {
    const Dims& dims = parts_.dims();
    const std::uint64_t row = owner.sample / dims.x;
    return {owner.sample - row * dims.x, row % dims.y, row / dims.y};
  }

  // All that such a sample is owed by the wall around it, for its crossings in some directions.
  float of_whole(const VertexOwner& owner) const {
    const auto directions = static_cast<Directions>(owner.directions);
    return whole_.empty() ? sum_of(around(owner), directions) : whole_[directions];
  }

  // Calls give(fan, voxels) for those fans of a vertex whose walls owe its owner something.
  template <class Give>
  void visit(const VertexOwner& owner, std::size_t v, const WallFans& fans, Give give) const {
    if (owner.directions == 0) return;
    const PartNumber own = parts_.part(owner.sample);
    std::array<PartNumber, kMostDirections> labels;
    const Directions outside = look_around(owner, labels);
    for (std::size_t fan = fans.begin(v); fan < fans.begin(v + 1); ++fan) {
      const auto& [sides, is_cap] = fans.wall(fan);
      if (is_cap || sides.back != own) continue;
      give(fan, owed(owner, own, sides.front, labels, outside));
    }
  }

 private:
  static float sum_of(std::span<const CornerShare> corners, Directions directions) {
    float sum = 0;
    for (const CornerShare& corner : corners) {
      sum += (corner.others & directions) != 0 ? corner.share : 0;
    }
    return sum;
  }

  std::span<const CornerShare> around(const VertexOwner& owner) const {
    if (scheme_ == Scheme::kSix) return corners_[0];  // alike around each sample
    const auto [x, y, z] = index(owner);
    return corners_[(x + y + z) & 1];
  }

  // The labels of the owner's neighbours. Returns the directions that lead out of the volume, where
  // phantoms are background.
  Directions look_around(const VertexOwner& owner, std::span<PartNumber> labels) const {
    const Dims& dims = parts_.dims();
    const auto index_of_owner = index(owner);
    const std::array<std::uint64_t, 3> samples = {dims.x, dims.y, dims.z};
    Directions outside = 0;
    for (std::size_t d = 0; d < links_.directions().size(); ++d) {
      std::uint64_t sample = 0;
      bool is_inside = true;
      for (std::size_t axis = 3; axis-- > 0;) {
        const std::int64_t step = links_.directions()[d].step[axis];
        const std::uint64_t to = index_of_owner[axis] + static_cast<std::uint64_t>(step);
        is_inside = is_inside && to < samples[axis];  // -1 wraps around
        sample = sample * samples[axis] + to;
      }
      labels[d] = is_inside ? parts_.part(sample) : 0;
      if (!is_inside) outside |= Directions{1} << d;
    }
    return outside;
  }

  // What the wall between the owner and `front` owes for the tetrahedra that it is in.
  float owed(const VertexOwner& owner, PartNumber own, PartNumber front,
             std::span<const PartNumber> labels, Directions outside) const {
    float sum = 0;
    for (const CornerShare& corner : around(owner)) {
      Directions all = 0;
      for (Directions rest = corner.others; rest != 0; rest &= rest - 1) {
        if (labels[first_of(rest)] == front) all |= rest & (~rest + 1);
      }
      const Directions here = all & static_cast<Directions>(owner.directions);
      if (here == 0 || (!closed_ && (corner.others & outside) != 0)) continue;
      // It is divided among the crossings to the corners in front.
      const float part = here == all ? 1
                                     : static_cast<float>(std::popcount(here)) /
                                           static_cast<float>(std::popcount(all));
      sum += part * owed_in(corner, own, front, labels);
    }
    return sum;
  }

  // The smallest label owes the corner its share. With three labels, the wall between the other two
  // sweeps a part of the tetrahedron, too, from the corners of the larger to where it is; so much
  // goes to that label by way of the middle one.
  static float owed_in(const CornerShare& corner, PartNumber own, PartNumber front,
                       std::span<const PartNumber> labels) {
    int in_front = 0;
    int of_own = 1;
    int others = 0;
    PartNumber third = 0;
    for (Directions rest = corner.others; rest != 0; rest &= rest - 1) {
      const PartNumber label = labels[first_of(rest)];
      if (label == front) {
        ++in_front;
      } else if (label == own) {
        ++of_own;
      } else if (others++ == 0) {
        third = label;
      } else if (third != label) {  // four labels
        return std::min(third, label) < front ? 0 : corner.share;
      }
    }
    if (others == 0) return corner.share;
    // Thirty-sixths of the tetrahedron, by which of the three has two corners.
    constexpr float kSmallest = 2;
    constexpr float kMiddle = 5;
    constexpr float kLargest = 11;
    const bool is_third_least = third < front;
    const int of_least = is_third_least ? others : in_front;
    const int of_middle = is_third_least ? in_front : third < own ? others : of_own;
    const float swept = (of_least == 2    ? kSmallest
                         : of_middle == 2 ? kMiddle
                                          : kLargest) /
                        36 * corner.volume / static_cast<float>(of_own);
    if (is_third_least) return swept;
    return third < own ? corner.share - swept : corner.share + swept;
  }

  static std::size_t first_of(Directions set) {
    return static_cast<std::size_t>(std::countr_zero(set));
  }

  const SampleParts& parts_;
  const Scheme scheme_;
  const Links& links_;
  const bool closed_;
  std::array<std::vector<CornerShare>, 2> corners_;  // by parity
  std::vector<float> whole_;  // by set of directions, where all samples are alike
};

// The volume that a fan's part of its triangles sweeps between two places of their vertices: the
// vertex's way times a third of the area vector, in the mean over the way.
float swept(const WallFans& fans, std::size_t fan, const Buffer<Lanes>& from,
            const Buffer<Lanes>& to) {
  struct Ways {
    Lanes from;
    Lanes to;
  };
  const std::uint32_t v = fans.vertex(fan);
  const Ways own = {from[v], to[v]};
  Lanes area = {};  // times 12
  fans.visit_triangles(
      fan,
      [&](std::uint32_t each) {
        return Ways{from[each] - own.from, to[each] - own.to};
      },
      [&](const Ways& a, const Ways& b) {
        area += twisted_cross(a.from, b.from) + twisted_cross(a.to, b.to) +
                twisted_cross(a.from + a.to, b.from + b.to);
      });
  return dot(own.to - own.from, rotated(area)) / 36;
}

}  // namespace

Buffer<float> missing_volume(const SampleParts& parts, Scheme scheme,
                             const SeparatingSurface& surface, const WallShape& shape,
                             const Context& context) {
  const VoxelShares shares(parts, scheme, shape.is_closed());
  const WallFans& fans = shape.fans();
  const Buffer<VertexOwner>& owners = surface.owners;
  const Lanes spacing = shape.spacing();
  const float voxel = std::abs(spacing[0] * spacing[1] * spacing[2]);
  Buffer<Lanes> places;  // of the owners
  places.resize_for_overwrite(shape.vertices());
  for_each(context, shape.vertices(), [&](std::size_t v) {
    const auto [x, y, z] = shares.index(owners[v]);
    places[v] =
        Lanes{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z), 0} * spacing;
  });
  Buffer<float> missing;
  missing.resize_for_overwrite(fans.size());
  for_each(context, shape.vertices(), [&](std::size_t v) {
    const std::size_t first = fans.begin(v);
    const std::size_t count = fans.begin(v + 1) - first;
    for (std::size_t fan = first; fan < first + count; ++fan) {
      missing[fan] = -swept(fans, fan, places, shape.start());
    }
    if (owners[v].is_whole != 0 && count == 1) {
      missing[first] += voxel * shares.of_whole(owners[v]);
      return;
    }
    shares.visit(owners[v], v, fans,
                 [&](std::size_t fan, float voxels) { missing[fan] += voxel * voxels; });
    for (std::size_t fan = first; fan < first + count; ++fan) {
      if (!fans.wall(fan).is_cap) continue;
      const std::uint32_t leaving = fans.find(v, {fans.wall(fan).sides, false});
      const float rest = std::exchange(missing[fan], 0.0F);
      if (leaving != WallFans::kNone) missing[leaving] += rest;
    }
  });
  return missing;
}

}  // namespace isomesh::mesh
