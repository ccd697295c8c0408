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
#include "server/mesh/extract/extract.h"
#include "server/mesh/measure/triangle_grid.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::codec {

struct Grid;  // draco/grid.h

// Our own Draco encoder walks over all triangles, by which it knows the mesh's topology: same as
// measure_topology's. Encoders that may use it return it where they have.

// Takes the encoded bytes, in order; may throw, which ends the encoding.
using Sink = std::function<void(std::span<const std::byte>)>;

// Whether oriented manifolds without distances are encoded by our own Draco encoder with these
// parameters, and not by libdraco, which takes everything else.
bool is_own_draco(const DracoParameters& draco);

// One Draco stream of the whole mesh (edgebreaker connectivity; sequential at speed 10),
// millimetres in LPS. Positions are quantised to draco.position_bits bits on a cubic grid that
// covers the mesh closely, so that a decoded vertex is within half a grid step of its place along
// each axis. The stream keeps the number of vertices and triangles. The bytes do not depend on the
// number of threads. With a `grid` that is the one, and not the mesh's own. Thread safe. Throws
// Error kUnusableVolume where a position is not finite, kInternal when libdraco refuses, and
// kCancelled, which libdraco's one call does not look at.
std::optional<mesh::Topology> encode_drc(const mesh::Mesh& mesh, const DracoParameters& draco,
                                         const mesh::Context& context, const Sink& sink,
                                         const Grid* grid = nullptr);

// All formats but Draco, GLB and ZIP are written as they go, in some megabytes of memory, formatted
// side by side. Their bytes do not depend on the number of threads. Positions are millimetres.

// Binary STL, normals from the winding. Throws Error kTooLarge beyond 2^32 - 1
// triangles, and kCancelled.
void encode_stl(const mesh::Mesh& mesh, Space space, const mesh::Context& context,
                const Sink& sink);

// Binary little-endian PLY: vertices as floats, faces as lists of unsigned 32-bit indices. Throws
// Error kCancelled.
void encode_ply(const mesh::Mesh& mesh, Space space, const mesh::Context& context,
                const Sink& sink);

// OBJ: numbers as the shortest text that reads as the same float. Throws Error kCancelled.
void encode_obj(const mesh::Mesh& mesh, Space space, const mesh::Context& context,
                const Sink& sink);

// Geomview's OFF, as text: numbers as in OBJ. Throws Error kCancelled.
void encode_off(const mesh::Mesh& mesh, Space space, const mesh::Context& context,
                const Sink& sink);

// VTK's legacy file of polygonal data, binary, which is big-endian. Throws Error kTooLarge beyond
// 2^31 - 1 vertices or corners of triangles, and kCancelled.
void encode_vtk(const mesh::Mesh& mesh, Space space, const mesh::Context& context,
                const Sink& sink);

// What a file says about where its mesh comes from, and all that its bytes follow from beside the
// samples: no owner, no host, nothing of the job that asked.
struct Provenance {
  std::string volume;  // its id
  MeshParameters parameters;
  double iso = 0;  // the value that was used, also where parameters say Otsu
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  Geometry geometry;
  std::vector<Note> notes;  // of the volume, those that stand in meshes
};

// VTK's XML file of polygonal data, its arrays appended as they are; the field data has the space
// and what asset.extras of GLB has. Throws as encode_vtk does.
void encode_vtp(const mesh::Mesh& mesh, const Provenance& provenance, const mesh::Context& context,
                const Sink& sink);

// GIFTI 1.0 (Harwell and others, "GIFTI Surface Data Format", 2011): a surface in scanner
// coordinates, RAS, its arrays in base64; an empty surface is a file without arrays. The metadata
// has what asset.extras of GLB has. Throws as encode_vtk does.
void encode_gii(const mesh::Mesh& mesh, const Provenance& provenance, const mesh::Context& context,
                const Sink& sink);

// Binary glTF 2.0: the mesh as one primitive for each block of some 100 000 triangles, each a Draco
// stream of its own (KHR_draco_mesh_compression), encoded side by side. All share one quantisation
// grid, so vertices on a seam between blocks decode to the same bits, and so do their normals,
// which are there when the parameters ask for them. Positions are LPS millimetres under a node that
// turns them into glTF's metres with Y up. With parameters.lods, coarser levels (MSFT_lod) are
// nodes like that one outside the scene, each simplified from the mesh without a bound of its error
// and on the same grid, one that has no fewer triangles than the level before left out; in the file
// the coarsest comes first. With parameters.distances, `extracted` is the surface that they are
// measured to, before coordinates are rounded: the attribute _DISTANCE_MM of every level. The bytes
// do not depend on the number of threads. Throws Error kTooLarge beyond the 4 GiB that GLB can
// hold, kInternal when Draco refuses, and kCancelled, looked at before each block.
std::optional<mesh::Topology> encode_glb(const mesh::Mesh& mesh, const Provenance& provenance,
                                         const mesh::Context& context, const Sink& sink,
                                         const mesh::TriangleGrid* extracted = nullptr);

// What the server knows of a format. Its name, which is a file's suffix as well, is in proto. Times
// and sizes are first guesses, from a head of five million triangles on two cores.
struct Format {
  MeshFormat format;
  std::string_view media_type;  // application/octet-stream where none is registered
  double milliseconds_per_triangle;
  // Of the file.
  double (*bytes)(const mesh::SurfaceSize& surface, const MeshParameters& parameters);
  // What encoding takes at its peak, beside the mesh; an upper estimate.
  std::uint64_t (*memory_bytes)(const mesh::SurfaceSize& surface, const MeshParameters& parameters);
  // Whether encoding nearly always shows the mesh's topology on its way.
  bool (*shows_topology)(const MeshParameters& parameters);
};

// Whether a job's file of that format rounds coordinates, or holds files that do: drc, glb, and a
// ZIP of drc. All others hold the floats of the mesh, turned to the file's space, which rounds
// nothing, and its triangles; of labels the triangles of each label's own surface.
bool rounds(MeshFormat format, const MeshParameters& parameters);

// The format's row in the one table of them; constant time.
const Format& describe(MeshFormat format);

// As the format's encoder does; `extracted` is for GLB with distances alone. 3MF's is in
// zip/threemf.h. Returns the mesh's topology where encoding it has shown that. A part of the target
// isomesh_zip.
std::optional<mesh::Topology> encode(const mesh::Mesh& mesh, MeshFormat format,
                                     const Provenance& provenance, const mesh::Context& context,
                                     const Sink& sink,
                                     const mesh::TriangleGrid* extracted = nullptr);

}  // namespace isomesh::codec
