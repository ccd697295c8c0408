#include <limits>
#include <utility>

#include "server/codec/draco_chunk.h"
#include "server/codec/encode.h"

namespace isomesh::codec {

std::optional<mesh::Topology> encode_drc(const mesh::Mesh& mesh, const DracoParameters& draco,
                                         const mesh::Context& context, const Sink& sink,
                                         const Grid* grid) {
  context.throw_if_stopped();
  if (mesh.triangles.size() > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(
        ErrorCode::kTooLarge,
        "The surface has more triangles than Draco can encode. Set \"triangles\" to simplify it.");
  }
  const DracoOptions options = {grid == nullptr ? grid_of(mesh, draco.position_bits) : *grid,
                                draco.speed};
  auto encoder = Encoders::instance().take(mesh.triangles.size());
  DracoStream stream = encoder->encode_whole(mesh, options, {}, {context.stop, nullptr});
  Encoders::instance().give_back(std::move(encoder));
  context.throw_if_stopped();
  sink(stream.bytes);
  if (context.progress) context.progress(1);
  return topology_of(mesh, {&stream, 1}, {context.stop, nullptr});
}

}  // namespace isomesh::codec
