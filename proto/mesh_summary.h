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

// kVtk: VTK's legacy file, kVtp: its XML file, kGii: GIFTI. kZip: one file for each label, in the
// other formats that are asked for, but glb and 3mf; else in STL.
enum class MeshFormat { kDrc, kGlb, kStl, kPly, kObj, k3mf, kOff, kVtk, kVtp, kGii, kZip };

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

// The file that holds a job's labels when they are too many for its record
// (server/jobs/label_pages.h).
struct LabelListFile {
  std::uint64_t bytes = 0;
  std::string sha256;  // hex

  bool operator==(const LabelListFile&) const = default;
};

// How a quantity is spread over the triangles of a mesh. All zero when there are none.
struct Distribution {
  static constexpr std::size_t kBins = 20;

  double mean = 0;
  double min = 0;
  std::array<std::uint64_t, kBins> histogram = {};  // measured triangles in equal bins from zero on

  bool operator==(const Distribution&) const = default;
};

// Where a surface runs through itself.
struct SelfIntersections {
  std::uint64_t pairs = 0;                         // of triangles that intersect
  std::uint64_t triangles = 0;                     // that intersect any other
  std::vector<std::array<double, 3>> places = {};  // of the first pairs, in mm, LPS; 100 at most

  bool operator==(const SelfIntersections&) const = default;
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
  // Whether the volumes are what the surface encloses. Those of an open surface depend on the point
  // that they are summed from, and mean nothing by themselves.
  bool encloses_volume = false;
  std::optional<SelfIntersections> self_intersections = {};  // of a job that is certified

  bool operator==(const MeshQuality&) const = default;
};

// Distances from points of one surface, its vertices and the centres of its triangles, to the
// nearest points of another one's triangles. Exact, in double precision, but kept in single.
struct DistanceSummary {
  static constexpr std::size_t kBins = 20;

  std::uint64_t points = 0;
  double max_mm = 0;
  double mean_mm = 0;
  double rms_mm = 0;
  double p99_mm = 0;  // 99 of 100 points are this near: the smallest distance that is one of them
  std::array<std::uint64_t, kBins> histogram = {};  // points, in equal bins from zero to max_mm

  bool operator==(const DistanceSummary&) const = default;
};

// How max_error_mm was shared out; the three make it up.
struct ErrorBudget {
  double smoothing = 0;       // the farthest that it moved a vertex
  double quantisation = 0;    // the most that rounding a file's coordinates moves one
  double simplification = 0;  // the rest

  bool operator==(const ErrorBudget&) const = default;
};

// How far the files are from the surface as it was extracted, before it was smoothed.
struct MeshCertificate {
  MeshFormat file = MeshFormat::kDrc;         // of several the one that is farthest
  double max_mm = 0;                          // both ways
  DistanceSummary from_mesh;                  // shows what has been added
  DistanceSummary from_extracted;             // shows what has been left out
  std::optional<ErrorBudget> budget_mm = {};  // where max_error_mm is given

  bool operator==(const MeshCertificate&) const = default;
};

// What simplification did.
struct Simplification {
  enum class Bound { kError, kTriangles, kTopology };

  std::uint64_t triangles_before = 0;
  // What kept it from going on: the error, the number of triangles that it was to reach, or, above
  // that number, the surface itself: whatever goes, it would be of another kind.
  Bound bound_by = Bound::kError;

  bool operator==(const Simplification&) const = default;
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

  std::optional<double> iso = {};  // the value that was used; none by labels
  bool empty = false;              // there is no surface
  std::uint64_t triangles = 0;
  std::uint64_t vertices = 0;
  std::uint64_t boundary_edges = 0;
  std::uint64_t components = 0;
  std::int64_t euler = 0;
  Dropped dropped;
  std::optional<Simplification> simplified = {};  // of a job that asks for fewer triangles
  MeshQuality quality;
  double area_mm2 = 0;
  double area_extracted_mm2 = 0;
  Enclosed volume_mm3;
  Displacement displacement_mm;
  std::array<std::array<double, 3>, 2> bounds = {};  // smallest and largest corner; 0 when empty
  std::map<MeshFormat, MeshFile> files;
  // Of a job by labels, ascending. Jobs with more than kMostListedLabels have their number and a
  // file of them instead. Only records name that file.
  std::vector<LabelSummary> labels = {};
  std::optional<std::uint64_t> labels_count = {};
  std::optional<LabelListFile> label_list = {};
  static constexpr std::size_t kMostListedLabels = 256;
  std::optional<MeshCertificate> certificate = {};

  bool operator==(const MeshSummary&) const = default;
};

}  // namespace isomesh
