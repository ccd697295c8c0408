#include "server/mesh/collapse/collapses.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "server/mesh/collapse/patches.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
namespace {

double area_of(const Tube& tube, const Context& context) {
  std::vector<double> areas(chunks_of(tube.triangles.size()), 0);
  for_each(context, tube.triangles.size(), [&](std::size_t t) {
    const auto& [a, b, c] = tube.triangles[t];
    const Vecf p = tube.vertices[a].p;
    areas[t / kChunk] +=
        0.5 * double{length(cross(tube.vertices[b].p - p, tube.vertices[c].p - p))};
  });
  return std::accumulate(areas.begin(), areas.end(), 0.0);
}

void collapse_patch(const CollapseSurroundings& around, double share, Patch& patch, Tube& tube) {
  Block block{patch, {}, {}};
  for (std::size_t v = 0; v < patch.names.size(); ++v) {
    const std::uint32_t name = patch.names[v];
    block.vertices.push_back(tube.vertices[name]);
    block.planes.push_back(tube.planes[name]);
    patch.stays[v] = tube.border[name];
  }
  const auto count = static_cast<double>(patch.triangles.size());
  collapse_block(around, static_cast<std::size_t>(share * count), block);
  for (std::size_t v = 0; v < patch.names.size(); ++v) {
    // No other block has it.
    if (patch.stays[v] == 0) tube.vertices[patch.names[v]] = block.vertices[v];
  }
}

}  // namespace

void collapse_edges(const CollapseSurroundings& around, std::uint64_t least, const Context& context,
                    Tube& tube) {
  if (tube.triangles.empty()) return;
  const double mean = area_of(tube, context) / static_cast<double>(tube.triangles.size());
  const auto side = static_cast<float>(std::max(std::sqrt(kBlockTriangles * mean), 1.0));
  const auto& [x, y, z] = around.field.dims;
  const Vecf size = {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
  std::vector<std::uint32_t> no_numbers;
  Patches patches(
      tube.triangles, no_numbers, tube.vertices.size(),
      [&](std::uint32_t v) { return tube.vertices[v].p; }, size);
  // The second time for what was at a seam the first time.
  for (const bool is_for_seams : {false, true}) {
    // Blocks give up equal shares.
    const double share = static_cast<double>(least) / static_cast<double>(tube.triangles.size());
    if (share >= 1) return;
    patches.collapse({side, is_for_seams, is_for_seams}, context,
                     [&](Patch& patch) { collapse_patch(around, share, patch, tube); });
  }
}

}  // namespace isomesh::mesh::collapse
