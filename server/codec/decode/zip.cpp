#include <utility>

#include "server/codec/decode/formats.h"
#include "server/codec/decode/zip_reader.h"
#include "server/mesh/parallel.h"

namespace isomesh::codec {
namespace {

struct Packed {
  MeshFormat format;
  std::vector<std::byte> bytes;
};

MeshFormat format_of(const std::string& name) {
  const auto format = from_string<MeshFormat>(name.substr(name.rfind('.') + 1));
  if (!format || *format == MeshFormat::kZip) {
    decoding::refuse(MeshFormat::kZip, "a file in it has no known suffix");
  }
  return *format;
}

std::vector<Packed> unpack(decoding::Bytes file, const mesh::Context& context) {
  std::vector<Packed> files;
  decoding::ZipReader reader(file, MeshFormat::kZip);
  while (const auto name = reader.next()) {
    context.throw_if_stopped();
    Packed& packed = files.emplace_back(Packed{format_of(*name), {}});
    reader.read([&](decoding::Bytes piece) {
      packed.bytes.insert(packed.bytes.end(), piece.begin(), piece.end());
    });
  }
  return files;
}

}  // namespace

std::map<MeshFormat, DecodedSurface> decode_zip(std::span<const std::byte> file, Space space,
                                                const mesh::Context& context) {
  MeshParameters parameters;
  parameters.space = space;
  std::vector<Packed> files = unpack(file, context);
  std::vector<DecodedSurface> surfaces(files.size());
  mesh::parallel_for(context, files.size(), [&](std::size_t n) {
    const std::vector<std::byte> bytes = std::move(files[n].bytes);
    const Space own = space_of(files[n].format, parameters);
    surfaces[n] = decode(bytes, files[n].format, own, {context.stop, nullptr});
  });
  std::map<MeshFormat, std::vector<DecodedSurface>> parts;
  for (std::size_t n = 0; n < files.size(); ++n) {
    parts[files[n].format].push_back(std::move(surfaces[n]));
  }
  std::map<MeshFormat, DecodedSurface> joined;
  for (auto& [format, of_format] : parts) {
    joined[format] = decoding::join(std::move(of_format), context);
  }
  return joined;
}

}  // namespace isomesh::codec
