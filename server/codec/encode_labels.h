// The walls between the labels of a segmentation -> bytes of a file format.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "proto/types.h"
#include "server/codec/encode.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/label_surface.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/measure/triangle_grid.h"

namespace isomesh::codec {

// What the files of labels are made of. All of it must outlive the encoding.
struct LabelledSurface {
  const mesh::SeparatingSurface& walls;
  const mesh::LabelTriangles& triangles;  // of the walls
  std::span<const LabelSummary> labels;   // in the order of the walls' own
  // The walls as they were extracted; for files that ask for the distances to them.
  const mesh::TriangleGrid* extracted = nullptr;
};

// What a label is called in files: its name, or "label 3" where it has none.
std::string title_of(const LabelSummary& label);

// Its colour, red, green and blue from 0 to 1, as a screen has them (sRGB): the one that it has, or
// the one of a fixed series that follows from its value.
std::array<double, 3> color_of(const LabelSummary& label);

// Binary glTF 2.0: as encode_glb (encode.h), with a node, a mesh and a material for each label
// under the one that turns LPS millimetres into glTF's metres. A node has the label's title, and
// label, voxels, volume_mm3 and area_mm2 as extras. All labels share one quantisation grid: what
// two of them have in common decodes to the same bits. Coarser levels are of each label's node; the
// walls are simplified together, so labels have them in common there too. Throws as encode_glb
// does.
void encode_labels_glb(const LabelledSurface& surface, const Provenance& provenance,
                       const mesh::Context& context, const Sink& sink);

// Binary PLY as encode_ply makes it, with an int property `label` of faces. Every label's surface
// is there whole and turned outward: a face between two labels is there for each of them. Throws
// Error kCancelled.
void encode_labels_ply(const LabelledSurface& surface, Space space, const mesh::Context& context,
                       const Sink& sink);

// OBJ as encode_obj makes it, with a group of faces for each label, which has its title, blanks
// replaced; where titles are alike, with its value behind it. As in PLY every label's surface is
// there whole. Throws Error kCancelled.
void encode_labels_obj(const LabelledSurface& surface, Space space, const mesh::Context& context,
                       const Sink& sink);

// VTK's legacy file and its XML file as encode_vtk and encode_vtp make them, with the label of each
// triangle as the cell data `label`. As in PLY every label's surface is there whole. Throw as those
// do.
void encode_labels_vtk(const LabelledSurface& surface, Space space, const mesh::Context& context,
                       const Sink& sink);
void encode_labels_vtp(const LabelledSurface& surface, const Provenance& provenance,
                       const mesh::Context& context, const Sink& sink);

// A format's encoder of all labels, for those of which one file holds them. Throws Error kInternal
// for others, and as that encoder does. A part of the target isomesh_zip.
void encode_labels(const LabelledSurface& surface, MeshFormat format, const Provenance& provenance,
                   const mesh::Context& context, const Sink& sink);

}  // namespace isomesh::codec
