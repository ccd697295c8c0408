#include "server/codec/encode.h"

namespace isomesh::codec {

void encode(const mesh::Mesh& mesh, MeshFormat format, const Provenance& provenance,
            const mesh::Context& context, const Sink& sink) {
  const DracoParameters& draco = provenance.parameters.draco;
  switch (format) {
    case MeshFormat::kDrc:
      return encode_drc(mesh, draco, context, sink);
    case MeshFormat::kStl:
      return encode_stl(mesh, context, sink);
    case MeshFormat::kGlb:
      return encode_glb(mesh, provenance, context, sink);
    case MeshFormat::kPly:
      return encode_ply(mesh, context, sink);
    case MeshFormat::kObj:
      return encode_obj(mesh, context, sink);
  }
}

std::string_view media_type(MeshFormat format) {
  switch (format) {
    case MeshFormat::kGlb:
      return "model/gltf-binary";
    case MeshFormat::kStl:
      return "model/stl";
    case MeshFormat::kObj:
      return "model/obj";
    case MeshFormat::kDrc:
    case MeshFormat::kPly:
      break;
  }
  return "application/octet-stream";
}

}  // namespace isomesh::codec
