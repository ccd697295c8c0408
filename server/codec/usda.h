// The text form of Universal Scene Description, USD ("Pixar Animation Studios, Universal Scene
// Description", openusd.org). Private to this folder and its subfolders.
#pragma once

#include "server/codec/encode.h"
#include "server/codec/encode_labels.h"

namespace isomesh::codec {

// A stage with Y up whose unit is the millimetre: a point (x, y, z) in LPS is (x, z, -y), which
// rounds nothing. Numbers are the shortest text that reads as the same float. One Mesh prim and one
// UsdPreviewSurface, with normals per vertex if the parameters ask for them. An empty surface is a
// stage without a mesh. The layer's custom data has the members of asset.extras of GLB. Streamed in
// a few megabytes, and the normals. `format` is the one that errors name. Throws Error kTooLarge as
// encode_vtk does, and kCancelled.
void encode_usda(const mesh::Mesh& mesh, const Provenance& provenance, MeshFormat format,
                 const mesh::Context& context, const Sink& sink);

// A Mesh prim and a material for each label that has triangles, named by its title as an
// identifier; equal names get the label's value appended. The title is its displayName, the value
// is in its custom data. Meshes have their own vertices, at the same positions as adjacent labels.
// Holds one label's surface in memory. Throws as encode_usda does.
void encode_labels_usda(const LabelledSurface& surface, const Provenance& provenance,
                        MeshFormat format, const mesh::Context& context, const Sink& sink);

}  // namespace isomesh::codec
