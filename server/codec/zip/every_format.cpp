// Calls each format's encoder. It is in the one folder that knows them all: some formats are ZIPs,
// and only the program that makes meshes links the ZIP library.
#include "proto/error.h"
#include "server/codec/encode.h"
#include "server/codec/encode_labels.h"
#include "server/codec/space.h"
#include "server/codec/zip/threemf.h"

namespace isomesh::codec {

std::optional<mesh::Topology> encode(const mesh::Mesh& mesh, MeshFormat format,
                                     const Provenance& provenance, const mesh::Context& context,
                                     const Sink& sink, const mesh::TriangleGrid* extracted) {
  const Space space = space_of(format, provenance.parameters);
  switch (format) {
    case MeshFormat::kDrc:
      if (space == Space::kLps) {
        return encode_drc(mesh, provenance.parameters.draco, context, sink);
      }
      return encode_drc(copy_in_space(mesh, space), provenance.parameters.draco, context, sink);
    case MeshFormat::kGlb:
      return encode_glb(mesh, provenance, context, sink, extracted);
    case MeshFormat::kStl:
      encode_stl(mesh, space, context, sink);
      return std::nullopt;
    case MeshFormat::kPly:
      encode_ply(mesh, space, context, sink);
      return std::nullopt;
    case MeshFormat::kObj:
      encode_obj(mesh, space, context, sink);
      return std::nullopt;
    case MeshFormat::kOff:
      encode_off(mesh, space, context, sink);
      return std::nullopt;
    case MeshFormat::kVtk:
      encode_vtk(mesh, space, context, sink);
      return std::nullopt;
    case MeshFormat::kVtp:
      encode_vtp(mesh, provenance, context, sink);
      return std::nullopt;
    case MeshFormat::kGii:
      encode_gii(mesh, provenance, context, sink);
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
  const Space space = space_of(format, provenance.parameters);
  switch (format) {
    case MeshFormat::kGlb:
      return encode_labels_glb(surface, provenance, context, sink);
    case MeshFormat::kPly:
      return encode_labels_ply(surface, space, context, sink);
    case MeshFormat::kObj:
      return encode_labels_obj(surface, space, context, sink);
    case MeshFormat::kVtk:
      return encode_labels_vtk(surface, space, context, sink);
    case MeshFormat::kVtp:
      return encode_labels_vtp(surface, provenance, context, sink);
    case MeshFormat::k3mf:
      return encode_labels_3mf(surface, provenance, context, sink);
    case MeshFormat::kDrc:
    case MeshFormat::kStl:
    case MeshFormat::kOff:
    case MeshFormat::kGii:
    case MeshFormat::kZip:
      break;
  }
  throw Error(ErrorCode::kInternal, "a file of that format does not hold all labels");
}

}  // namespace isomesh::codec
