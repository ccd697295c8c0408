// Mesh -> bytes of a file format.
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
#include "server/mesh/measure/triangle_grid.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::codec {

struct Grid;

// The space and the unit of a file's coordinates. Headers tell both.
struct Frame {
  Space space = Space::kLps;
  LengthUnit unit = length_unit({});
};

// Takes the encoded bytes, in order. It may throw, which ends the encoding.
using Sink = std::function<void(std::span<const std::byte>)>;

inline void put_text(const Sink& sink, std::string_view text) {
  sink(std::as_bytes(std::span(text)));
}

// True if our own Draco encoder, and not libdraco, encodes oriented manifolds without distances
// with these parameters.
bool is_own_draco(const DracoParameters& draco);

// One Draco stream of the whole mesh (edgebreaker connectivity; sequential at speed 10), in LPS
// millimetres. Positions are quantised to draco.position_bits bits on a cubic grid that encloses
// the mesh, so a decoded vertex is within half a grid step along each axis. The stream keeps the
// number of vertices and triangles. The bytes do not depend on the number of threads. `grid`, if
// given, replaces the mesh's own. Thread safe. Returns the mesh's topology if our own encoder found
// it on the way; it equals measure_topology's. Throws Error kUnusableVolume if a position is not
// finite, kInternal if libdraco fails, and kCancelled, which libdraco's one call does not check.
std::optional<mesh::Topology> encode_drc(const mesh::Mesh& mesh, const DracoParameters& draco,
                                         const mesh::Context& context, const Sink& sink,
                                         const Grid* grid = nullptr);

// Binary STL, normals from the winding. This and all other formats except Draco, GLB and ZIP are
// streamed in a few megabytes of memory and formatted in parallel; the bytes do not depend on the
// number of threads. Positions are in the frame's unit. Throws Error kTooLarge beyond 2^32 - 1
// triangles, and kCancelled.
void encode_stl(const mesh::Mesh& mesh, const Frame& frame, const mesh::Context& context,
                const Sink& sink);

// Binary little-endian PLY: vertices as floats, faces as lists of unsigned 32-bit indices. Throws
// Error kCancelled.
void encode_ply(const mesh::Mesh& mesh, const Frame& frame, const mesh::Context& context,
                const Sink& sink);

// OBJ: numbers as the shortest text that reads as the same float. Throws Error kCancelled.
void encode_obj(const mesh::Mesh& mesh, const Frame& frame, const mesh::Context& context,
                const Sink& sink);

// Geomview's OFF, as text: numbers as in OBJ. Throws Error kCancelled.
void encode_off(const mesh::Mesh& mesh, const Frame& frame, const mesh::Context& context,
                const Sink& sink);

// VTK's legacy file of polygonal data, binary (big-endian). Throws Error kTooLarge beyond 2^31 - 1
// vertices or corners of triangles, and kCancelled.
void encode_vtk(const mesh::Mesh& mesh, const Frame& frame, const mesh::Context& context,
                const Sink& sink);

// The origin of a mesh: all parameters, beside the samples, that determine its bytes. No owner, no
// host, nothing of the job.
struct Provenance {
  std::string volume;
  MeshParameters parameters;
  double iso = 0;  // the value used, also for Otsu's threshold
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  Geometry geometry;
  std::vector<Note> notes;  // of the volume; only those that meshes carry
};

// VTK's XML file of polygonal data, its arrays appended raw. The field data has the space and the
// members of asset.extras of GLB. Throws as encode_vtk does.
void encode_vtp(const mesh::Mesh& mesh, const Provenance& provenance, const mesh::Context& context,
                const Sink& sink);

// GIFTI 1.0 (Harwell and others, "GIFTI Surface Data Format", 2011): a surface in scanner
// coordinates, RAS, its arrays in base64. An empty surface is a file without arrays. The metadata
// has the members of asset.extras of GLB. Throws as encode_vtk does.
void encode_gii(const mesh::Mesh& mesh, const Provenance& provenance, const mesh::Context& context,
                const Sink& sink);

// Binary glTF 2.0: one primitive per block of about 100 000 triangles, each a Draco stream of its
// own (KHR_draco_mesh_compression), encoded in parallel. All share one quantisation grid, so
// vertices on a seam between blocks decode to the same bits, and so do their normals, if requested.
// Positions are LPS millimetres under a node that transforms them to glTF's metres with Y up. With
// parameters.lods, coarser levels (MSFT_lod) are nodes like that one outside the scene, each
// simplified from the mesh without an error bound, on the same grid. A level without fewer
// triangles than the previous one is omitted. The file starts with the coarsest level. With
// parameters.distances, every level has the attribute _DISTANCE_MM: the distances to the surface
// `extracted`, before coordinates are rounded. The bytes do not depend on the number of threads.
// Returns the topology as encode_drc does. Throws Error kTooLarge beyond GLB's 4 GiB, kInternal if
// Draco fails, and kCancelled, checked before each block.
std::optional<mesh::Topology> encode_glb(const mesh::Mesh& mesh, const Provenance& provenance,
                                         const mesh::Context& context, const Sink& sink,
                                         const mesh::TriangleGrid* extracted = nullptr);

// 3MF, a ZIP: "3D Manufacturing Format, Core Specification & Reference Guide", 3MF Consortium, in
// the Open Packaging Conventions of ECMA-376.
//
// One object in millimetres (angstrom are written as such: 3MF has none), in the space of the
// parameters; numbers as the shortest text that reads as the same float. Its type is "model", for
// printing, if the surface is closed, manifold and oriented, as the type requires; otherwise
// "surface". An empty surface is a file without an object. The metadata has the members of
// asset.extras of GLB. Formatted in parallel and deflated by one thread, in a few megabytes of
// memory; the bytes do not depend on the number of threads. Returns the mesh's measured topology.
// Throws Error kInternal if the ZIP library fails, and kCancelled.
std::optional<mesh::Topology> encode_3mf(const mesh::Mesh& mesh, const Provenance& provenance,
                                         const mesh::Context& context, const Sink& sink);

// The text form of Universal Scene Description, USD ("Pixar Animation Studios, Universal Scene
// Description", openusd.org).
//
// A stage with Y up whose unit is the millimetre: a point (x, y, z) in LPS is (x, z, -y), which
// rounds nothing. Numbers are the shortest text that reads as the same float. One Mesh prim and one
// UsdPreviewSurface, with normals per vertex if the parameters ask for them. An empty surface is a
// stage without a mesh. The layer's custom data has the members of asset.extras of GLB. Streamed in
// a few megabytes, and the normals. `format` is the one that errors name. Throws Error kTooLarge as
// encode_vtk does, and kCancelled.
void encode_usda(const mesh::Mesh& mesh, const Provenance& provenance, MeshFormat format,
                 const mesh::Context& context, const Sink& sink);

// USDZ ("USDZ File Format Specification", version 1.3, openusd.org): a ZIP of files that are not
// compressed and begin at multiples of 64 bytes. It has one file, a USDA of the surface. Its size
// and checksum stand before it, so it is formatted twice and never held in memory. The bytes do not
// depend on the number of threads. Throws as encode_usda does, and Error kTooLarge from 4 GiB on:
// readers of USDZ do not know ZIP64.
void encode_usdz(const mesh::Mesh& mesh, const Provenance& provenance, const mesh::Context& context,
                 const Sink& sink);

}  // namespace isomesh::codec
