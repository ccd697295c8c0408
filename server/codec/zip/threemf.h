// 3MF, which is a ZIP: "3D Manufacturing Format, Core Specification & Reference Guide", 3MF
// Consortium, in the Open Packaging Conventions of ECMA-376.
#pragma once

#include <optional>

#include "server/codec/encode.h"
#include "server/codec/encode_labels.h"

namespace isomesh::codec {

// One object in millimetres, in the space of the parameters; numbers as the shortest text that
// reads as the same float. Of the type "model", which printers print, where the surface is closed,
// manifold and oriented; of the type "surface" otherwise, since a "model" has to be all that. An
// empty surface is a file without an object. The metadata has what asset.extras of GLB has.
// Formatted side by side and deflated by one thread, in some megabytes of memory; the bytes do not
// depend on the number of threads. Returns the mesh's topology, which it measures. Throws Error
// kInternal when the library that writes ZIPs refuses, and kCancelled.
std::optional<mesh::Topology> encode_3mf(const mesh::Mesh& mesh, const Provenance& provenance,
                                         const mesh::Context& context, const Sink& sink);

// An object for each label that has triangles, with the label's title as its name, its value as its
// part number, and its colour: each with vertices of its own, whose places are the same as in the
// labels next to it. Holds one label's surface. Throws as encode_3mf does.
void encode_labels_3mf(const LabelledSurface& surface, const Provenance& provenance,
                       const mesh::Context& context, const Sink& sink);

}  // namespace isomesh::codec
