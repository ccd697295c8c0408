// A finished job's report on its mesh. Plain values.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/notes.h"

namespace isomesh {

// kUsda: USD's text. kUsdz: that in a package. kVtk: VTK's legacy file. kVtp: VTK's XML file. kGii:
// GIFTI. kZip: one file per label in each other requested format except glb, 3mf, usda and usdz;
// STL if there is none.
enum class MeshFormat {
  kDrc,
  kGlb,
  kStl,
  kPly,
  kObj,
  k3mf,
  kUsda,
  kUsdz,
  kOff,
  kVtk,
  kVtp,
  kGii,
  kZip
};

enum class Space { kLps, kRas };  // directions of a file's x, y and z

// What clients know of a format, too. The server's own row is in server/codec/formats.cpp.
struct FormatRow {
  MeshFormat format;
  std::string_view name;
  std::string_view title;             // for people
  std::string_view file_suffix = {};  // ends offered names; empty: the format's name
  // A job by labels writes one file of all labels, a file of each label in a ZIP, or both.
  bool holds_all_labels = false;
  bool is_zipped = true;
  std::optional<Space> own_space = {};  // of a format that defines its space
};

inline constexpr std::array kFormatRows = {
    FormatRow{.format = MeshFormat::kDrc, .name = "drc", .title = "Draco"},
    FormatRow{.format = MeshFormat::kGlb,
              .name = "glb",
              .title = "GLB",
              .holds_all_labels = true,
              .is_zipped = false,
              .own_space = Space::kLps},
    FormatRow{.format = MeshFormat::kStl, .name = "stl", .title = "STL"},
    FormatRow{.format = MeshFormat::kPly, .name = "ply", .title = "PLY", .holds_all_labels = true},
    FormatRow{.format = MeshFormat::kObj, .name = "obj", .title = "OBJ", .holds_all_labels = true},
    FormatRow{.format = MeshFormat::k3mf,
              .name = "3mf",
              .title = "3MF",
              .holds_all_labels = true,
              .is_zipped = false},
    FormatRow{.format = MeshFormat::kUsda,
              .name = "usda",
              .title = "USD (text)",
              .holds_all_labels = true,
              .is_zipped = false,
              .own_space = Space::kLps},
    FormatRow{.format = MeshFormat::kUsdz,
              .name = "usdz",
              .title = "USDZ",
              .holds_all_labels = true,
              .is_zipped = false,
              .own_space = Space::kLps},
    FormatRow{.format = MeshFormat::kOff, .name = "off", .title = "OFF"},
    FormatRow{.format = MeshFormat::kVtk, .name = "vtk", .title = "VTK", .holds_all_labels = true},
    FormatRow{.format = MeshFormat::kVtp, .name = "vtp", .title = "VTP", .holds_all_labels = true},
    FormatRow{.format = MeshFormat::kGii,
              .name = "gii",
              .title = "GIFTI",
              .file_suffix = "surf.gii",  // Connectome Workbench tells GIFTI's kinds by their names
              .own_space = Space::kRas},
    FormatRow{
        .format = MeshFormat::kZip, .name = "zip", .title = "ZIP of labels", .is_zipped = false}};

static_assert([] {
  constexpr auto kFormats = static_cast<std::size_t>(MeshFormat::kZip) + 1;  // it stays the last
  for (std::size_t number = 0; number < kFormats; ++number) {
    if (std::ranges::count(kFormatRows, static_cast<MeshFormat>(number), &FormatRow::format) != 1)
      return false;
  }
  return true;
}());

// The name by which an OBJ of labels refers to the file of its materials.
inline constexpr std::string_view kMaterialsName = "mesh.mtl";

struct MeshFile {
  std::uint64_t bytes = 0;
  std::string sha256;  // hex
  std::string href;    // path on the same server

  bool operator==(const MeshFile&) const = default;
};

struct LabelFile {
  std::uint64_t bytes = 0;
  std::string sha256;        // hex
  std::uint64_t offset = 0;  // of its first byte in the ZIP
  std::string href;          // path on the same server

  bool operator==(const LabelFile&) const = default;
};

// True if a surface encloses the volume that the sum over its triangles gives. An open surface
// encloses nothing, and its sum is no volume. One that is inside out has a negative sum: it is the
// wall of a hollow in something larger.
constexpr bool encloses(bool closed, bool oriented, double volume_mm3) {
  return closed && oriented && volume_mm3 >= 0;
}

// One label of a finished job: its samples, and its own surface after smoothing. A wall between two
// labels belongs to both surfaces.
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
  double volume_mm3 = 0;  // enclosed by the surface, see encloses_volume()
  std::map<MeshFormat, LabelFile> files = {};

  bool encloses_volume() const { return encloses(closed, oriented, volume_mm3); }

  bool operator==(const LabelSummary&) const = default;
};

// The area where two labels of a finished job touch, or one is next to the background, after
// smoothing.
struct WallSummary {
  std::int64_t a = 0;
  std::optional<std::int64_t> b = {};  // greater than `a`; empty: the background
  double area_mm2 = 0;
  // The number of faces that voxels of the two share: 0 where they meet at edges and corners only.
  // A job of an older server has none.
  std::optional<std::uint64_t> faces = {};
  std::optional<std::string> a_name = {};
  std::optional<std::string> b_name = {};

  bool operator==(const WallSummary&) const = default;
};

// The file of a job's walls, or of its labels if they are too many for its record
// (server/jobs/library/label_pages.h).
struct LabelListFile {
  std::uint64_t bytes = 0;
  std::string sha256;  // hex

  bool operator==(const LabelListFile&) const = default;
};

// The distribution of a quantity over the triangles of a mesh. All zero for an empty mesh.
struct Distribution {
  static constexpr std::size_t kBins = 20;

  double mean = 0;
  double min = 0;
  std::array<std::uint64_t, kBins> histogram = {};  // triangles in equal bins from zero

  bool operator==(const Distribution&) const = default;
};

// Intersections of a surface with itself.
struct SelfIntersections {
  std::uint64_t pairs = 0;                         // of triangles that intersect
  std::uint64_t triangles = 0;                     // that intersect another one
  std::vector<std::array<double, 3>> places = {};  // of the first pairs, at most 100; mm, LPS

  bool operator==(const SelfIntersections&) const = default;
};

struct MeshQuality {
  struct Stages {
    Distribution extracted;
    Distribution smoothed;

    bool operator==(const Stages&) const = default;
  };

  bool closed = false;    // no edge belongs to only one triangle
  bool manifold = false;  // at most two triangles at an edge, one fan of them around a vertex
  bool oriented = false;  // neighbours run through their edge in opposite directions
  std::uint64_t components = 0;
  std::optional<std::int64_t> genus;  // handles of all components together; closed manifolds only
  Stages aspect_ratio;                // 2 * inradius / circumradius: 1 is equilateral; bins of 0.05
  Stages smallest_angle_deg;          // of each triangle: 60 is equilateral; bins of 3 degrees
  // True if the volumes are those that the surface encloses. The volumes of an open surface depend
  // on the origin of the sum and are meaningless, and those of one that is inside out are negative.
  bool encloses_volume = false;
  std::optional<SelfIntersections> self_intersections = {};  // only if the job is certified

  bool operator==(const MeshQuality&) const = default;
};

// Distances from points of one surface, its vertices and triangle centres, to the nearest points of
// another surface's triangles. Computed exactly in double precision, stored in single.
struct DistanceSummary {
  static constexpr std::size_t kBins = 20;

  std::uint64_t points = 0;
  double max_mm = 0;
  double mean_mm = 0;
  double rms_mm = 0;
  double p99_mm = 0;  // the smallest distance that at least 99 % of the points do not exceed
  std::array<std::uint64_t, kBins> histogram = {};  // points in equal bins from zero to max_mm

  bool operator==(const DistanceSummary&) const = default;
};

// The shares of max_error_mm; they add up to it.
struct ErrorBudget {
  double smoothing = 0;       // the largest displacement of a vertex; 0 if the reference has it
  double quantisation = 0;    // the largest rounding error of a file's coordinates
  double simplification = 0;  // the remainder

  bool operator==(const ErrorBudget&) const = default;
};

// The deviation of the files from a reference.
struct MeshCertificate {
  // The surface as extracted, before smoothing; or as it is smoothed, before simplification, in
  // jobs that simplify labels.
  enum class Reference { kExtracted, kSmoothed };

  Reference reference = Reference::kExtracted;
  MeshFormat file = MeshFormat::kDrc;            // the file with the largest deviation
  double found_mm = 0;                           // the largest at the samples, in both directions
  std::optional<double> bound_mm = {};           // if proven: no point of any file deviates more
  std::optional<std::string> why_unproven = {};  // otherwise, as a sentence
  DistanceSummary from_mesh;                     // shows what was added
  DistanceSummary from_extracted;                // from the reference; shows what was left out
  std::optional<ErrorBudget> budget_mm = {};     // if max_error_mm is given

  bool operator==(const MeshCertificate&) const = default;
};

// What removing self-intersections found after smoothing, and moved.
struct Untangling {
  std::uint64_t pairs = 0;     // of triangles that intersected
  std::uint64_t vertices = 0;  // moved back towards their extracted positions
  std::uint64_t left = 0;      // pairs that intersect as extracted

  bool operator==(const Untangling&) const = default;
};

// How thick walls are, measured through the material at points of the surface.
struct Thickness {
  std::optional<double> thinnest_mm = {};           // none if no point has a wall behind it
  std::optional<std::array<double, 3>> place = {};  // of that point; mm, LPS
  double thin_area_mm2 = 0;  // of the surface whose wall is thinner than min_thickness_mm

  bool operator==(const Thickness&) const = default;
};

struct Simplification {
  enum class Bound { kError, kTriangles, kTopology };

  std::uint64_t triangles_before = 0;
  // The limit that ended it: the error, the requested number of triangles, or the topology, if any
  // further collapse would change it.
  Bound bound_by = Bound::kError;

  bool operator==(const Simplification&) const = default;
};

// A finished job's report on its mesh. Lengths are in millimetres, after smoothing unless named
// otherwise. For a job by labels: triangles, vertices and areas count each wall once; volumes are
// those of all labels together; components and boundary edges are those of the labels' own
// surfaces; quality holds for every one of them.
struct MeshSummary {
  struct Enclosed {
    double extracted = 0;
    double smoothed = 0;

    bool operator==(const Enclosed&) const = default;
  };

  // Removed by the filter of components.
  struct Dropped {
    std::uint64_t components = 0;
    std::uint64_t triangles = 0;

    bool operator==(const Dropped&) const = default;
  };

  struct Displacement {
    double mean = 0;
    double max = 0;

    bool operator==(const Displacement&) const = default;
  };

  std::optional<double> iso = {};  // the value used; none by labels
  bool empty = false;
  std::optional<std::string> empty_reason = {};  // if it is empty; see proto/empty_surface.h
  std::uint64_t triangles = 0;
  std::uint64_t vertices = 0;
  std::uint64_t boundary_edges = 0;
  std::uint64_t components = 0;
  std::int64_t euler = 0;
  Dropped dropped;
  std::optional<Untangling> untangled = {};       // if requested
  std::optional<Simplification> simplified = {};  // if fewer triangles were requested
  MeshQuality quality;
  double area_mm2 = 0;
  double area_extracted_mm2 = 0;
  Enclosed volume_mm3;
  Displacement displacement_mm;
  std::array<std::array<double, 3>, 2> bounds = {};  // smallest and largest corner; 0 when empty
  std::map<MeshFormat, MeshFile> files;
  // For a job by labels, ascending. Jobs with more than kMostListedLabels have `labels_count` and a
  // file instead. Only records name that file.
  std::vector<LabelSummary> labels = {};
  std::optional<std::uint64_t> labels_count = {};
  std::optional<LabelListFile> label_list = {};
  static constexpr std::size_t kMostListedLabels = 256;
  // For a job by labels: the walls of labels that share faces of voxels, and the others. The latter
  // are not counted, and among the former, in jobs of older servers. Only records name the file of
  // both; no walls have none.
  std::optional<std::uint64_t> walls_count = {};
  std::optional<std::uint64_t> edge_contacts_count = {};
  std::optional<LabelListFile> wall_list = {};
  std::optional<MeshCertificate> certificate = {};
  std::optional<Thickness> thickness = {};  // if requested
  std::vector<Note> notes = {};             // on the mesh alone, not on its volume

  bool operator==(const MeshSummary&) const = default;
};

}  // namespace isomesh
