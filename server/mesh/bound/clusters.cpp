#include "server/mesh/bound/clusters.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "proto/samples.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/extract/links.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::bound {
namespace {

// The clusters around the samples of one layer.
class LayerClusters {
 public:
  // `before`: how many layers of the field are before what is marched over.
  LayerClusters(const Field& field, std::uint32_t before, std::span<const Crossing> crossings)
      : dims_(field.dims), before_(before), crossings_(crossings), links_(links_of(Scheme::kSix)) {}

  Clusters find(const ClusterLayer& layer, std::size_t z) const {
    Clusters clusters;
    for (std::uint32_t y = 0; y + 1 < layer.row_begin.size(); ++y) {
      const std::size_t row = ((z + before_) * dims_.y + y + before_) * dims_.x + before_;
      for (const JoiningWord& word : layer.row(y)) {
        visit_joining(layer, word, [&](unsigned bit, const Joined& joined) {
          add(joined.directions(), static_cast<std::uint32_t>(row + word.word * 64 + bit),
              clusters);
        });
      }
    }
    return clusters;
  }

 private:
  void add(Directions left, std::uint32_t number, Clusters& clusters) const {
    while (left != 0) {
      const Directions component = links_.facts(0, left).first();
      left &= ~component;
      for (Directions rest = component; rest != 0; rest &= rest - 1) {
        const auto d = static_cast<std::size_t>(std::countr_zero(rest));
        clusters.crossings.push_back(crossing(number, links_.directions()[d].step));
      }
      std::sort(clusters.crossings.begin() + clusters.begin.back(), clusters.crossings.end());
      clusters.begin.push_back(static_cast<std::uint32_t>(clusters.crossings.size()));
    }
  }

  // The number of the crossing between a sample and its neighbour. Crossings are in the order of
  // their first samples, and of their second ones.
  std::uint32_t crossing(std::uint32_t sample, const std::array<int, 3>& step) const {
    const auto other = static_cast<std::uint32_t>(
        std::ptrdiff_t{sample} + step[0] +
        std::ptrdiff_t{dims_.x} * (step[1] + std::ptrdiff_t{dims_.y} * step[2]));
    const std::pair ends(std::min(sample, other), std::max(sample, other));
    const auto found = std::ranges::lower_bound(crossings_, ends, {}, [](const Crossing& crossing) {
      return std::pair(std::min(crossing.inside, crossing.outside),
                       std::max(crossing.inside, crossing.outside));
    });
    return static_cast<std::uint32_t>(found - crossings_.begin());
  }

  const Dims& dims_;
  const std::uint32_t before_;
  const std::span<const Crossing> crossings_;
  const Links& links_;
};

}  // namespace

template <class T>
Clusters find_clusters(const Lattice<T>& lattice, const ExtractOptions& options, const Field& field,
                       std::span<const Crossing> crossings, const Context& context) {
  ExtractOptions joining = options;
  joining.regularize = true;
  const SurfaceCount count = count_surface(lattice, joining, context);
  std::vector<Clusters> layers(count.clusters.size());
  const LayerClusters finder(field, options.close ? field.margin - 1 : 0, crossings);
  parallel_for(context, layers.size(),
               [&](std::size_t z) { layers[z] = finder.find(count.clusters[z], z); });
  Clusters all;
  for (const Clusters& layer : layers) {
    const auto shift = static_cast<std::uint32_t>(all.crossings.size());
    all.crossings.insert(all.crossings.end(), layer.crossings.begin(), layer.crossings.end());
    for (std::size_t k = 1; k < layer.begin.size(); ++k)
      all.begin.push_back(shift + layer.begin[k]);
  }
  return all;
}

#define ISOMESH_INSTANTIATE(T, name, kType)                                               \
  template Clusters find_clusters(const Lattice<T>&, const ExtractOptions&, const Field&, \
                                  std::span<const Crossing>, const Context&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh::bound
