// The walls between the labels of a segmentation -> bytes of a file format.
#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <span>
#include <string>

#include "proto/types.h"
#include "server/codec/encode.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/label_surface.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/measure/triangle_grid.h"

namespace isomesh::codec {

// The input of encoders of labels. All of it must outlive the encoding.
struct LabelledSurface {
  const mesh::SeparatingSurface& walls;
  const mesh::LabelTriangles& triangles;
  std::span<const LabelSummary> labels;  // in the order of the walls' own
  // The walls as extracted; for files with distances.
  const mesh::TriangleGrid* extracted = nullptr;
};

// A label's name in files; "label 3" if it has none.
std::string title_of(const LabelSummary& label);

// Its colour: red, green and blue from 0 to 1, in sRGB. Without a colour of its own, a fixed series
// determines it from the label's value.
std::array<double, 3> color_of(const LabelSummary& label);

// A channel in linear light, as glTF and USD want it (IEC 61966-2-1).
double linear_of(double srgb);

// Binary glTF 2.0 as in encode_glb (encode.h), with a node, a mesh and a material per label, below
// the node that transforms LPS millimetres to glTF's metres. A node has the label's title, and
// label, voxels, volume_mm3 and area_mm2 as extras. All labels share one quantisation grid: shared
// walls decode to the same bits. Each label's node has its own coarser levels; the walls are
// simplified together, so shared walls match there too. Throws as encode_glb does.
void encode_labels_glb(const LabelledSurface& surface, const Provenance& provenance,
                       const mesh::Context& context, const Sink& sink);

// Binary PLY as encode_ply writes it, with an int property `label` of faces. Every label's surface
// is complete and oriented outward: a face between two labels occurs once for each. Throws Error
// kCancelled.
void encode_labels_ply(const LabelledSurface& surface, const Frame& frame,
                       const mesh::Context& context, const Sink& sink);

// Names the groups of an OBJ: a label's title with blanks replaced; equal titles get the label's
// value appended. Names follow from the order of the calls: all labels, ascending.
class ObjGroups {
 public:
  std::string of(const LabelSummary& label);

 private:
  std::set<std::string> taken_;
};

// A label's material in an MTL file: its diffuse colour, in sRGB as programs that write MTL do.
std::string mtl_material(const std::string& group, const LabelSummary& label);

// OBJ as encode_obj writes it, with a group of faces per label. A group uses the material of the
// same name, but the file names no library (mtllib). Surfaces are complete, as in PLY. Throws Error
// kCancelled.
void encode_labels_obj(const LabelledSurface& surface, const Frame& frame,
                       const mesh::Context& context, const Sink& sink);

// VTK's legacy and XML files as encode_vtk and encode_vtp write them, with each triangle's label as
// the cell data `label`. Surfaces are complete, as in PLY. They throw as those do.
void encode_labels_vtk(const LabelledSurface& surface, const Frame& frame,
                       const mesh::Context& context, const Sink& sink);
void encode_labels_vtp(const LabelledSurface& surface, const Provenance& provenance,
                       const mesh::Context& context, const Sink& sink);

// An object per label that has triangles, with its title as the name, its value as the part number,
// and its colour. Objects have their own vertices, at the same positions as adjacent labels. Holds
// one label's surface in memory. Throws as encode_3mf does.
void encode_labels_3mf(const LabelledSurface& surface, const Provenance& provenance,
                       const mesh::Context& context, const Sink& sink);

// A Mesh prim and a material for each label that has triangles, named by its title as an
// identifier; equal names get the label's value appended. The title is its displayName, the value
// is in its custom data. Meshes have their own vertices, at the same positions as adjacent labels.
// Holds one label's surface in memory. Throws as encode_usda does.
void encode_labels_usda(const LabelledSurface& surface, const Provenance& provenance,
                        MeshFormat format, const mesh::Context& context, const Sink& sink);

// A package as encode_usdz writes it, with a USDA of all labels.
void encode_labels_usdz(const LabelledSurface& surface, const Provenance& provenance,
                        const mesh::Context& context, const Sink& sink);

}  // namespace isomesh::codec
