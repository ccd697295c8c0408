// A mesh, or the walls between the labels of a segmentation -> bytes of a file format.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/types.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/label_surface.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/measure/triangle_grid.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::codec {

struct Grid;

// Takes the encoded bytes, in order. It may throw, which ends the encoding.
using Sink = std::function<void(std::span<const std::byte>)>;

inline void put_text(const Sink& sink, std::string_view text) {
  sink(std::as_bytes(std::span(text)));
}

// The origin of a mesh: all parameters, beside the samples, that determine its bytes. No owner, no
// host, nothing of the job.
struct Provenance {
  std::string samples;  // Volume::samples
  MeshParameters parameters;
  double iso = 0;  // the value used, also for Otsu's threshold
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  Geometry geometry;
  std::vector<Note> notes;  // of the volume; only those that meshes carry
};

// A surface of all labels.
struct LabelledSurface {
  const mesh::SeparatingSurface& walls;
  std::span<const mesh::LabelSurface> surfaces;  // of each label, in the order of the walls' own
  std::span<const LabelSummary> labels;          // in the same order
  // The walls as extracted; for files with distances.
  const mesh::TriangleGrid* extracted = nullptr;
};

// The content of a file. All of it must outlive the encoding.
struct FileContent {
  const mesh::Mesh& mesh;  // the walls of the labels, if there are any
  const Provenance& provenance;
  MeshFormat format = MeshFormat::kDrc;  // named by errors
  // The space and the unit of the file's coordinates. Headers tell both.
  Space space = Space::kLps;
  LengthUnit unit = length_unit({});
  const mesh::TriangleGrid* extracted = nullptr;  // the surface to measure distances from
  const LabelledSurface* labels = nullptr;        // null for one surface
};

// Encoders of one format each. They throw Error kCancelled. A surface of labels contains each
// label's own surface, complete and oriented outward: a wall between two labels occurs once for
// each. An encoder returns the topology of one surface if it found it on the way; it equals
// measure_topology's. Positions are converted to the content's space. Except for Draco, GLB and
// formats that hold a label's surface, files are streamed in a few megabytes of memory. The bytes
// never depend on the number of threads.
using Encoder = std::optional<mesh::Topology>(const FileContent& content,
                                              const mesh::Context& context, const Sink& sink);

// True if our own Draco encoder, and not libdraco, encodes oriented manifolds without distances
// with these parameters.
bool is_own_draco(const DracoParameters& draco);

// One Draco stream of the whole mesh (edgebreaker connectivity; sequential at speed 10), in LPS
// millimetres. Positions are quantised to draco.position_bits bits on a cubic grid that encloses
// the mesh, so a decoded vertex is within half a grid step along each axis. The stream keeps the
// number of vertices and triangles. `grid`, if given, replaces the mesh's own. Thread safe. Throws
// Error kUnusableVolume if a position is not finite, kInternal if libdraco fails, and kCancelled,
// which libdraco's one call does not check.
std::optional<mesh::Topology> encode_drc(const mesh::Mesh& mesh, const DracoParameters& draco,
                                         const mesh::Context& context, const Sink& sink,
                                         const Grid* grid = nullptr);

// Binary STL, normals from the winding. Throws Error kTooLarge beyond 2^32 - 1 triangles.
Encoder encode_stl;

// Binary little-endian PLY: vertices as floats, faces as lists of unsigned 32-bit indices. Each
// label has its own vertices, at the same positions as adjacent labels; they have its colour as
// `red`, `green` and `blue`, and its value as `label`. Holds one label's surface in memory. Throws
// Error kTooLarge beyond 2^32 - 1 vertices of labels.
Encoder encode_ply;

// OBJ: numbers as the shortest text that reads as the same float. A label that has triangles is an
// object and a group, with its own vertices at the same positions as adjacent labels. It uses the
// material of the same name in the file kMaterialsName. Holds one label's surface in memory.
Encoder encode_obj;

// Geomview's OFF, as text: numbers as in OBJ. Its comment is at the end.
Encoder encode_off;

// VTK's legacy file of polygonal data, binary (big-endian). The cell data `label` has the label of
// each triangle. Throws Error kTooLarge beyond 2^31 - 1 vertices or corners of triangles.
Encoder encode_vtk;

// VTK's XML file of polygonal data, its arrays appended raw. The field data has the space and the
// members of asset.extras of GLB. Labels are as in encode_vtk. Throws as that does.
Encoder encode_vtp;

// GIFTI 1.0 (Harwell and others, "GIFTI Surface Data Format", 2011): a surface in scanner
// coordinates, RAS, its arrays in base64. Its structure is told as "Other". An empty surface is a
// file without arrays. The metadata has the members of asset.extras of GLB. Throws as encode_vtk
// does.
Encoder encode_gii;

// Binary glTF 2.0: one primitive per block of about 100 000 triangles, each a Draco stream of its
// own (KHR_draco_mesh_compression), encoded in parallel. All share one quantisation grid, so
// vertices on a seam between blocks decode to the same bits, and so do their normals, if requested.
// parameters.glb_codec has other codecs; array_chunk.h describes their arrays. Without one (kNone),
// a surface is one primitive with the mesh's own vertices, which is streamed from the mesh; beside
// it are its normals and distances, one label's surface, and the coarser levels. If it is closed,
// manifold and oriented, EXT_mesh_manifold says so. The topology of one surface is then returned.
//
// Positions are LPS millimetres under a node that transforms them to glTF's metres with Y up. With
// parameters.lods, coarser levels (MSFT_lod) are nodes like that one outside the scene, each
// simplified from the mesh without an error bound, on the same grid. A level without fewer
// triangles than the previous one is omitted. The file starts with the coarsest level. With
// parameters.distances, every level has the attribute _DISTANCE_MM: the distances to the surface
// `extracted`, before coordinates are rounded.
//
// A label has a node, a mesh and a material below that node. Its node has the label's title, and
// label, voxels, area_mm2 and, if it encloses a volume, volume_mm3 as extras. All labels share the
// grid: shared walls decode to the same bits. Each label's node has its own coarser levels; the
// walls are simplified together, so shared walls match there too.
//
// Throws Error kTooLarge beyond GLB's 4 GiB and kInternal if Draco fails. kCancelled is checked
// before each block, and without a codec for each piece that is written.
Encoder encode_glb;

// 3MF, a ZIP: "3D Manufacturing Format, Core Specification & Reference Guide", 3MF Consortium, in
// the Open Packaging Conventions of ECMA-376.
//
// One object in millimetres (angstrom are written as such: 3MF has none); numbers as the shortest
// text that reads as the same float. Its type is "model" whether it is closed or open, because
// slicers reject files with another. Its name is the iso-value. An empty surface is a file without
// an object. The metadata has the members of asset.extras of GLB and no date: equal jobs give equal
// bytes. Deflated by one thread.
//
// A label that has triangles is an object with its title as the name, its value as the part number,
// and its colour ("3MF Materials and Properties Extension", chapter 2). Several are the components
// of one object, all where they are in the volume. Objects have their own vertices, at the same
// positions as adjacent labels. Holds one label's surface in memory. Throws Error kInternal if the
// ZIP library fails.
Encoder encode_3mf;

// The text form of Universal Scene Description, USD ("Pixar Animation Studios, Universal Scene
// Description", openusd.org).
//
// A stage with Y up whose unit is the millimetre: a point (x, y, z) in LPS is (x, z, -y), which
// rounds nothing. Numbers are the shortest text that reads as the same float. One Mesh prim and one
// UsdPreviewSurface, with normals per vertex if the parameters ask for them. An empty surface is a
// stage without a mesh. The layer's custom data has the members of asset.extras of GLB. Holds the
// normals in memory.
//
// A label that has triangles has a Mesh prim and a material, named by its title as an identifier;
// equal names get the label's value appended. The title is its displayName, the value is in its
// custom data. Meshes have their own vertices, at the same positions as adjacent labels. Holds one
// label's surface in memory. Throws as encode_vtk does.
Encoder encode_usda;

// USDZ ("USDZ File Format Specification", version 1.3, openusd.org): a ZIP of files that are not
// compressed and begin at multiples of 64 bytes. It has one file, a USDA of the content. Its size
// and checksum stand before it, so it is formatted twice and never held in memory. Throws as
// encode_usda does, and Error kTooLarge from 4 GiB on: readers of USDZ do not know ZIP64.
Encoder encode_usdz;

}  // namespace isomesh::codec
