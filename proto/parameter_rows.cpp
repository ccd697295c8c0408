#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <string_view>

#include "proto/parameters.h"

namespace isomesh::rows {
namespace {

constexpr double kMostUnsigned = std::numeric_limits<std::uint32_t>::max();
constexpr double kLeastSample = std::numeric_limits<std::int32_t>::min();
constexpr double kMostSample = kMostUnsigned;

// The sentences of all methods of smoothing, as one text.
constexpr auto kMethods = [] {
  constexpr std::size_t kLength = [] {
    std::size_t length = 0;
    for (const SmoothingRow& row : kSmoothings) length += std::string_view(row.more).size() + 1;
    return length;
  }();
  std::array<char, kLength> text = {};
  auto end = text.begin();
  for (const SmoothingRow& row : kSmoothings) {
    end = std::ranges::copy(std::string_view(row.more), end).out;
    *end++ = ' ';
  }
  text.back() = '\0';
  return text;
}();

constexpr Meanings kMethodMeanings = [] {
  Meanings meanings = {};
  static_assert(kSmoothings.size() <= meanings.size());
  std::ranges::transform(kSmoothings, meanings.begin(), &SmoothingRow::meaning);
  return meanings;
}();

// A case for each method of smoothing with that property.
template <auto has, auto case_of>
constexpr auto kCases = [] {
  std::array<SmoothingCase, std::ranges::count_if(kSmoothings, has)> cases = {};
  auto next = cases.begin();
  for (const SmoothingRow& row : kSmoothings) {
    if (has(row)) *next++ = case_of(row);
  }
  return cases;
}();

constexpr auto kLambdaCases =
    kCases<[](const SmoothingRow& row) { return row.lambda.has_value(); },
           [](const SmoothingRow& row) {
             return SmoothingCase{row.smoothing, row.lambda, row.most_lambda};
           }>;
constexpr auto kPassBandCases =
    kCases<[](const SmoothingRow& row) { return row.has_pass_band; },
           [](const SmoothingRow& row) { return SmoothingCase{row.smoothing}; }>;

}  // namespace

// --- ComponentFilter ---

constinit const Parameter kKeep = {.name = "keep",
                                   .title = "Keep the largest components",
                                   .help = "Keep the N largest connected components.",
                                   .minimum = 1,
                                   .maximum = kMostUnsigned,
                                   .jobs = JobKind::kAtIso,
                                   .option = "keep-components"};

constinit const Parameter kMinTriangles = {
    .name = "min_triangles",
    .title = "Smallest component, in triangles",
    .help = "Drop connected components with fewer triangles than this.",
    .minimum = 1,
    .maximum = kMostUnsigned,
    .jobs = JobKind::kAtIso};

constinit const Parameter kNearestTo = {
    .name = "nearest_to",
    .title = "Keep the components nearest to",
    .help = "Keep the connected component nearest to each of these points.",
    .more =
        "A point is x, y and z in millimetres (LPS). A query lists the numbers of all "
        "points in one row. The nearest component is the one with the nearest vertex.",
    .jobs = JobKind::kAtIso,
    .may_be_absent = true,
    .option = "keep-nearest-to"};

// --- DracoParameters ---

constinit const Parameter kPositionBits = {
    .name = "position_bits",
    .title = "Bits per coordinate",
    .help = "Bits per coordinate in `drc`, and in `glb` with a codec.",
    .more = "The grid spans the mesh's longest side.",
    .minimum = 8,
    .maximum = 30};

constinit const Parameter kSpeed = {
    .name = "speed",
    .title = "Encoding speed",
    .help = "Draco's encoding speed; low values make smaller files and take longer.",
    .more =
        "0 to 4 use valence coding by libdraco: the smallest files, slow. 5 to 9 are all "
        "the same: isomesh's own encoder, which uses several threads and takes no more "
        "bytes than libdraco at 5. 10 uses sequential coding by libdraco: the order of "
        "vertices and triangles is kept, at several times the bytes.",
    .minimum = 0,
    .maximum = 10};

// --- MeshParameters ---

constinit const Parameter kIso = {
    .name = "iso",
    .title = "Iso-value",
    .help =
        "The iso-value in the volume's units, `otsu` for Otsu's threshold, or the name of one of "
        "the volume's presets.",
    .more =
        "A sample is inside when its value is >= iso; see `inside`. A CT in Hounsfield units has "
        "`skin`, `soft-tissue` and `bone`, a fractional segmentation has `segment`, if the value "
        "occurs in it. The job then has the preset's number.",
    .when_empty = "otsu",
    .takes_presets = true,
    .is_required = true,
    .unless = "labels",
    .jobs = JobKind::kAtIso,
    .may_be_absent = true};

constinit const Parameter kInside = {
    .name = "inside",
    .title = "Inside",
    .help = "The samples inside the surface: those of at least the iso-value, or those below it.",
    .more =
        "`below` is for dark structures, such as airways, ventricles and cysts. Samples beyond the "
        "volume's border are never inside. Padding and NaN have the value of the smallest sample.",
    .values = {"Bright structures", "Dark structures"},
    .jobs = JobKind::kAtIso,
    .by_labels = "must be \"above\" for labels: none of their values is below another",
    .may_be_absent = true};

constinit const Parameter kLabels = {
    .name = "labels",
    .title = "Labels",
    .help = "Labels of a segmentation to mesh instead of an iso-value: their values, or `all`.",
    .more =
        "Each label gets a surface of its own. Neighbouring labels share the wall "
        "between them. Values that are not listed are background. Vertices lie "
        "half-way between two samples. Some defaults differ from those of jobs with an "
        "iso-value. With another smoothing than `labels` no vertex moves farther than half the "
        "smallest spacing.",
    .jobs = JobKind::kByLabels,
    .may_be_absent = true};

constinit const Parameter kBackground = {.name = "background",
                                         .title = "Background value",
                                         .help = "The value of samples without a label.",
                                         .minimum = kLeastSample,
                                         .maximum = kMostSample,
                                         .jobs = JobKind::kByLabels,
                                         .may_be_absent = true};

constinit const Parameter kLabelName = {.name = "label"};

constinit const Parameter kLabelNames = {
    .name = "label_names",
    .title = "Label names",
    .help = "Names of the labels, by value.",
    .more = "Labels that are not listed keep the name from the volume's file.",
    .jobs = JobKind::kByLabels,
    .text = TextKind::kName,
    .may_be_absent = true,
    .in_query = false,
    .option = "label-name"};

constinit const Parameter kLabelColors = {
    .name = "label_colors",
    .title = "Label colours",
    .help = "Colours of the labels as #rrggbb, by value.",
    .more =
        "Labels that are not listed keep the colour from the volume's "
        "file, or get one of a fixed series.",
    .jobs = JobKind::kByLabels,
    .text = TextKind::kColor,
    .may_be_absent = true,
    .in_query = false,
    .option = "label-color"};

constinit const Parameter kLabelValues = {
    .name = "label_values",
    .title = "Label values",
    .help = "The labels of the volume that each label joins, for labels that join several.",
    .more =
        "A label of the volume may be in several lists; these labels then overlap there. In a "
        "list, it is no longer a label itself, unless it has a list, too. The volume's labels are "
        "those of `GET /v1/volumes/{id}/labels`, also if its samples have other numbers.",
    .jobs = JobKind::kByLabels,
    .may_be_absent = true,
    .in_query = false,
    .option = "label-values"};

constinit const Parameter kScheme = {
    .name = "scheme",
    .title = "Tetrahedra per cell",
    .help = "Number of tetrahedra per cell, or lattice.",
    .more =
        "6 is Kuhn's split of the primitive cubic lattice. 5 is the subdivision of the "
        "face-centred cubic lattice: every second cell is mirrored; the cell (0,0,0) is not. The "
        "names `kuhn` and `fcc` mean 6 and 5. `bcc` is the body-centred cubic lattice, which has a "
        "sample in the centre of each cell, too, the mean of its corners: 1.4 times as many "
        "triangles as 6, with larger angles. It is not for labels.",
    .values = {"The face-centred lattice, with fewer triangles; every second cell is "
               "mirrored",
               "The primitive lattice, with the same split in every cell", "The same as 5",
               "The same as 6", "The body-centred lattice, with more triangles and larger angles"}};

constinit const Parameter kInterpolation = {
    .name = "interpolation",
    .title = "Position of vertices",
    .help = "Position of a vertex on the edge between two samples.",
    .more = "`linear` interpolates the two samples; `midpoint` puts every vertex half-way.",
    .values = {"Where the iso-value lies between the two samples",
               "Half-way between the two samples"},
    .jobs = JobKind::kAtIso,
    .by_labels = "must be \"midpoint\" for labels: there are no values between two labels",
    .may_be_absent = true};

constinit const Parameter kRegularize = {
    .name = "regularize",
    .title = "Join nearby vertices",
    .help = "Join the vertices around a sample where that keeps the topology.",
    .more =
        "The surface has about a third as many triangles, with larger angles. It keeps its "
        "connected components, its boundary and its genus. Vertices at the volume's border stay "
        "where they are. The same holds for the own surface of each label. False gives a vertex to "
        "each edge between two samples that the surface crosses. At an iso-value, `max_error_mm` "
        "does the same: its limit is measured from that surface.",
    .may_be_absent = true};

constinit const Parameter kPasses = {
    .name = "passes",
    .title = "Passes",
    .help = "Number of smoothing passes.",
    .more =
        "Vertices on the surface's boundary stay where they are. `labels` smoothes once, whatever "
        "their number, and moves the boundary within the volume's border; 0 leaves the surface as "
        "it is extracted.",
    .minimum = 0,
    .maximum = 1000,
};

constinit const Parameter kSmoothing = {
    .name = "smoothing",
    .title = "Smoothing",
    .help = "The smoothing method.",
    .more = kMethods.data(),
    .values = kMethodMeanings,
};

constinit const Parameter kLambda = {
    .name = "lambda",
    .title = "Relaxation factor (lambda)",
    .help = "Relaxation factor of a pass; 1 moves a vertex onto the mean of its neighbours.",
    .above = 0,
    .maximum = 1,
    .cases = kLambdaCases,
};

constinit const Parameter kPassBand = {
    .name = "pass_band",
    .title = "Pass band",
    .help = "For `taubin`: keep surface frequencies below this, and smooth higher ones.",
    .more = "They range from 0 (constant) to 2 (the sign changes from each vertex to the next).",
    .above = 0,
    .maximum = 0.5,
    .cases = kPassBandCases};

constinit const Parameter kMaxDisplacementMm = {
    .name = "max_displacement_mm",
    .title = "Largest displacement",
    .help = "Smoothing moves no vertex farther than this from its extracted position.",
    .more =
        "In millimetres. Null means no limit; but labels that are smoothed by `laplacian` or "
        "`taubin` move half the smallest spacing at most.",
    .unit = "mm",
    .minimum = 0};

constinit const Parameter kUntangle = {
    .name = "untangle",
    .title = "Remove self-intersections",
    .help =
        "Remove the self-intersections that smoothing makes: move vertices back towards "
        "their extracted positions.",
    .more =
        "The vertices of triangles that intersect move back by half, again and again, until no "
        "triangles intersect; at worst to where they were extracted. It needs smoothing, so "
        "`passes` must not be 0. `mesh.untangled` says what was found and moved. `certify` counts "
        "again, also in files that round coordinates.",
    .may_be_absent = true};

constinit const Parameter kClose = {
    .name = "close",
    .title = "Close the surface at the volume's border",
    .help = "Cap the surface where it meets the volume's border.",
    .more =
        "Samples beyond the border then count as outside. The result has no "
        "boundary. Caps lie in the border, stay flat and are not smoothed. "
        "The rest is smoothed as if the surface were open."};

constinit const Parameter kComponents = {
    .name = "components",
    .help = "Which connected components to keep; the others are dropped before smoothing.",
    .more =
        "With several members, `nearest_to` chooses first, `min_triangles` drops some of these, "
        "and `keep` chooses among the rest. Components are ranked by their number of triangles, "
        "equal ones by their first vertex. Without members all are kept. Labels do not allow it.",
    .by_labels =
        "cannot be combined with labels: a dropped component would leave a hole in its neighbours"};

constinit const Parameter kFillCavities = {
    .name = "fill_cavities",
    .title = "Fill cavities",
    .help = "Remove enclosed cavities: their walls and all connected components inside them.",
    .more = "A cavity is enclosed if no opening leads to it.",
    .jobs = JobKind::kAtIso,
    .by_labels = "cannot be combined with labels: other labels may lie in their cavities",
    .may_be_absent = true};

constinit const Parameter kCrop = {
    .name = "crop",
    .title = "Crop to a box",
    .help =
        "Mesh only what lies in this box: its smallest and its largest "
        "corner in millimetres (LPS).",
    .more =
        "Samples outside the box are ignored, as if the volume ended "
        "there. If the volume's axes are oblique, the box's extents along "
        "those axes are used. Caps close the surface: `close` is true.",
    .may_be_absent = true};

constinit const Parameter kMaxErrorMm = {
    .name = "max_error_mm",
    .title = "Largest error",
    .help =
        "The distance between each file and the extracted surface, or for labels the "
        "smoothed surface, is at most this.",
    .more =
        "In millimetres, in both directions. At an iso-value, smoothing may use half of "
        "it. For labels, `max_displacement_mm` limits smoothing. "
        "Simplification then removes as many triangles as the rest allows, and Draco's "
        "coordinates get as many bits as that takes. The distance is proven for every "
        "point; if that cannot be done, `mesh.certificate` says so. See `certify`, "
        "which is switched on.",
    .unit = "mm",
    .minimum = 0.001,
    .maximum = 1000,
    .may_be_absent = true};

constinit const Parameter kTriangles = {
    .name = "triangles",
    .title = "Most triangles",
    .help = "Simplify the surface to at most this many triangles.",
    .more =
        "If `max_error_mm` is given too, the limit that is reached first "
        "applies; the response names it. The resulting error is measured: "
        "see `certify`, which is switched on unless it is set to false.",
    .minimum = 4,
    .maximum = kMostUnsigned,
    .may_be_absent = true};

constinit const Parameter kFormats = {.name = "formats",
                                      .title = "File formats",
                                      .help = "The file formats to write.",
                                      .query = "format"};

constinit const Parameter kDraco = {
    .name = "draco", .help = "Options of the `drc` format, and of the Draco streams in `glb`."};

constinit const Parameter kNormals = {
    .name = "normals",
    .title = "Write vertex normals to GLB",
    .help = "Write vertex normals to `glb`: means of the triangles' normals, weighted by area.",
    .more =
        "Where `max_error_mm` or `triangles` simplifies a surface at an iso-value, they "
        "are the gradient of the samples instead, so facets are not seen. Without "
        "normals, viewers shade each triangle flat or compute their own."};

constinit const Parameter kDistances = {
    .name = "distances",
    .title = "Write vertex distances to GLB",
    .help = "Write each vertex's distance to the extracted surface to `glb`, in millimetres.",
    .more =
        "The vertex attribute is `_DISTANCE_MM`; every level of detail has it. With the codec "
        "`draco`, values are rounded to a four thousandth of the largest. The page shows them as "
        "colours. The formats must include `glb`.",
    .needs = MeshFormat::kGlb,
    .may_be_absent = true};

constinit const Parameter kLods = {
    .name = "lods",
    .title = "Levels of detail",
    .help =
        "Levels of detail in `glb`, as decreasing fractions of the triangles; "
        "the first is 1.",
    .more =
        "At most 8. They use the extension MSFT_lod; readers that do not know it "
        "ignore them. The formats must include `glb`.",
    .above = 0,
    .maximum = 1,
    .needs = MeshFormat::kGlb,
    .may_be_absent = true};

constinit const Parameter kMerge = {
    .name = "merge",
    .title = "One primitive in GLB",
    .help = "Write the surface to `glb` as one primitive; with labels, as one per label.",
    .more =
        "For programs that take each primitive for a separate object. Otherwise there is "
        "one per hundred thousand triangles or so; they are written and read in parallel. "
        "With the codec `none`, there is always one.",
    .may_be_absent = true};

constinit const Parameter kGlbCodec = {
    .name = "glb_codec",
    .title = "GLB compression",
    .help = "How the surface in `glb` is compressed.",
    .more =
        "`draco` is KHR_draco_mesh_compression and makes the smallest files. `none` needs no "
        "extension: exact floats in one primitive for each surface, for every reader of glTF, "
        "with about ten times as many bytes. `meshopt` is EXT_meshopt_compression and is read "
        "faster than `draco`; `khr-meshopt` is the same under the newer name "
        "KHR_meshopt_compression. `quantized` is KHR_mesh_quantization: rounded numbers that "
        "are not compressed. Readers must support the one that is used. `isomesh mesh` asks for "
        "`none` by default.",
    .values = {"The smallest files", "Exact floats, for every reader of glTF",
               "Files that are read faster", "The same, by the newer name of the extension",
               "Rounded numbers without compression"},
    .may_be_absent = true};

constinit const Parameter kSpace = {
    .name = "space",
    .title = "Coordinate system",
    .help =
        "Directions of x and y in the files: to the patient's left and "
        "back, or to the right and front.",
    .more =
        "z points to the head. `gii` is always RAS. `glb` has a node of "
        "its own that turns Y up.",
    .values = {"DICOM's: left, posterior, superior", "NIfTI's: right, anterior, superior"},
    .may_be_absent = true};

// --- JobParameters ---

constinit const Parameter kVolume = {
    .name = "volume", .title = "Volume", .help = "The volume's id.", .is_required = true};

constinit const Parameter kPriority = {
    .name = "priority",
    .title = "Priority",
    .help =
        "Jobs start in order of priority. Within a priority, owners take turns by the "
        "time that their jobs are expected to take, and each owner's jobs start by age.",
    .values = {"Before all others", "After all stat jobs", "When no other job waits"}};

constinit const Parameter kCertify = {
    .name = "certify",
    .title = "Measure the error",
    .help =
        "Measure how far the files are from the extracted surface, and "
        "where they intersect themselves.",
    .more =
        "If `max_error_mm` or `triangles` simplifies labels, the distance counts from the "
        "smoothed surface instead; `mesh.certificate.reference` names it.",
    .may_be_absent = true};

constinit const Parameter kMinThicknessMm = {
    .name = "min_thickness_mm",
    .title = "Nozzle's width",
    .help =
        "Measure how thick walls are, and the area of those that are "
        "thinner than this, such as the width of a printer's nozzle.",
    .more =
        "In millimetres. It changes no file: nothing is made thicker. "
        "`mesh.thickness` has the result.",
    .unit = "mm",
    .minimum = 0.001,
    .maximum = 1000,
    .may_be_absent = true};

constinit const Parameter kCallback = {.name = "callback",
                                       .help = "URL that the server calls when the job has ended.",
                                       .may_be_absent = true,
                                       .in_query = false};

}  // namespace isomesh::rows
