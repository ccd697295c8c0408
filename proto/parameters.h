// What a parameter of a job is. Each has one row in the functions `visit` below, beside the member
// that holds it; its type, its default and the names of its values are those of the member.
// Requests, queries and their refusals (requests.cpp), the command's options and help
// (client/cli/options.cpp) and openapi.yaml (openapi/describe.cpp), from which the page's form is
// made, all follow from the rows.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "proto/types.h"

namespace isomesh {

template <class T>
concept Enumeration = std::is_enum_v<T>;

template <class Self, class T>
concept Is = std::same_as<std::remove_const_t<Self>, T>;

// What is different for one kind of smoothing.
struct SmoothingCase {
  Smoothing smoothing;
  std::optional<double> standard = {};  // the default there
  std::optional<double> maximum = {};
};

// Which jobs a parameter is for.
enum class JobKind { kAny, kAtIso, kByLabels };

struct Parameter {
  const char* name;        // of the member in JSON
  const char* title = "";  // a short label
  const char* help = "";   // what it does, in one line
  const char* more = "";  // what else a reader of the API should know: sentences that follow `help`
  const char* unit = "";  // which may end the name: max_displacement_mm
  // Of a number.
  std::optional<double> minimum = {};
  std::optional<double> above = {};
  std::optional<double> maximum = {};
  const char* when_empty = nullptr;        // the word for no value, in place of JSON's null
  std::array<const char*, 4> values = {};  // what the values of an enumeration mean, in their order
  std::array<std::optional<SmoothingCase>, 2> cases = {};  // none: for every kind of smoothing
  bool is_required = false;
  const char* unless = nullptr;  // of one that is required: which other one may stand in its place
  JobKind jobs = JobKind::kAny;
  std::optional<double> by_labels = {};  // the default of jobs by labels, where it is another one
  bool may_be_absent = false;            // from the parameters of a job that it does not concern
  bool in_query = true;
  const char* query = nullptr;   // what a query calls it, unless `name`
  const char* option = nullptr;  // what the command calls it, unless as a query, without the unit

  operator const char*() const { return name; }
};

// Whether a member is visited that is left out of what is written when there is nothing to say.
template <class T>
bool is_told(T& /*owner*/, bool has_something) {
  return has_something || !std::is_const_v<T>;
}

void visit(Is<ComponentFilter> auto& self, auto&& parameter) {
  constexpr double kMost = std::numeric_limits<std::uint32_t>::max();
  parameter(Parameter{.name = "keep",
                      .title = "Keep the largest parts",
                      .help = "Of the parts, so many of the largest are kept.",
                      .minimum = 1,
                      .maximum = kMost,
                      .jobs = JobKind::kAtIso,
                      .option = "keep-components"},
            self.keep);
  parameter(Parameter{.name = "min_triangles",
                      .title = "Fewest triangles of a part",
                      .help = "Of the parts, those of so many triangles are kept.",
                      .minimum = 1,
                      .maximum = kMost,
                      .jobs = JobKind::kAtIso},
            self.min_triangles);
  if (is_told(self, !self.nearest_to.empty())) {
    parameter(
        Parameter{.name = "nearest_to",
                  .title = "Keep the parts at",
                  .help = "Of the parts, those nearest to these places are kept.",
                  .more = "Places are x, y and z in millimetres, LPS, one after the other; the "
                          "part of the nearest vertex is meant.",
                  .jobs = JobKind::kAtIso,
                  .may_be_absent = true,
                  .option = "keep-nearest-to"},
        self.nearest_to);
  }
}

void visit(Is<DracoParameters> auto& self, auto&& parameter) {
  parameter(Parameter{.name = "position_bits",
                      .title = "Bits per coordinate",
                      .help = "Bits per coordinate on a grid over the mesh's longest extent.",
                      .minimum = 8,
                      .maximum = 30},
            self.position_bits);
  parameter(
      Parameter{.name = "speed",
                .title = "Encoding speed",
                .help = "Of Draco: 0 to 4 are smallest and slow (valence coding, by libdraco); "
                        "5 to 9 are all the same (an encoder of isomesh's own, on several "
                        "threads, in no more bytes than libdraco takes at 5); 10 keeps the "
                        "order of vertices and triangles at several times the bytes "
                        "(sequential, by libdraco).",
                .minimum = 0,
                .maximum = 10},
      self.speed);
}

void visit(Is<MeshParameters> auto& self, auto&& parameter) {
  const bool by_iso = is_told(self, !self.labels);
  const bool by_labels = is_told(self, self.labels.has_value());
  if (by_iso) {
    parameter(Parameter{.name = "iso",
                        .title = "Iso-value",
                        .help = "The iso-value, in the volume's units, or Otsu's threshold.",
                        .more = "A sample is inside when its value is >= iso.",
                        .when_empty = "otsu",
                        .is_required = true,
                        .unless = "labels",
                        .jobs = JobKind::kAtIso,
                        .may_be_absent = true},
              self.iso);
  }
  if (by_labels) {
    constexpr double kLeast = std::numeric_limits<std::int32_t>::min();
    constexpr double kMost = std::numeric_limits<std::uint32_t>::max();
    parameter(
        Parameter{.name = "labels",
                  .title = "Labels",
                  .help = "In place of an iso-value: the labels of a segmentation, each with a "
                          "surface of its own, or all of them.",
                  .more = "Neighbours share the wall between them. All other values, and those "
                          "that are not listed, are background. Vertices lie half-way between two "
                          "samples. Unless the request says, there are 10 passes with a lambda of "
                          "0.33, and no vertex moves farther than half the smallest "
                          "spacing.",
                  .minimum = kLeast,
                  .maximum = kMost,
                  .jobs = JobKind::kByLabels,
                  .may_be_absent = true},
        self.labels);
    parameter(Parameter{.name = "background",
                        .title = "Background",
                        .help = "The value of samples without a label.",
                        .minimum = kLeast,
                        .maximum = kMost,
                        .jobs = JobKind::kByLabels,
                        .may_be_absent = true},
              self.background);
    parameter(Parameter{.name = "label_names",
                        .title = "Names of labels",
                        .help = "What labels are called, by their values.",
                        .more = "Those that are left out are called as the volume's file says.",
                        .jobs = JobKind::kByLabels,
                        .may_be_absent = true,
                        .in_query = false,
                        .option = "label-name"},
              self.label_names);
    parameter(Parameter{.name = "label_colors",
                        .title = "Colours of labels",
                        .help = "The colours of labels, as #rrggbb, by their values.",
                        .more = "Those that are left out have the colour that the volume's file "
                                "says, or one of a fixed series.",
                        .jobs = JobKind::kByLabels,
                        .may_be_absent = true,
                        .in_query = false,
                        .option = "label-color"},
              self.label_colors);
    parameter(Parameter{.name = "label_values",
                        .title = "Values of labels",
                        .help = "Labels that are made of the samples of several values, by their "
                                "own.",
                        .more = "A value may belong to several labels, which then overlap there. "
                                "Those that are left out are as the volume's file says.",
                        .minimum = kLeast,
                        .maximum = kMost,
                        .jobs = JobKind::kByLabels,
                        .may_be_absent = true,
                        .in_query = false,
                        .option = "label-values"},
              self.label_values);
  }
  parameter(Parameter{.name = "scheme",
                      .title = "Tetrahedra per cell",
                      .help = "Tetrahedra per cell.",
                      .more = "With 5 every second cell is mirrored; the cell (0,0,0) is not.",
                      .values = {"Fewer triangles; every second cell is mirrored",
                                 "The same split in every cell"}},
            self.scheme);
  if (by_iso) {
    parameter(Parameter{.name = "interpolation",
                        .title = "Vertices on edges",
                        .help = "Where a vertex lies on its edge.",
                        .more = "`midpoint` puts all half-way.",
                        .values = {"Where the iso-value lies between two samples",
                                   "Half-way between two samples"},
                        .jobs = JobKind::kAtIso,
                        .may_be_absent = true},
              self.interpolation);
  }
  parameter(Parameter{.name = "passes",
                      .title = "Passes",
                      .help = "How often the surface is smoothed.",
                      .more = "Vertices on its boundary stay. By labels the default is 10.",
                      .minimum = 0,
                      .maximum = 1000,
                      .by_labels = label_parameters({}).passes},
            self.passes);
  parameter(
      Parameter{
          .name = "smoothing",
          .title = "Smoothing",
          .help = "How a pass moves the vertices.",
          .more = "`laplacian`: every pass moves each vertex by `lambda` of the way to the mean of "
                  "its neighbours; what the surface encloses shrinks. `taubin`: every pass does so "
                  "and then moves the vertices back by `mu`, the same for all, with 1/lambda + "
                  "1/mu = `pass_band`; so a pass is two steps, and noise goes while shape and "
                  "volume stay.",
          .values = {"Shrinks a little with every pass", "Keeps the enclosed volume"}},
      self.smoothing);
  // With more than 0.66 in Taubin's, what varies fastest would grow with every pass, whatever the
  // pass-band.
  parameter(
      Parameter{
          .name = "lambda",
          .title = "Step of a pass",
          .help = "How far a pass moves a vertex; 1 moves it onto the mean of its neighbours.",
          .above = 0,
          .maximum = 1,
          .cases = {SmoothingCase{Smoothing::kLaplacian, default_lambda(Smoothing::kLaplacian)},
                    SmoothingCase{Smoothing::kTaubin, default_lambda(Smoothing::kTaubin), 0.66}},
          .by_labels = default_lambda(label_parameters({}))},
      self.lambda);
  parameter(
      Parameter{.name = "pass_band",
                .title = "Pass band",
                .help = "Of `taubin`: what varies along the surface more slowly than this is "
                        "kept.",
                .more = "From 0 for a constant to 2 for what changes sign from each vertex to "
                        "the next.",
                .above = 0,
                .maximum = 0.5,
                .cases = {SmoothingCase{Smoothing::kTaubin}}},
      self.pass_band);
  parameter(
      Parameter{.name = "max_displacement_mm",
                .title = "Move at most",
                .help = "Smoothing moves no vertex farther than this from where it was "
                        "extracted.",
                .more = "Millimetres; null: as far as it goes, and of labels half the smallest "
                        "spacing.",
                .unit = "mm",
                .minimum = 0},
      self.max_displacement_mm);
  parameter(
      Parameter{.name = "close",
                .title = "Close the surface at the volume's border",
                .help = "Cap the surface where it meets the volume's border, as if the samples "
                        "beyond it were outside.",
                .more = "The result has no boundary. Caps lie in the border, stay flat and "
                        "are not smoothed; the rest is smoothed as if the surface were open."},
      self.close);
  parameter(
      Parameter{.name = "components",
                .help = "Which parts of the surface are kept; the others are dropped before "
                        "smoothing.",
                .more = "With several members, the largest of those that are large enough. Parts "
                        "are compared by their triangles, equal ones by their first vertex. "
                        "Without members all are kept. Not for labels."},
      self.components);
  if (is_told(self, self.fill_cavities)) {
    parameter(Parameter{.name = "fill_cavities",
                        .title = "Fill cavities",
                        .help = "Leave out the walls of cavities, which no opening leads to, and "
                                "what floats in them.",
                        .jobs = JobKind::kAtIso,
                        .may_be_absent = true},
              self.fill_cavities);
  }
  if (is_told(self, self.crop.has_value())) {
    parameter(Parameter{.name = "crop",
                        .title = "Crop to a box",
                        .help = "Only what is in this box: its smallest and its largest corner, in "
                                "millimetres, LPS.",
                        .more = "The volume's samples within the box are taken as if they were "
                                "all; of one that lies askew, those between the box's extents "
                                "along its axes. The surface is closed by caps: `close` is true.",
                        .may_be_absent = true},
              self.crop);
  }
  if (is_told(self, self.max_error_mm.has_value())) {
    parameter(Parameter{.name = "max_error_mm",
                        .title = "Largest error",
                        .help = "No part of a file is farther than this from the surface as it was "
                                "extracted, nor that from it.",
                        .more = "Millimetres. Half of it is what smoothing may take; then the "
                                "surface gets as few triangles as the rest allows, and Draco's "
                                "coordinates as many bits as it takes. It is measured on the "
                                "files' own bytes: see `certify`, which comes with it.",
                        .unit = "mm",
                        .minimum = 0.001,
                        .maximum = 1000,
                        .may_be_absent = true},
              self.max_error_mm);
  }
  if (is_told(self, self.triangles.has_value())) {
    parameter(Parameter{.name = "triangles",
                        .title = "Most triangles",
                        .help = "Simplify the surface to so many triangles, or fewer.",
                        .more = "With `max_error_mm`, what binds first; the answer says which. "
                                "What it costs is measured: see `certify`, which comes with it "
                                "unless it is false.",
                        .minimum = 4,
                        .maximum = std::numeric_limits<std::uint32_t>::max(),
                        .may_be_absent = true},
              self.triangles);
  }
  parameter(Parameter{.name = "formats",
                      .title = "Files to make",
                      .help = "The files to make, each named once.",
                      .query = "format"},
            self.formats);
  parameter(Parameter{.name = "draco",
                      .help = "Of the `drc` format, and of the Draco streams inside `glb`."},
            self.draco);
  parameter(Parameter{.name = "normals",
                      .title = "Put the vertices' normals into GLB",
                      .help = "Put the vertices' normals, weighted by the areas around them, into "
                              "`glb`.",
                      .more = "Without them viewers shade every triangle flat, or compute their "
                              "own."},
            self.normals);
  if (is_told(self, self.distances)) {
    parameter(
        Parameter{.name = "distances",
                  .title = "Put the vertices' distances into GLB",
                  .help = "Put each vertex's distance to the surface as it was extracted into "
                          "`glb`, in millimetres.",
                  .more = "As the vertex attribute `_DISTANCE_MM`, of all levels of detail; "
                          "rounded to a four thousandth of the largest. The page shows it as "
                          "colour.",
                  .may_be_absent = true},
        self.distances);
  }
  if (is_told(self, !self.lods.empty())) {
    parameter(Parameter{.name = "lods",
                        .title = "Levels of detail",
                        .help = "Levels of detail for `glb`, as shares of the triangles from 1 "
                                "downwards.",
                        .more = "By the extension MSFT_lod, which readers that do not know it pass "
                                "over. At most 8.",
                        .above = 0,
                        .maximum = 1,
                        .may_be_absent = true},
              self.lods);
  }
  if (is_told(self, self.merge)) {
    parameter(Parameter{.name = "merge",
                        .title = "One primitive in GLB",
                        .help = "Make the surface one primitive of `glb`, or one for each label.",
                        .more = "For programs that take a primitive for an object of its own. "
                                "Otherwise there is one for each hundred thousand triangles or so, "
                                "which are written and read side by side.",
                        .may_be_absent = true},
              self.merge);
  }
  if (is_told(self, self.glb_codec != GlbCodec::kDraco)) {
    parameter(Parameter{.name = "glb_codec",
                        .title = "Compression of GLB",
                        .help = "What the surface in `glb` is compressed by.",
                        .more = "`draco` is KHR_draco_mesh_compression, which makes the smaller "
                                "files; `meshopt` is EXT_meshopt_compression, which is read "
                                "faster. Readers have to know the one that it is.",
                        .values = {"Smaller files", "Files that are read faster"},
                        .may_be_absent = true},
              self.glb_codec);
  }
  if (is_told(self, self.space != Space::kLps)) {
    parameter(Parameter{.name = "space",
                        .title = "Space of the coordinates",
                        .help = "Which ways the coordinates in the files run: x to the patient's "
                                "left and y to the back, or x to the right and y to the front.",
                        .more = "z runs to the head. `gii` is always RAS, and `glb` has its own "
                                "node, by which Y is up.",
                        .values = {"DICOM's: left, posterior, superior",
                                   "NIfTI's: right, anterior, superior"},
                        .may_be_absent = true},
              self.space);
  }
}

inline MeshParameters& mesh_parameters(JobParameters& parameters) { return parameters; }
inline const MeshParameters& mesh_parameters(const JobParameters& parameters) { return parameters; }

void visit(Is<JobParameters> auto& self, auto&& parameter) {
  parameter(
      Parameter{
          .name = "volume", .title = "Volume", .help = "The volume's id.", .is_required = true},
      self.volume);
  visit(mesh_parameters(self), parameter);
  parameter(Parameter{.name = "priority",
                      .title = "Priority",
                      .help = "Jobs are begun by priority, then by age.",
                      .values = {"Before all others", "After all that are stat",
                                 "When nothing else waits"}},
            self.priority);
  if (is_told(self, self.certify)) {
    parameter(
        Parameter{.name = "certify",
                  .title = "Measure the error",
                  .help = "Measure how far the files are from the surface as it was extracted, "
                          "and where they run through themselves.",
                  .may_be_absent = true},
        self.certify);
  }
  if (is_told(self, self.callback.has_value())) {
    parameter(Parameter{.name = "callback",
                        .help = "Have the server tell this address when the job has ended.",
                        .may_be_absent = true,
                        .in_query = false},
              self.callback);
  }
}

// A parameter that holds others: draco, of which draco.speed is one.
template <class T>
concept ParameterGroup = Is<T, ComponentFilter> || Is<T, DracoParameters>;

// Calls leaf(path, parameter, member) for all that are no groups, those in groups by their path:
// "draco.speed".
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

// Without the hyphens before it: "max-displacement".
std::string option_name_of(const Parameter& parameter);

// What a number may be, for people: "from 0 to 1000", "above 0 and at most 1", "of at least 0";
// empty where every number will do.
std::string range_of(const Parameter& parameter);

// As short as it reads back: "0.33", "4294967295".
std::string number_text(double number);

// Names with commas and a last "or" between.
std::string listed(const std::vector<std::string>& names);

}  // namespace isomesh
