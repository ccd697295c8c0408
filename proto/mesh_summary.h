// What a finished job says about its mesh. Plain values.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace isomesh {

// kZip: one file for each label, in the other formats that are asked for, but glb; else in STL.
enum class MeshFormat { kDrc, kGlb, kStl, kPly, kObj, kZip };

struct MeshFile {
  std::uint64_t bytes = 0;
  std::string sha256;  // hex
  std::string href;    // path on the same server

  bool operator==(const MeshFile&) const = default;
};

// One label's file, which is a part of the ZIP.
struct LabelFile {
  std::uint64_t bytes = 0;
  std::string sha256;        // hex
  std::uint64_t offset = 0;  // of its first byte in the ZIP
  std::string href;          // path on the same server

  bool operator==(const LabelFile&) const = default;
};

// One label of a finished job: the samples that have it, and its own surface after smoothing. What
// two labels share is in the surfaces of both.
struct LabelSummary {
  std::int64_t label = 0;
  std::optional<std::string> name = {};
  std::optional<std::string> color = {};  // "#rrggbb"
  std::uint64_t voxels = 0;
  double voxels_mm3 = 0;
  std::uint64_t triangles = 0;
  std::uint64_t vertices = 0;
  bool closed = false;
  bool manifold = false;
  bool oriented = false;
  std::uint64_t components = 0;
  double area_mm2 = 0;
  double volume_mm3 = 0;  // that it encloses
  std::map<MeshFormat, LabelFile> files = {};

  bool operator==(const LabelSummary&) const = default;
};

// How a quantity is spread over the triangles of a mesh. All zero when there are none.
struct Distribution {
  static constexpr std::size_t kBins = 20;

  double mean = 0;
  double min = 0;
  std::array<std::uint64_t, kBins> histogram = {};  // measured triangles in equal bins from zero on

  bool operator==(const Distribution&) const = default;
};

// How good a mesh is.
struct MeshQuality {
  struct Stages {
    Distribution extracted;
    Distribution smoothed;

    bool operator==(const Stages&) const = default;
  };

  bool closed = false;    // no edge belongs to one triangle only
  bool manifold = false;  // at most two triangles at an edge, one fan of them around a vertex
  bool oriented = false;  // neighbours run through their edge in opposite directions
  std::uint64_t components = 0;
  std::optional<std::int64_t> genus;  // handles, all components together; of a closed manifold
  Stages aspect_ratio;                // 2 * inradius / circumradius: 1 is equilateral; bins of 0.05
  Stages smallest_angle_deg;          // of each triangle: 60 is equilateral; bins of 3 degrees

  bool operator==(const MeshQuality&) const = default;
};

// What a finished job says about its mesh. Lengths in millimetres, after smoothing unless named
// otherwise. Of a job by labels: triangles, vertices and areas are those of the walls, each once;
// volumes are those of all labels together; components and boundary edges are those of the labels'
// own surfaces, and quality says what holds for every one of them.
struct MeshSummary {
  struct Enclosed {
    double extracted = 0;
    double smoothed = 0;

    bool operator==(const Enclosed&) const = default;
  };

  // What the filter of components took away.
  struct Dropped {
    std::uint64_t components = 0;
    std::uint64_t triangles = 0;

    bool operator==(const Dropped&) const = default;
  };

  // How far smoothing moved the vertices.
  struct Displacement {
    double mean = 0;
    double max = 0;

    bool operator==(const Displacement&) const = default;
  };

  std::uint64_t triangles = 0;
  std::uint64_t vertices = 0;
  std::uint64_t boundary_edges = 0;
  std::uint64_t components = 0;
  std::int64_t euler = 0;
  Dropped dropped;
  MeshQuality quality;
  double area_mm2 = 0;
  double area_extracted_mm2 = 0;
  Enclosed volume_mm3;
  Displacement displacement_mm;
  std::array<std::array<double, 3>, 2> bounds = {};  // smallest and largest corner; 0 when empty
  std::map<MeshFormat, MeshFile> files;
  std::vector<LabelSummary> labels = {};  // ascending; of a job by labels

  bool operator==(const MeshSummary&) const = default;
};

}  // namespace isomesh
