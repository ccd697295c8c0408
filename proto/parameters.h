// The parameters of a job. Each has one member with its default in the structures below, and one
// row, with everything else that is said of it, in parameter_rows.cpp; the functions `visit` join
// the two. The rows generate: requests, queries and their errors (requests.cpp), the command's
// options and help (client/cli/parameter_options.cpp), and openapi.yaml (openapi/describe.cpp),
// from which the page's form is generated.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "proto/labels.h"
#include "proto/mesh_summary.h"
#include "proto/parameter.h"
#include "proto/smoothing.h"

namespace isomesh {

// The division of cells into tetrahedra: so many for each, or those of the body-centred lattice of
// the samples and the centres of the cells.
enum class Scheme { kFive = 5, kSix, kBcc };

// The spelling of a scheme in a request, which responses repeat: kFcc and kKuhn are the lattices of
// five and six.
enum class SchemeName { kFive = 5, kSix, kBcc, kFcc, kKuhn };

constexpr Scheme scheme_of(SchemeName name) {
  if (name == SchemeName::kFcc) return Scheme::kFive;
  return name == SchemeName::kKuhn ? Scheme::kSix : Scheme{static_cast<int>(name)};
}

// The samples that are inside: those of at least the iso-value, or all others.
enum class Inside { kAbove, kBelow };
enum class Interpolation { kLinear, kMidpoint };
// KHR_draco_mesh_compression, floats as they are, EXT_meshopt_compression, KHR_meshopt_compression,
// KHR_mesh_quantization.
enum class GlbCodec { kDraco, kNone, kMeshopt, kKhrMeshopt, kQuantized };
enum class Priority { kStat, kRoutine, kBulk };  // claimed in this order

struct DracoParameters {
  int position_bits = 14;  // per coordinate
  int speed = 7;           // 0 smallest .. 10 fastest

  bool operator==(const DracoParameters&) const = default;
};

// Selects connected components; keeps all if empty. Several members apply in this order:
// `nearest_to`, `min_triangles`, `keep`.
struct ComponentFilter {
  std::optional<std::uint32_t> keep;              // number of the largest components to keep; at
                                                  // least 1
  std::optional<std::uint32_t> min_triangles;     // drops smaller components; at least 1
  std::vector<std::array<double, 3>> nearest_to;  // the components nearest to these points, in mm,
                                                  // LPS
  static constexpr std::size_t kMostPlaces = 1000;

  bool keeps_all() const { return !keep && !min_triangles && nearest_to.empty(); }
  bool operator==(const ComponentFilter&) const = default;
};

// A box along the axes of LPS: smallest and largest corner, in millimetres.
using Box = std::array<std::array<double, 3>, 2>;

// The URL to notify when a job has ended.
struct Callback {
  std::string url;

  bool operator==(const Callback&) const = default;
};

// Everything beside the volume that determines a mesh's bytes, and nothing else. Files carry it,
// and jobs with equal parameters share their result. parameters.h has the meanings and ranges.
struct MeshParameters {
  std::optional<double> iso;  // in the volume's units; empty: Otsu's threshold
  // Of a request: the preset (presets.h) whose value the server puts into `iso`, which is empty
  // until then. Empty in jobs.
  std::string preset = {};
  Inside inside = Inside::kAbove;
  SchemeName scheme = SchemeName::kSix;
  Interpolation interpolation = Interpolation::kLinear;
  bool regularize = true;
  int passes = 5;
  Smoothing smoothing = Smoothing::kLaplacian;
  std::optional<double> lambda;               // empty: default_lambda()
  double pass_band = 0.1;                     // of Taubin smoothing
  std::optional<double> max_displacement_mm;  // empty: no limit
  bool untangle = false;  // moves vertices back where smoothing made triangles intersect
  bool close = false;
  ComponentFilter components;
  std::vector<MeshFormat> formats = {MeshFormat::kDrc};
  DracoParameters draco;
  bool normals = true;     // in glb
  bool distances = false;  // in glb: of each vertex to the surface as extracted
  // Largest allowed deviation of the files from the surface as extracted; empty: no limit.
  std::optional<double> max_error_mm = {};
  std::optional<std::uint32_t> triangles = {};  // at most this many; empty: all
  std::vector<double> lods = {};  // in glb: levels of detail, as fractions of the triangles
  static constexpr std::size_t kMostLods = 8;
  bool merge = false;  // in glb: one primitive per surface and level
  GlbCodec glb_codec = GlbCodec::kDraco;
  Space space = Space::kLps;     // of files whose format does not define it
  std::optional<Box> crop = {};  // empty: the whole volume
  bool fill_cavities = false;
  // For a job by labels. It has no iso-value and no interpolation: its vertices lie half-way.
  std::optional<LabelChoice> labels = {};
  std::int64_t background = 0;  // the value outside of all labels
  LabelTexts label_names = {};
  LabelTexts label_colors = {};   // "#rrggbb"
  LabelValues label_values = {};  // the volume's labels that each of these joins

  bool operator==(const MeshParameters&) const = default;
};

// Measurements beside the files, which do not depend on them.
struct Measures {
  bool certify = false;  // the deviation of the files from the surface as extracted
  // The thickness of walls, with the area of those thinner than this; empty: not measured.
  std::optional<double> min_thickness_mm = {};

  bool operator==(const Measures&) const = default;
};

// A job request: the mesh's parameters, the volume, the priority, the callback and what to measure.
struct JobParameters : MeshParameters, Measures {
  std::string volume;
  Priority priority = Priority::kRoutine;
  std::optional<Callback> callback = {};

  bool operator==(const JobParameters&) const = default;
};

// The defaults of a job by labels; the members' own are those of a job at an iso-value.
inline JobParameters label_parameters(LabelChoice labels) {
  JobParameters parameters;
  parameters.labels = std::move(labels);
  parameters.interpolation = Interpolation::kMidpoint;
  parameters.passes = 10;
  parameters.smoothing = Smoothing::kLabels;
  return parameters;
}

// The space of a file's coordinates: GIFTI is RAS, GLB has a node of its own for it, other formats
// follow the parameter.
Space space_of(MeshFormat format, const MeshParameters& parameters);

// True if one file of the format holds all labels.
bool holds_all_labels(MeshFormat format);

// The end of the names that are offered for files of that format, without the dot.
std::string_view file_suffix(MeshFormat format);

// The files of a job, in order: its formats. For a job by labels: the formats that hold all labels,
// and a ZIP of the others.
std::vector<MeshFormat> files_of(const MeshParameters& parameters);

// The formats of the files in a ZIP of labels, in order.
std::vector<MeshFormat> zipped_formats(const MeshParameters& parameters);

// The default relaxation factor (smoothing.h).
double default_lambda(const MeshParameters& parameters);

namespace rows {
extern const Parameter kKeep, kMinTriangles, kNearestTo;
extern const Parameter kPositionBits, kSpeed;
extern const Parameter kIso, kInside, kLabels, kBackground, kLabelNames, kLabelColors, kLabelValues,
    kScheme, kInterpolation, kRegularize, kPasses, kSmoothing, kLambda, kPassBand,
    kMaxDisplacementMm, kUntangle, kClose, kComponents, kFillCavities, kCrop, kMaxErrorMm,
    kTriangles, kFormats, kDraco, kNormals, kDistances, kLods, kMerge, kGlbCodec, kSpace;
extern const Parameter kVolume, kPriority, kCertify, kMinThicknessMm, kCallback;
extern const Parameter kLabelName;  // of a member that a label names
}  // namespace rows

// True if the member is visited: readers visit every member, writers only those with a value.
template <class T>
bool is_told(T& /*owner*/, bool has_something) {
  return has_something || !std::is_const_v<T>;
}

void visit(Is<ComponentFilter> auto& self, auto&& parameter) {
  parameter(rows::kKeep, self.keep);
  parameter(rows::kMinTriangles, self.min_triangles);
  if (is_told(self, !self.nearest_to.empty())) parameter(rows::kNearestTo, self.nearest_to);
}

void visit(Is<DracoParameters> auto& self, auto&& parameter) {
  parameter(rows::kPositionBits, self.position_bits);
  parameter(rows::kSpeed, self.speed);
}

void visit(Is<MeshParameters> auto& self, auto&& parameter) {
  const bool by_iso = is_told(self, !self.labels);
  const bool by_labels = is_told(self, self.labels.has_value());
  if (by_iso) parameter(rows::kIso, self.iso);
  if (is_told(self, self.inside != Inside::kAbove)) parameter(rows::kInside, self.inside);
  if (by_labels) {
    parameter(rows::kLabels, self.labels);
    parameter(rows::kBackground, self.background);
    parameter(rows::kLabelNames, self.label_names);
    parameter(rows::kLabelColors, self.label_colors);
    parameter(rows::kLabelValues, self.label_values);
  }
  parameter(rows::kScheme, self.scheme);
  if (by_iso) parameter(rows::kInterpolation, self.interpolation);
  parameter(rows::kRegularize, self.regularize);
  parameter(rows::kPasses, self.passes);
  parameter(rows::kSmoothing, self.smoothing);
  parameter(rows::kLambda, self.lambda);
  parameter(rows::kPassBand, self.pass_band);
  parameter(rows::kMaxDisplacementMm, self.max_displacement_mm);
  if (is_told(self, self.untangle)) parameter(rows::kUntangle, self.untangle);
  parameter(rows::kClose, self.close);
  parameter(rows::kComponents, self.components);
  if (is_told(self, self.fill_cavities)) parameter(rows::kFillCavities, self.fill_cavities);
  if (is_told(self, self.crop.has_value())) parameter(rows::kCrop, self.crop);
  if (is_told(self, self.max_error_mm.has_value())) parameter(rows::kMaxErrorMm, self.max_error_mm);
  if (is_told(self, self.triangles.has_value())) parameter(rows::kTriangles, self.triangles);
  parameter(rows::kFormats, self.formats);
  parameter(rows::kDraco, self.draco);
  parameter(rows::kNormals, self.normals);
  if (is_told(self, self.distances)) parameter(rows::kDistances, self.distances);
  if (is_told(self, !self.lods.empty())) parameter(rows::kLods, self.lods);
  if (is_told(self, self.merge)) parameter(rows::kMerge, self.merge);
  if (is_told(self, self.glb_codec != GlbCodec::kDraco)) parameter(rows::kGlbCodec, self.glb_codec);
  if (is_told(self, self.space != Space::kLps)) parameter(rows::kSpace, self.space);
}

inline MeshParameters& mesh_parameters(JobParameters& parameters) { return parameters; }
inline const MeshParameters& mesh_parameters(const JobParameters& parameters) { return parameters; }

void visit(Is<JobParameters> auto& self, auto&& parameter) {
  parameter(rows::kVolume, self.volume);
  visit(mesh_parameters(self), parameter);
  parameter(rows::kPriority, self.priority);
  if (is_told(self, self.certify)) parameter(rows::kCertify, self.certify);
  if (is_told(self, self.min_thickness_mm.has_value())) {
    parameter(rows::kMinThicknessMm, self.min_thickness_mm);
  }
  if (is_told(self, self.callback.has_value())) parameter(rows::kCallback, self.callback);
}

// A parameter that holds others: `draco` holds `draco.speed`.
template <class T>
concept ParameterGroup = Is<T, ComponentFilter> || Is<T, DracoParameters>;

// Calls leaf(path, parameter, member) for every parameter that is not a group. The path names the
// groups too: "draco.speed".
template <class Self, class Leaf>
void visit_leaves(Self& self, const Leaf& leaf, const std::string& prefix = {}) {
  visit(self, [&](const Parameter& parameter, auto& member) {
    const std::string path = prefix + parameter.name;
    if constexpr (ParameterGroup<std::remove_reference_t<decltype(member)>>) {
      visit_leaves(member, leaf, path + '.');
    } else {
      leaf(path, parameter, member);
    }
  });
}

// The default for jobs by labels if it is another one than that for jobs at an iso-value, as JSON
// without quotes; otherwise empty.
std::string default_by_labels(const Parameter& parameter);

std::string query_name_of(const Parameter& parameter);

// The option's name without its leading hyphens: "max-displacement".
std::string option_name_of(const Parameter& parameter);

// The range of a number in words: "from 0 to 1000", "above 0 and at most 1", "of at least 0";
// empty if every number is allowed.
std::string range_of(const Parameter& parameter);

// The presets that the parameter takes in place of a number.
std::vector<std::string> presets_of(const Parameter& parameter);

// "must be a whole number from 0 to 1000": the requirement that a rejected number failed.
std::string must_be(const Parameter& parameter, bool is_whole);

// The shortest text that reads back as the same number: "0.33", "4294967295".
std::string number_text(double number);

// Joins names with commas and a last "or".
std::string listed(const std::vector<std::string>& names);

}  // namespace isomesh
