#include <limits>

#include "server/codec/draco_chunk.h"
#include "server/codec/encode.h"

namespace isomesh::codec {

void encode_drc(const mesh::Mesh& mesh, const DracoParameters& draco, const mesh::Context& context,
                const Sink& sink) {
  context.throw_if_stopped();
  if (mesh.triangles.size() > std::numeric_limits<std::uint32_t>::max()) {
    throw Error(ErrorCode::kTooLarge, "the surface has more triangles than Draco can encode");
  }
  const DracoStream stream =
      encode_draco(mesh, whole_block(mesh), grid_of(mesh, draco.position_bits), draco.speed);
  context.throw_if_stopped();
  sink(stream.bytes);
  if (context.progress) context.progress(1);
}

}  // namespace isomesh::codec
