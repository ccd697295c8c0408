#include "server/mesh/collapse/clusters.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "proto/samples.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
namespace {

// The clusters around the samples of one plane of the field.
class PlaneClusters {
 public:
  PlaneClusters(const Field& field, const Crossings& crossings, std::uint32_t z)
      : field_(field),
        below_(field, crossings, z == 0 ? 0 : z - 1),
        own_(field, crossings, z),
        begin_(std::size_t{z} * field.dims.x * field.dims.y) {}

  // `before`: how many samples of a row, and rows, are before those of the layer.
  Clusters find(const ClusterLayer& layer, std::uint32_t before) const {
    Clusters clusters;
    const bool is_bcc = field_.scheme == Scheme::kBcc;
    const std::uint32_t kinds = is_bcc ? 2 : 1;
    for (std::uint32_t r = 0; r + 1 < layer.row_begin.size(); ++r) {
      const auto kind = static_cast<BccPoint>(r % kinds);
      const Links& links = is_bcc ? links_of(kind) : links_of(field_.scheme);
      const std::size_t row = begin_ + (r / kinds + before) * field_.dims.x + before;
      for (const JoiningWord& word : layer.row(r)) {
        visit_joining(layer, word, [&](unsigned bit, const Joined& joined) {
          add(links, joined.directions(), row + std::size_t{word.word} * 64 + bit, clusters);
        });
      }
    }
    return clusters;
  }

 private:
  void add(const Links& links, Directions left, std::size_t number, Clusters& clusters) const {
    const std::size_t x = number % field_.dims.x;
    const std::size_t y = number / field_.dims.x % field_.dims.y;
    const auto parity =
        static_cast<unsigned>((x + y + begin_ / (std::size_t{field_.dims.x} * field_.dims.y)) & 1);
    while (left != 0) {
      const Directions component = links.facts(parity, left).first();
      left &= ~component;
      if (!is_crossed(number, links.directions()[first_of(component)])) continue;  // left out
      for (Directions rest = component; rest != 0; rest &= rest - 1) {
        clusters.crossings.push_back(crossing(number, links.directions()[first_of(rest)]));
      }
      std::sort(clusters.crossings.begin() + clusters.begin.back(), clusters.crossings.end());
      clusters.begin.push_back(static_cast<std::uint32_t>(clusters.crossings.size()));
    }
  }

  static std::size_t first_of(Directions directions) {
    return static_cast<std::size_t>(std::countr_zero(directions));
  }
  std::size_t owner(std::size_t sample, const LinkDirection& direction) const {
    return sample - static_cast<std::size_t>(sample_offset(field_.dims, direction.corner));
  }
  const PlaneCrossings& plane_of(std::size_t owner) const { return owner < begin_ ? below_ : own_; }
  bool is_crossed(std::size_t sample, const LinkDirection& direction) const {
    const std::size_t from = owner(sample, direction);
    return plane_of(from).is_crossed(from, direction.place);
  }
  std::uint32_t crossing(std::size_t sample, const LinkDirection& direction) const {
    const std::size_t from = owner(sample, direction);
    return plane_of(from).number_of(from, direction.place);
  }

  const Field& field_;
  const PlaneCrossings below_;
  const PlaneCrossings own_;
  const std::size_t begin_;
};

Clusters join(std::span<const Clusters> layers, const Context& context) {
  std::vector<std::size_t> sets = {0};
  std::vector<std::size_t> crossings = {0};
  for (const Clusters& layer : layers) {
    sets.push_back(sets.back() + layer.size());
    crossings.push_back(crossings.back() + layer.crossings.size());
  }
  Clusters all;
  all.begin.resize(sets.back() + 1);
  all.crossings.resize(crossings.back());
  parallel_for(context, layers.size(), [&](std::size_t z) {
    for (std::size_t k = 0; k < layers[z].size(); ++k) {
      all.begin[sets[z] + k + 1] =
          static_cast<std::uint32_t>(crossings[z] + layers[z].begin[k + 1]);
    }
    std::ranges::copy(layers[z].crossings,
                      all.crossings.begin() + static_cast<std::ptrdiff_t>(crossings[z]));
  });
  return all;
}

}  // namespace

template <class T>
Clusters find_clusters(const Lattice<T>& lattice, const ExtractOptions& options, const Field& field,
                       const Crossings& crossings, const Context& context) {
  ExtractOptions joining = options;
  joining.regularize = true;
  const SurfaceCount count = count_surface(lattice, joining, context);
  std::vector<Clusters> layers(count.clusters.size());
  const std::uint32_t before = options.close ? field.margin - 1 : 0;
  parallel_for(context, layers.size(), [&](std::size_t z) {
    const ClusterLayer& layer = count.clusters[z];
    if (layer.words.empty()) return;
    const auto plane = static_cast<std::uint32_t>(z + before);
    layers[z] = PlaneClusters(field, crossings, plane).find(layer, before);
  });
  return join(layers, context);
}

#define ISOMESH_INSTANTIATE(T, name, kType)                                               \
  template Clusters find_clusters(const Lattice<T>&, const ExtractOptions&, const Field&, \
                                  const Crossings&, const Context&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh::collapse
