#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/codec/draco_chunk.h"
#include "server/codec/encode.h"
#include "server/codec/glb_document.h"
#include "server/codec/label_titles.h"
#include "server/codec/levels.h"
#include "server/mesh/measure/distance.h"
#include "server/mesh/measure/normals.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec {
namespace {

static_assert(std::endian::native == std::endian::little, "GLB is little-endian");

// Measured: with half as many, duplicated seam vertices cost 1.5 % more bytes; with twice as many,
// the first block arrives later and its vertices no longer fit 16 bits.
constexpr std::size_t kTrianglesPerBlock = 100'000;
// glTF 2.0, section 4.4.
constexpr std::uint32_t kMagic = 0x46546C67;
constexpr std::uint32_t kVersion = 2;
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
constexpr std::uint32_t kBinaryChunk = 0x004E4942;

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

GlbLevel encode_level(double share, const mesh::Mesh& mesh, const Distances& distances,
                      const Grid& grid, const MeshParameters& parameters,
                      const mesh::Context& context) {
  GlbLevel level = {.share = share};
  if (mesh.triangles.size() == 0) return level;
  const DracoOptions options = {grid, parameters.draco.speed};
  const mesh::Context quiet = {context.stop, nullptr};
  // Computed on the whole mesh, so both sides of a seam have the same.
  mesh::Buffer<mesh::Vec3> normals;
  if (parameters.normals) vertex_normals(mesh, quiet, normals);
  const VertexData data = {std::as_const(normals).span(), distances.values.span(), distances.most};
  const std::vector<Block> blocks = parameters.merge
                                        ? std::vector<Block>{{{0, mesh.triangles.size()}}}
                                        : cut_blocks(mesh, kTrianglesPerBlock);
  if (parameters.glb_codec == GlbCodec::kMeshopt) {
    level.arrays.resize(blocks.size());
    mesh::parallel_for(context, blocks.size(), [&](std::size_t i) {
      level.arrays[i] = encode_with_meshopt(mesh, blocks[i], grid, data);
    });
    return level;
  }
  level.streams.resize(blocks.size());
  Encoders& encoders = Encoders::instance();
  mesh::parallel_for(context, blocks.size(), [&](std::size_t i) {
    auto encoder = encoders.take(parameters.merge ? mesh.triangles.size() : kTrianglesPerBlock);
    level.streams[i] = parameters.merge
                           ? encoder->encode_whole(mesh, options, data, quiet)
                           : encoder->encode_block(mesh, blocks[i], options, data, quiet);
    encoders.give_back(std::move(encoder));
  });
  return level;
}

void write_words(const Sink& sink, std::initializer_list<std::uint32_t> words) {
  sink(std::as_bytes(std::span(words.begin(), words.size())));
}

void write_glb(std::span<const GlbPart> parts, const Grid& grid, const Provenance& provenance,
               const Sink& sink) {
  const GlbLayout layout(parts);
  const std::size_t binary_bytes = layout.bytes();
  std::string json = glb_document(parts, layout, grid, provenance);
  json.resize(glb_padded(json.size()), ' ');

  constexpr std::size_t kHeaderBytes = 12;
  constexpr std::size_t kChunkHeaderBytes = 8;
  const std::size_t total = kHeaderBytes + kChunkHeaderBytes + json.size() +
                            (binary_bytes == 0 ? 0 : kChunkHeaderBytes + binary_bytes);
  if (total > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::kTooLarge,
                "The encoded surface exceeds the 4 GiB that a GLB file can hold. Set \"triangles\" "
                "to simplify it.");
  }
  write_words(sink, {kMagic, kVersion, static_cast<std::uint32_t>(total)});
  write_words(sink, {static_cast<std::uint32_t>(json.size()), kJsonChunk});
  sink(std::as_bytes(std::span(json)));
  if (binary_bytes == 0) return;
  write_words(sink, {static_cast<std::uint32_t>(binary_bytes), kBinaryChunk});
  constexpr std::array<std::byte, kGlbAlignment> kZeros = {};
  for (const GlbLevel* level : layout.order()) {
    level->for_each_chunk([&](std::span<const std::byte> bytes) {
      sink(bytes);
      sink(std::span(kZeros).first(glb_padded(bytes.size()) - bytes.size()));
    });
  }
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

// The part of the progress of one level, and within it of simplification, which takes most of the
// time.
struct LevelProgress {
  mesh::Context simplify;
  mesh::Context encode;

  LevelProgress(const mesh::Context& context, std::size_t level, std::size_t levels) {
    constexpr double kSimplifyShare = 0.8;
    const auto count = static_cast<double>(levels);
    const double begin = static_cast<double>(level) / count;
    const double encoding = level == 0 ? begin : begin + kSimplifyShare / count;
    simplify = context.part(begin, encoding);
    encode = context.part(encoding, static_cast<double>(level + 1) / count);
  }
};

Distances of_label(const Distances& of_walls, const LabelledSurface& surface, std::size_t number) {
  const auto vertices = vertices_of_label(surface.walls, surface.triangles, number);
  Distances own;
  own.most = of_walls.most;
  own.values.resize_for_overwrite(vertices.size());
  std::ranges::transform(vertices, own.values.begin(),
                         [&](std::uint32_t v) { return of_walls.values[v]; });
  return own;
}

// Adds a level to all parts, from the walls or simplified ones.
void add_levels(const LabelledSurface& surface, double share, const Grid& grid,
                const MeshParameters& parameters, const mesh::Context& context,
                std::vector<GlbPart>& parts) {
  const mesh::Context quiet = {context.stop, nullptr};
  // Computed on the walls, so touching labels have the same.
  const Distances of_walls(surface.walls.mesh, parameters, surface.extracted, quiet);
  mesh::parallel_for(context, parts.size(), [&](std::size_t n) {
    mesh::Mesh mesh;
    extract_label(surface.walls, surface.triangles, n + 1, mesh);
    if (parameters.normals) shade_label(surface.walls, surface.triangles, n + 1, quiet, mesh);
    const Distances own = parameters.distances ? of_label(of_walls, surface, n + 1) : Distances();
    parts[n].add_level(encode_level(share, mesh, own, grid, parameters, quiet));
  });
}

void encode_labels(const LabelledSurface& surface, const Provenance& provenance,
                   const mesh::Context& context, const Sink& sink) {
  const MeshParameters& parameters = provenance.parameters;
  const auto shares = coarser_shares(parameters);
  const Grid grid = grid_of(surface.walls.mesh, parameters.draco.position_bits);
  std::vector<GlbPart> parts;
  for (const LabelSummary& label : surface.labels) parts.push_back(part_of(label));
  const LevelProgress finest(context, 0, shares.size() + 1);
  add_levels(surface, 1, grid, parameters, finest.encode, parts);
  mesh::SeparatingSurface coarse;
  if (!shares.empty()) coarse = copy_of(surface.walls);
  for (std::size_t n = 0; n < shares.size(); ++n) {
    const LevelProgress progress(context, n + 1, shares.size() + 1);
    coarsen(count_of(shares[n], surface.walls.mesh), progress.simplify, coarse);
    const mesh::LabelTriangles triangles(coarse);
    add_levels({coarse, triangles, surface.labels, surface.extracted}, shares[n], grid, parameters,
               progress.encode, parts);
  }
  write_glb(parts, grid, provenance, sink);
}

}  // namespace

std::optional<mesh::Topology> encode_glb(const FileContent& content, const mesh::Context& context,
                                         const Sink& sink) {
  if (content.labels != nullptr) {
    encode_labels(*content.labels, content.provenance, context, sink);
    return std::nullopt;
  }
  const mesh::Mesh& mesh = content.mesh;
  const MeshParameters& parameters = content.provenance.parameters;
  const auto shares = coarser_shares(parameters);
  const auto level_of = [&](double share, const mesh::Mesh& level, const Grid& grid,
                            const mesh::Context& progress) {
    const Distances distances(level, parameters, content.extracted, progress);
    return encode_level(share, level, distances, grid, parameters, progress);
  };
  const Grid grid = grid_of(mesh, parameters.draco.position_bits);
  GlbPart part = {.name = "surface", .material = "neutral"};
  const LevelProgress finest(context, 0, shares.size() + 1);
  part.add_level(level_of(1, mesh, grid, finest.encode));
  mesh::Mesh coarse;
  if (!shares.empty()) coarse = copy_of(mesh);
  for (std::size_t n = 0; n < shares.size(); ++n) {
    const LevelProgress progress(context, n + 1, shares.size() + 1);
    coarsen(count_of(shares[n], mesh), progress.simplify, coarse);
    part.add_level(level_of(shares[n], coarse, grid, progress.encode));
  }
  write_glb({&part, 1}, grid, content.provenance, sink);
  if (part.levels.empty() || part.levels.front().streams.empty()) return std::nullopt;
  return topology_of(mesh, part.levels.front().streams, {context.stop, nullptr});
}

}  // namespace isomesh::codec
