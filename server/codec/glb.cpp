#include <array>
#include <bit>
#include <cmath>
#include <deque>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/codec/draco_chunk.h"
#include "server/codec/encode.h"
#include "server/codec/glb_document.h"
#include "server/codec/glb_writer.h"
#include "server/codec/label_titles.h"
#include "server/codec/levels.h"
#include "server/codec/plain_chunk.h"
#include "server/mesh/measure/distance.h"
#include "server/mesh/measure/normals.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec {
namespace {

struct Distances {
  Distances() = default;
  Distances(const mesh::Mesh& mesh, const MeshParameters& parameters,
            const mesh::TriangleGrid* extracted, const mesh::Context& context) {
    if (!parameters.distances) return;
    if (extracted == nullptr) {
      throw Error(ErrorCode::kInternal,
                  "distances are requested without a surface to measure from");
    }
    measure_vertex_distances(mesh, *extracted, {context.stop, nullptr}, values);
    if (values.size() > 0) most = *std::ranges::max_element(values);
    if (!std::isfinite(most)) {
      throw Error(ErrorCode::kInternal, "distances are requested to a surface without triangles");
    }
  }

  mesh::Buffer<float> values;
  float most = 0;
};

// `shading`: normals that are not the mesh's own; empty if it has no others.
GlbLevel encode_level(double share, const mesh::Mesh& mesh, mesh::Buffer<mesh::Vec3> shading,
                      const Distances& distances, const Grid& grid,
                      const MeshParameters& parameters, const mesh::Context& context) {
  GlbLevel level = {.share = share};
  if (mesh.triangles.size() == 0) return level;
  const mesh::Context quiet = {context.stop, nullptr};
  // Computed on the whole mesh, so both sides of a seam have the same.
  if (parameters.normals && shading.size() == 0) vertex_normals(mesh, quiet, shading);
  const VertexData data = {std::as_const(shading).span(), distances.values.span(), distances.most};
  const std::vector<Block> blocks = parameters.merge
                                        ? std::vector<Block>{{{0, mesh.triangles.size()}}}
                                        : cut_blocks(mesh, kTrianglesPerBlock);
  if (parameters.merge && parameters.glb_codec == GlbCodec::kDraco) {
    Encoders& encoders = Encoders::instance();
    auto encoder = encoders.take(mesh.triangles.size());
    level.streams.push_back(
        encoder->encode_whole(mesh, {grid, parameters.draco.speed}, data, quiet));
    encoders.give_back(std::move(encoder));
    if (context.progress) context.progress(1);
    return level;
  }
  level.make_room(blocks.size(), parameters.glb_codec);
  mesh::parallel_for(context, blocks.size(), [&](std::size_t i) {
    encode_glb_block(mesh, blocks[i], grid, data, parameters, quiet, i, level);
  });
  return level;
}

// A level that will be written from the mesh itself.
GlbLevel plain_level(double share, const mesh::Mesh& mesh, const MeshParameters& parameters) {
  GlbLevel level = {.share = share};
  if (mesh.triangles.size() > 0) {
    level.arrays.push_back(
        describe_plain(mesh.positions.size(), mesh.triangles.size(), parameters));
    level.arrays.back().bounds = bounds_of(mesh.positions.span());
  }
  check_glb_size(level.bytes(), parameters);
  return level;
}

GlbPart part_of(const LabelSummary& label) {
  GlbPart part = {.name = title_of(label), .material = title_of(label)};
  part.color = color_of(label);
  for (double& channel : part.color) channel = linear_of(channel);
  part.label = label;
  return part;
}

std::span<const double> coarser_shares(const MeshParameters& parameters) {
  return std::span(parameters.lods).subspan(parameters.lods.empty() ? 0 : 1);
}

std::uint64_t count_of(double share, const mesh::Mesh& mesh) {
  return static_cast<std::uint64_t>(share * static_cast<double>(mesh.triangles.size()));
}

// The part of the progress before the file is written: plain levels are written from their meshes,
// while others are encoded before.
double made_share(const MeshParameters& parameters) { return is_plain(parameters) ? 0.5 : 1; }

// The part of the progress of one level, and within it of simplification, which takes most of the
// time.
struct LevelProgress {
  mesh::Context simplify;
  mesh::Context encode;

  LevelProgress(const mesh::Context& context, const MeshParameters& parameters, std::size_t level) {
    constexpr double kSimplifyShare = 0.8;
    const double each = made_share(parameters) /
                        static_cast<double>(std::max<std::size_t>(1, parameters.lods.size()));
    const double begin = static_cast<double>(level) * each;
    const double encoding = level == 0 ? begin : begin + kSimplifyShare * each;
    simplify = context.part(begin, encoding);
    encode = context.part(encoding, begin + each);
  }
};

mesh::Context writing(const mesh::Context& context, const MeshParameters& parameters) {
  return is_plain(parameters) ? context.part(made_share(parameters), 1)
                              : mesh::Context{context.stop, nullptr};
}

// The walls of one level.
struct WallLevel {
  LabelledSurface surface;
  Distances distances;  // computed on the walls, so touching labels have the same

  // Those of the own surface of a label, by its place among the labels.
  Distances distances_of(std::size_t n) const {
    Distances own;
    own.most = distances.most;
    if (distances.values.size() == 0) return own;
    const mesh::Buffer<std::uint32_t>& vertices = surface.surfaces[n].vertices;
    own.values.resize_for_overwrite(vertices.size());
    std::ranges::transform(vertices, own.values.begin(),
                           [&](std::uint32_t v) { return distances.values[v]; });
    return own;
  }

  mesh::Buffer<mesh::Vec3> normals_of(std::size_t n, const MeshParameters& parameters,
                                      const mesh::Context& context) const {
    if (!parameters.normals) return {};
    return shading_of(surface.surfaces[n], surface.walls, context);
  }
};

// The walls and `parameters` must outlive the level.
GlbLevel plain_label(const WallLevel& walls, std::size_t n, double share,
                     const MeshParameters& parameters, const mesh::Context& context) {
  const mesh::Mesh& mesh = walls.surface.surfaces[n].mesh;
  GlbLevel level = plain_level(share, mesh, parameters);
  const LabelSummary& label = walls.surface.labels[n];
  const mesh::OneThread alone;
  // The job has measured the labels of the finest level.
  level.is_solid = share == 1 ? label.closed && label.manifold && label.oriented
                              : is_solid(measure_topology(mesh, context));
  level.put_others = [&walls, &mesh, n, &parameters, context](const Sink& sink) {
    const mesh::Buffer<mesh::Vec3> normals = walls.normals_of(n, parameters, context);
    const Distances distances = walls.distances_of(n);
    put_plain(mesh, parameters, {normals.span(), distances.values.span()}, context, sink);
  };
  return level;
}

// Adds a level to all parts, from the walls or simplified ones.
void add_levels(const WallLevel& walls, double share, const Grid& grid,
                const MeshParameters& parameters, const mesh::Context& context,
                std::vector<GlbPart>& parts) {
  const mesh::Context quiet = {context.stop, nullptr};
  mesh::parallel_for(context, parts.size(), [&](std::size_t n) {
    if (is_plain(parameters)) {
      return parts[n].add_level(plain_label(walls, n, share, parameters, quiet));
    }
    parts[n].add_level(encode_level(share, walls.surface.surfaces[n].mesh,
                                    walls.normals_of(n, parameters, quiet), walls.distances_of(n),
                                    grid, parameters, quiet));
  });
}

// A coarser level, which may live no longer than its walls.
struct CoarseLevel {
  CoarseLevel(const mesh::SeparatingSurface& walls, const mesh::Context& context)
      : surfaces(label_surfaces(walls, context)) {}

  std::vector<mesh::LabelSurface> surfaces;
  std::optional<WallLevel> level = {};
};

void encode_labels(const LabelledSurface& surface, const Provenance& provenance,
                   const mesh::Context& context, const Sink& sink) {
  const MeshParameters& parameters = provenance.parameters;
  const mesh::Context quiet = {context.stop, nullptr};
  const auto shares = coarser_shares(parameters);
  const Grid grid = grid_of(surface.walls.mesh, parameters.draco.position_bits);
  std::vector<GlbPart> parts;
  for (const LabelSummary& label : surface.labels) parts.push_back(part_of(label));
  const auto level_of = [&](const LabelledSurface& walls) {
    return WallLevel{walls, {walls.walls.mesh, parameters, surface.extracted, quiet}};
  };
  std::optional<WallLevel> finest(level_of(surface));
  add_levels(*finest, 1, grid, parameters, LevelProgress(context, parameters, 0).encode, parts);
  if (!is_plain(parameters)) finest.reset();
  mesh::SeparatingSurface coarse;
  if (!shares.empty()) coarse = copy_of(surface.walls);
  // Plain files are written from the walls of all levels.
  std::deque<mesh::SeparatingSurface> walls;
  std::deque<CoarseLevel> kept;
  for (std::size_t n = 0; n < shares.size(); ++n) {
    const LevelProgress progress(context, parameters, n + 1);
    coarsen(count_of(shares[n], surface.walls.mesh), progress.simplify, coarse);
    const auto& own = is_plain(parameters) ? walls.emplace_back(copy_of(coarse)) : coarse;
    CoarseLevel& level = kept.emplace_back(own, quiet);
    level.level.emplace(level_of({own, level.surfaces, surface.labels, surface.extracted}));
    add_levels(*level.level, shares[n], grid, parameters, progress.encode, parts);
    if (!is_plain(parameters)) kept.clear();
  }
  write_glb(parts, grid, provenance, writing(context, parameters), sink);
}

std::optional<mesh::Topology> encode_surface(const FileContent& content,
                                             const mesh::Context& context, const Sink& sink) {
  const mesh::Mesh& mesh = content.mesh;
  const MeshParameters& parameters = content.provenance.parameters;
  const mesh::Context quiet = {context.stop, nullptr};
  const auto shares = coarser_shares(parameters);
  const Grid grid = grid_of(mesh, parameters.draco.position_bits);
  std::optional<mesh::Topology> topology;  // of the finest level
  std::deque<mesh::Mesh> kept;             // plain files are written from all levels
  const auto level_of = [&](double share, const mesh::Mesh& level, const mesh::Context& progress) {
    const auto distances_of = [&parameters, &content, quiet](const mesh::Mesh& of) {
      return Distances(of, parameters, content.extracted, quiet);
    };
    if (!is_plain(parameters)) {
      return encode_level(share, level, {}, distances_of(level), grid, parameters, progress);
    }
    GlbLevel plain = plain_level(share, level, parameters);
    const mesh::Topology found = measure_topology(level, quiet);
    plain.is_solid = is_solid(found);
    if (!topology) topology = found;
    if (progress.progress) progress.progress(1);
    plain.put_others = [&parameters, &level, distances_of, quiet](const Sink& to) {
      const Distances distances = distances_of(level);
      put_plain(level, parameters, {{}, distances.values.span()}, quiet, to);
    };
    return plain;
  };
  GlbPart part = GlbPart::of_surface();
  part.add_level(level_of(1, mesh, LevelProgress(context, parameters, 0).encode));
  mesh::Mesh coarse;
  if (!shares.empty()) coarse = copy_of(mesh);
  for (std::size_t n = 0; n < shares.size(); ++n) {
    const LevelProgress progress(context, parameters, n + 1);
    coarsen(count_of(shares[n], mesh), progress.simplify, coarse);
    const auto& level = is_plain(parameters) ? kept.emplace_back(copy_of(coarse)) : coarse;
    part.add_level(level_of(shares[n], level, progress.encode));
  }
  write_glb({&part, 1}, grid, content.provenance, writing(context, parameters), sink);
  if (is_plain(parameters)) return topology;
  if (part.levels.empty() || part.levels.front().streams.empty()) return std::nullopt;
  return topology_of(mesh, part.levels.front().streams, quiet);
}

}  // namespace

std::optional<mesh::Topology> encode_glb(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  if (content.labels == nullptr) return encode_surface(content, context, sink);
  encode_labels(*content.labels, content.provenance, context, sink);
  return std::nullopt;
}

}  // namespace isomesh::codec
