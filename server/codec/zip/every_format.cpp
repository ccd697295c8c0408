// The encoder of each format. They are told here, in the one folder that knows them all: some
// formats are ZIPs, and only what makes meshes links the library that writes those.
#include "proto/error.h"
#include "server/codec/encode.h"
#include "server/codec/encode_labels.h"
#include "server/codec/zip/threemf.h"

namespace isomesh::codec {

std::optional<mesh::Topology> encode(const mesh::Mesh& mesh, MeshFormat format,
                                     const Provenance& provenance, const mesh::Context& context,
                                     const Sink& sink, const mesh::TriangleGrid* extracted) {
  switch (format) {
    case MeshFormat::kDrc:
      return encode_drc(mesh, provenance.parameters.draco, context, sink);
    case MeshFormat::kGlb:
      return encode_glb(mesh, provenance, context, sink, extracted);
    case MeshFormat::kStl:
      encode_stl(mesh, context, sink);
      return std::nullopt;
    case MeshFormat::kPly:
      encode_ply(mesh, context, sink);
      return std::nullopt;
    case MeshFormat::kObj:
      encode_obj(mesh, context, sink);
      return std::nullopt;
    case MeshFormat::k3mf:
      return encode_3mf(mesh, provenance, context, sink);
    case MeshFormat::kZip:
      break;
  }
  throw Error(ErrorCode::kInternal, "a ZIP holds labels, not one surface");
}

void encode_labels(const LabelledSurface& surface, MeshFormat format, const Provenance& provenance,
                   const mesh::Context& context, const Sink& sink) {
  switch (format) {
    case MeshFormat::kGlb:
      return encode_labels_glb(surface, provenance, context, sink);
    case MeshFormat::kPly:
      return encode_labels_ply(surface, context, sink);
    case MeshFormat::kObj:
      return encode_labels_obj(surface, context, sink);
    case MeshFormat::k3mf:
      return encode_labels_3mf(surface, provenance, context, sink);
    case MeshFormat::kDrc:
    case MeshFormat::kStl:
    case MeshFormat::kZip:
      break;
  }
  throw Error(ErrorCode::kInternal, "a file of that format does not hold all labels");
}

}  // namespace isomesh::codec
