// 3MF, a ZIP: "3D Manufacturing Format, Core Specification & Reference Guide", 3MF Consortium, in
// the Open Packaging Conventions of ECMA-376.
#pragma once

#include <optional>

#include "server/codec/encode.h"
#include "server/codec/encode_labels.h"

namespace isomesh::codec {

// One object in millimetres (angstrom are written as such: 3MF has none), in the space of the
// parameters; numbers as the shortest text that reads as the same float. Its type is "model", for
// printing, if the surface is closed, manifold and oriented, as the type requires; otherwise
// "surface". An empty surface is a file without an object. The metadata has the members of
// asset.extras of GLB. Formatted in parallel and deflated by one thread, in a few megabytes of
// memory; the bytes do not depend on the number of threads. Returns the mesh's measured topology.
// Throws Error kInternal if the ZIP library fails, and kCancelled.
std::optional<mesh::Topology> encode_3mf(const mesh::Mesh& mesh, const Provenance& provenance,
                                         const mesh::Context& context, const Sink& sink);

// An object per label that has triangles, with its title as the name, its value as the part number,
// and its colour. Objects have their own vertices, at the same positions as adjacent labels. Holds
// one label's surface in memory. Throws as encode_3mf does.
void encode_labels_3mf(const LabelledSurface& surface, const Provenance& provenance,
                       const mesh::Context& context, const Sink& sink);

}  // namespace isomesh::codec
