#include "server/mesh/collapse/bound.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "proto/error.h"
#include "proto/samples.h"
#include "server/mesh/collapse/clusters.h"
#include "server/mesh/collapse/collapses.h"
#include "server/mesh/collapse/cover.h"
#include "server/mesh/collapse/field.h"
#include "server/mesh/collapse/proof.h"
#include "server/mesh/collapse/simplify_layers.h"
#include "server/mesh/collapse/start.h"
#include "server/mesh/collapse/tube.h"

namespace isomesh::mesh {
namespace collapse {
namespace {

constexpr double kLeastReach = 0.25;  // of the error: with less nothing is gained

// The layers of phantoms around a surface that is closed: room for T-, which is outside of its
// caps. Even: a cell keeps its parity.
constexpr std::uint32_t margin_of_steps(std::uint32_t steps) { return 2 * (1 + steps / 2); }
constexpr std::uint32_t kMostSteps = 8;

std::uint32_t margin_for(const Metric& metric, double error_mm) {
  return margin_of_steps(static_cast<std::uint32_t>(
      std::min<double>(kMostSteps, std::ceil(error_mm / metric.least_step()))));
}

// How far rounding may move a place, in millimetres: to the copies' grid, and to the mesh's single
// precision.
double rounding_of(const Dims& dims, const Metric& metric) {
  constexpr double kUnit = std::numeric_limits<float>::epsilon();
  const double samples = std::max({dims.x, dims.y, dims.z});
  const double grid = std::max(1.0 / double{kPlaces}, samples * kUnit) * metric.largest_step();
  double largest = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const Vecd place = metric.place({(corner & 1) != 0 ? dims.x - 1.0 : 0.0,
                                     (corner & 2) != 0 ? dims.y - 1.0 : 0.0,
                                     (corner & 4) != 0 ? dims.z - 1.0 : 0.0});
    largest = std::max(largest, length(place));
  }
  return grid + largest * kUnit;
}

// The triangles of the components of S in `which`, with all vertices on lattice edges, instead of
// what has become of them. A component of a few voxels may have been folded until T+ and T- lay
// around it no longer.
void restore(const StartSurface& surface, const Components& components,
             std::span<const std::uint32_t> which, Tube& tube) {
  std::vector<std::uint8_t> back(components.count, 0);
  for (const std::uint32_t component : which) back[component] = 1;
  const auto goes_back = [&](std::uint32_t crossing) {
    return back[components.of_vertex[crossing]] != 0;
  };
  std::erase_if(tube.triangles,
                [&](const Triangle& triangle) { return goes_back(tube.origins[triangle[0]]); });
  std::vector<std::uint32_t> number(surface.crossings.size());
  for (std::uint32_t v = 0; v < number.size(); ++v) {
    if (!goes_back(v)) continue;
    number[v] = static_cast<std::uint32_t>(tube.vertices.size());
    tube.add(on_lattice_edge(surface, v), v);
  }
  for (const auto& [a, b, c] : surface.mesh.triangles) {
    if (!goes_back(a)) continue;
    tube.triangles.push_back({number[a], number[b], number[c]});
    if (!surface.is_wound_as_tube(a)) {
      std::swap(tube.triangles.back()[1], tube.triangles.back()[2]);
    }
  }
  tube.compact();
}

// Returns true if the tube is proven. If only components are lost, restores them and tries again.
bool is_proven(const StartSurface& surface, const Context& context, Tube& tube) {
  Components components;
  find_components(surface.mesh, context, components);
  const auto proof_of_tube = [&] {
    return prove(surface.field,
                 {surface.crossings, surface.mesh.triangles.span(), components, tube.vertices,
                  tube.triangles, tube.origins},
                 context);
  };
  tube.compact();
  const Proof proof = proof_of_tube();
  if (proof.holds() || !proof.is_clear()) return proof.holds();
  restore(surface, components, proof.uncovered, tube);
  return proof_of_tube().holds();
}

BoundedMesh describe(const Metric& metric, const Tube& tube) {
  BoundedMesh result;
  const auto mm = [&](Vecf copy) {
    const Vecd place = metric.place(wide(copy));
    return std::array{place.x, place.y, place.z};
  };
  for (const Vertex& vertex : tube.vertices) {
    result.inside.push_back(mm(vertex.in));
    result.outside.push_back(mm(vertex.out));
  }
  return result;
}

// Gives the mesh the tube's surface, at those places.
void write(const StartSurface& surface, std::span<const Vec3> places, const Tube& tube,
           Mesh& mesh) {
  for (std::size_t v = 0; v < places.size(); ++v) mesh.positions[tube.origins[v]] = places[v];
  std::vector<Triangle> triangles;
  triangles.reserve(tube.triangles.size());
  for (const auto& [a, b, c] : tube.triangles) {
    triangles.push_back({tube.origins[a], tube.origins[b], tube.origins[c]});
    if (!surface.is_wound_as_tube(tube.origins[a])) {
      std::swap(triangles.back()[1], triangles.back()[2]);
    }
  }
  std::vector<WallSides> no_sides;
  replace_triangles(triangles, no_sides, mesh);
}

BoundedMesh deliver(const StartSurface& surface, const Tube& tube, double shift_mm,
                    double max_error_mm, Mesh& mesh) {
  std::vector<Vec3> places;
  for (const Vertex& vertex : tube.vertices) {
    const Vecf place = narrow(surface.metric.place(wide(vertex.p)));
    places.push_back({place.x, place.y, place.z});
  }
  BoundedMesh result = describe(surface.metric, tube);
  result.shift_mm = shift_mm;
  result.triangles_before = mesh.triangles.size();
  result.bound_mm = result.bound_at(places);
  // The reach leaves room for this rounding.
  if (!(result.bound_mm <= max_error_mm)) {
    throw Error(ErrorCode::kInternal, "a proven distance is larger than its limit");
  }
  write(surface, places, tube, mesh);
  return result;
}

}  // namespace
}  // namespace collapse

double BoundedMesh::bound_at(std::span<const Vec3> places) const {
  double most = 0;
  for (std::size_t v = 0; v < places.size(); ++v) {
    for (const auto* copy : {&inside[v], &outside[v]}) {
      const double distance =
          std::hypot((*copy)[0] - double{places[v][0]}, (*copy)[1] - double{places[v][1]},
                     (*copy)[2] - double{places[v][2]});
      if (!(distance <= most)) most = distance;
      if (std::isnan(most)) return most;
    }
  }
  return most + shift_mm;
}

std::uint64_t proving_memory(const ExtractOptions& extract, std::uint64_t planes,
                             std::uint64_t plane_samples) {
  const std::uint64_t around =
      extract.close ? 2 * collapse::margin_of_steps(collapse::kMostSteps) : 0;
  const auto side =
      static_cast<std::uint64_t>(std::ceil(std::sqrt(static_cast<double>(plane_samples))));
  const std::uint64_t plane = plane_samples + around * (2 * side + around);
  // Field::values has a layer behind the samples, and those of the centres are between two.
  const bool has_centres = extract.scheme == Scheme::kBcc;
  const std::uint64_t layers = (planes + around) * (has_centres ? 2 : 1) + (has_centres ? 3 : 1);
  return layers * plane * sizeof(float);
}

template <class T>
std::optional<BoundedMesh> simplify_within(const Lattice<T>& lattice, const ExtractOptions& extract,
                                           const BoundOptions& options, const Context& context,
                                           Mesh& mesh) {
  using namespace collapse;
  if (extract.regularize) return {};
  if (mesh.triangles.size() == 0) return BoundedMesh();
  const std::uint32_t margin =
      extract.close ? margin_for(Metric(lattice.to_space), options.max_error_mm) : 0;
  std::optional<Field> field = make_field(lattice, extract, margin, context);
  if (!field) return {};  // single precision cannot hold the samples' differences
  Crossings crossings = crossings_of(*field, context);
  std::vector<std::uint8_t> turned;
  if (!mesh.kept.empty()) {
    if (mesh.kept.size() != (crossings.all.size() + kFlagBits - 1) / kFlagBits) return {};
    turned = leave_out(mesh.kept, context, *field, crossings);
  }
  if (crossings.all.size() != mesh.positions.size()) return {};  // not a surface of the samples
  const Metric metric = Metric(lattice.to_space).before(margin);
  const double least = kLeastReach * options.max_error_mm;
  const double unmoved =
      options.max_error_mm - options.rounding_mm - rounding_of(field->dims, metric);
  if (!(unmoved > least)) return {};
  const double shift = shift_of(lattice, extract, *field, crossings.all, context);
  const double reach = unmoved - shift;
  if (!(reach > least)) return {};  // samples are too near to the iso-value

  const StartSurface surface = {*field,
                                crossings.all,
                                metric,
                                mesh,
                                reach,
                                options.is_smoothed,
                                0.5 * Placement::nearest_share(lattice.dims, lattice.to_space),
                                turned};
  std::optional<Tube> tube =
      make_start(surface, find_clusters(lattice, extract, *field, crossings, context), context);
  if (!tube) return {};  // samples differ too little from it
  const double unit = unit_mm(lattice.to_space);
  collapse_edges({*field, metric.in_units_of(unit), reach / unit}, options.triangles, context,
                 *tube);
  if (!is_proven(surface, context, *tube)) return {};
  return deliver(surface, *tube, shift, options.max_error_mm, mesh);
}

#define ISOMESH_INSTANTIATE(T, name, kType)                                                     \
  template std::optional<BoundedMesh> simplify_within(const Lattice<T>&, const ExtractOptions&, \
                                                      const BoundOptions&, const Context&, Mesh&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
