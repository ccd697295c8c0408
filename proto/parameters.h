// The table of a job's parameters: each has one row in parameter_rows.cpp, and the functions
// `visit` below say which member has which row. The member has the type, the default and the names
// of the values. The rows generate: requests, queries and their errors (requests.cpp), the
// command's options and help (client/cli/parameter_options.cpp), and openapi.yaml
// (openapi/describe.cpp), from which the page's form is generated.
#pragma once

#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "proto/parameter.h"
#include "proto/types.h"

namespace isomesh {

namespace rows {
extern const Parameter kKeep, kMinTriangles, kNearestTo;
extern const Parameter kPositionBits, kSpeed;
extern const Parameter kIso, kLabels, kBackground, kLabelNames, kLabelColors, kLabelValues, kScheme,
    kInterpolation, kRegularize, kPasses, kSmoothing, kLambda, kPassBand, kMaxDisplacementMm,
    kClose, kComponents, kFillCavities, kCrop, kMaxErrorMm, kTriangles, kFormats, kDraco, kNormals,
    kDistances, kLods, kMerge, kGlbCodec, kSpace;
extern const Parameter kVolume, kPriority, kCertify, kCallback;
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

std::string query_name_of(const Parameter& parameter);

// The option's name without its leading hyphens: "max-displacement".
std::string option_name_of(const Parameter& parameter);

// The range of a number in words: "from 0 to 1000", "above 0 and at most 1", "of at least 0";
// empty if every number is allowed.
std::string range_of(const Parameter& parameter);

// "must be a whole number from 0 to 1000": the requirement that a rejected number failed.
std::string must_be(const Parameter& parameter, bool is_whole);

// The shortest text that reads back as the same number: "0.33", "4294967295".
std::string number_text(double number);

// Joins names with commas and a last "or".
std::string listed(const std::vector<std::string>& names);

}  // namespace isomesh
