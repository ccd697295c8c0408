#include "server/codec/label_zip.h"

#include <algorithm>
#include <string>
#include <utility>

#include "base/hex.h"
#include "base/sha256.h"
#include "proto/error.h"
#include "server/codec/draco/grid.h"
#include "server/codec/file_names.h"
#include "server/codec/formats.h"
#include "server/codec/levels.h"
#include "server/codec/zip_writer.h"
#include "server/mesh/labels/label_surface.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec {
namespace {

// Labels are encoded in parallel, in batches of about this many triangles.
constexpr std::size_t kTrianglesAtOnce = 1'000'000;
constexpr std::size_t kLabelsAtOnce = 256;

struct Encoded {
  std::vector<std::byte> bytes;
  std::string sha256;
};

Grid shared_grid(const mesh::Mesh& walls, const MeshParameters& parameters) {
  const Space space = space_of(MeshFormat::kDrc, parameters);
  return use_in_space(walls, space, [&](const mesh::Mesh& mesh) {
    return grid_of(mesh, parameters.draco.position_bits);
  });
}

Encoded encode_one(const mesh::Mesh& mesh, MeshFormat format, const Grid& grid,
                   const Provenance& provenance, const mesh::Context& context) {
  Encoded encoded;
  Sha256 hash;
  const Sink sink = [&](std::span<const std::byte> piece) {
    encoded.bytes.insert(encoded.bytes.end(), piece.begin(), piece.end());
    hash.update(piece);
  };
  if (format == MeshFormat::kDrc) {
    const Space space = space_of(format, provenance.parameters);
    use_in_space(mesh, space, [&](const mesh::Mesh& placed) {
      encode_drc(placed, provenance.parameters.draco, context, sink, &grid);
    });
  } else {
    encode(mesh, format, provenance, context, sink);
  }
  encoded.sha256 = to_hex(hash.finish());
  return encoded;
}

}  // namespace

std::vector<LabelFiles> encode_labels_zip(const LabelledSurface& surface,
                                          std::span<const MeshFormat> formats,
                                          const Provenance& provenance,
                                          const mesh::Context& context, const Sink& sink) {
  const Grid grid = shared_grid(surface.walls.mesh, provenance.parameters);
  const mesh::Context quiet = {context.stop, nullptr};
  const std::size_t labels = surface.labels.size();
  std::vector<LabelFiles> files(labels);
  FileNames names;
  ZipWriter zip(sink, ZipWriter::Compression::kStored);
  for (std::size_t begin = 0, end = 0; begin < labels; begin = end) {
    for (std::size_t triangles = 0;
         end < labels && end - begin < kLabelsAtOnce && triangles < kTrianglesAtOnce; ++end) {
      triangles += surface.surfaces[end].triangles.size();
    }
    std::vector<std::vector<Encoded>> encoded(end - begin);
    mesh::parallel_for(quiet, encoded.size(), [&](std::size_t task) {
      const mesh::Mesh& mesh = surface.surfaces[begin + task].mesh;
      for (const MeshFormat format : formats) {
        encoded[task].push_back(encode_one(mesh, format, grid, provenance, quiet));
      }
    });
    for (std::size_t n = begin; n < end; ++n) {
      const std::string name = names.of(surface.labels[n]);
      for (std::size_t f = 0; f < formats.size(); ++f) {
        Encoded& file = encoded[n - begin][f];
        const std::string suffix(file_suffix(formats[f]));
        const std::uint64_t offset = zip.add(name + '.' + suffix, file.bytes);
        files[n][formats[f]] = {.bytes = file.bytes.size(),
                                .sha256 = std::move(file.sha256),
                                .offset = offset,
                                .href = {}};
      }
    }
    if (context.progress) context.progress(static_cast<double>(end) / static_cast<double>(labels));
  }
  zip.finish();
  return files;
}

}  // namespace isomesh::codec
