#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/placing.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/line_reader.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kMostParBytes = std::size_t{8} << 20;

using ImageRow = std::vector<double>;

struct ParHeader {
  HeaderTexts general;
  std::vector<ImageRow> rows;  // one for each image
};

// Columns of a row in all versions that are read.
enum Column : std::size_t {
  kSlice,
  kEcho,
  kInstant,
  kPhase,
  kType,
  kSequence,
  kPlace,
  kBits,
  kWidth = 9,
  kHeight,
  kIntercept,
  kSlope,
  kThickness = 22,
  kGap,
  kOrientation = 25,
  kSpacing = 28,
  kColumnsOfV4 = 41,
  kDiffusion = 41,
  kGradient = 42,
  kLabelType = 48,
};

// The images of a volume share these, and the repetition.
using Key = std::array<double, 9>;
constexpr std::array<std::size_t, 8> kKeyColumns = {kEcho,     kInstant,   kPhase,    kType,
                                                    kSequence, kDiffusion, kGradient, kLabelType};
constexpr std::array<const char*, 9> kKeyNames = {"echo",     "instant",    "phase",
                                                  "type",     "sequence",   "b value",
                                                  "gradient", "label type", "repetition"};

Key key_of(const ImageRow& row) {
  Key key = {};
  for (std::size_t at = 0; at < kKeyColumns.size(); ++at) {
    if (kKeyColumns[at] < row.size()) key[at] = row[kKeyColumns[at]];
  }
  return key;
}

ImageRow image_row(std::string_view line) {
  ImageRow row;
  for (const std::string_view word : words(line)) {
    const auto number = finite_number(word);
    if (!number) {
      throw_unusable("The PAR header has a row of an image with " + in_quotes(word) +
                     ", which is not a number.");
    }
    row.push_back(*number);
  }
  if (row.size() >= kColumnsOfV4) return row;
  throw_unusable("The PAR header has a row of an image with " + std::to_string(row.size()) +
                 " numbers. Versions 4, 4.1 and 4.2 are read, which have 41 or more.");
}

// ".    Max. number of slices/locations      :   9": what stands before and behind the colon.
void add_general(std::string_view line, HeaderTexts& general) {
  const std::size_t colon = line.find(':');
  if (colon == std::string_view::npos) return;
  general.emplace(lower(trimmed(line.substr(1, colon - 1))), trimmed(line.substr(colon + 1)));
}

ParHeader read_par_header(const InputFile& file) {
  ParHeader header;
  LineReader lines(file, {.header = "The PAR header", .bytes = kMostParBytes});
  while (const auto line = lines.next_filled()) {
    if (line->front() == '#') continue;
    if (line->front() == '.') {
      add_general(*line, header.general);
    } else {
      header.rows.push_back(image_row(*line));
    }
  }
  if (header.rows.empty()) throw_unusable("The PAR header describes no image.");
  return header;
}

// Angles or offsets: back to front, feet to head, right to left.
Vector3 general_vector(const ParHeader& header, std::string_view beginning) {
  for (const auto& [name, value] : header.general) {
    if (!name.starts_with(beginning)) continue;
    const auto numbers = finite_numbers(value);
    if (numbers.size() == 3) return {numbers[0], numbers[1], numbers[2]};
  }
  throw_unusable("The PAR header has no three numbers for " + in_quotes(beginning) + ".");
}

std::uint64_t whole(double number, const std::string& what) {
  return plausible_whole(number, "The PAR header's " + what);
}

// --- Geometry ------------------------------------------------------------------------------------

using Matrix = std::array<Vector3, 3>;  // rows

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix result = {};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      for (std::size_t at = 0; at < 3; ++at) result[row][column] += a[row][at] * b[at][column];
    }
  }
  return result;
}

// Philips' axes run to the back, to the head and to the left. The order of the three rotations was
// found by nibabel's authors from converted images.
Matrix rotation_of(const Vector3& degrees) {
  std::array<double, 3> sine = {};
  std::array<double, 3> cosine = {};
  for (std::size_t at = 0; at < 3; ++at) {
    sine[at] = std::sin(degrees[at] * std::numbers::pi / 180);
    cosine[at] = std::cos(degrees[at] * std::numbers::pi / 180);
  }
  const Matrix x = {Vector3{1, 0, 0}, {0, cosine[0], -sine[0]}, {0, sine[0], cosine[0]}};
  const Matrix y = {Vector3{cosine[1], 0, sine[1]}, {0, 1, 0}, {-sine[1], 0, cosine[1]}};
  const Matrix z = {Vector3{cosine[2], -sine[2], 0}, {sine[2], cosine[2], 0}, {0, 0, 1}};
  return product(z, product(x, y));
}

// Columns, rows and slices in Philips' axes, by the orientation of the slices.
Matrix axes_of(double orientation) {
  if (orientation == 1) return {Vector3{0, 1, 0}, {0, 0, 1}, {1, 0, 0}};
  if (orientation == 2) return {Vector3{1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  if (orientation == 3) return {Vector3{0, 0, 1}, {0, -1, 0}, {1, 0, 0}};
  throw_unusable("The PAR header's slice orientation " + to_text(orientation) + " is unknown.");
}

Geometry geometry_of_header(const ParHeader& header, const SourceVolume& volume) {
  const ImageRow& row = header.rows.front();
  const Vector3 spacing = {row[kSpacing], row[kSpacing + 1], row[kThickness] + row[kGap]};
  const Matrix axes = product(rotation_of(general_vector(header, "angulation midslice")),
                              axes_of(row[kOrientation]));
  const Vector3 centre = general_vector(header, "off centre midslice");
  // From Philips' axes to RAS: the left is their third, the back their first.
  const auto ras = [](const Vector3& v) { return Vector3{-v[2], -v[0], v[1]}; };
  Vector3 origin = centre;
  std::array<Vector3, 3> steps = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t part = 0; part < 3; ++part) {
      steps[axis][part] = axes[part][axis] * spacing[axis];
      origin[part] -= steps[axis][part] * (volume.dims[axis] - 1.0) / 2;
    }
    steps[axis] = ras(steps[axis]);
  }
  return geometry_of_ras(ras(origin), steps);
}

// --- Images --------------------------------------------------------------------------------------

// The columns that all images must share.
void check_rows(const ParHeader& header) {
  const ImageRow& first = header.rows.front();
  for (const std::size_t column :
       {kBits, kWidth, kHeight, kThickness, kGap, kOrientation, kSpacing}) {
    const auto differs = [&](const ImageRow& row) { return row[column] != first[column]; };
    if (std::ranges::any_of(header.rows, differs)) {
      throw_unusable(
          "The images of the PAR header differ in size, spacing or orientation, so they are not "
          "one volume.");
    }
  }
}

using Volumes = std::map<Key, std::vector<const ImageRow*>>;

std::string title_of(const Volumes& volumes, std::uint64_t index) {
  const auto at = [&](std::uint64_t place) {
    return std::next(volumes.begin(), static_cast<std::ptrdiff_t>(place))->first;
  };
  const Key key = at(index);
  std::string title;
  for (std::size_t part = 0; part < key.size(); ++part) {
    const auto is_same = [&](const auto& volume) { return volume.first[part] == key[part]; };
    if (std::ranges::all_of(volumes, is_same)) continue;
    title += (title.empty() ? "" : ", ") + std::string(kKeyNames[part]) + ' ' + to_text(key[part]);
  }
  return title;
}

Volumes volumes_of(const ParHeader& header) {
  Volumes volumes;
  std::map<std::pair<Key, double>, double> seen;
  for (const ImageRow& row : header.rows) {
    Key key = key_of(row);
    // Version 4 has no columns for diffusion: only the order tells its weights apart.
    if (row.size() == kColumnsOfV4) key.back() = ++seen[{key, row[kSlice]}];
    volumes[key].push_back(&row);
  }
  for (auto& [key, rows] : volumes) {
    std::ranges::sort(rows, {}, [](const ImageRow* row) { return (*row)[kSlice]; });
  }
  return volumes;
}

void check_slices(const std::vector<const ImageRow*>& rows) {
  for (std::size_t at = 0; at < rows.size(); ++at) {
    const double found = (*rows[at])[kSlice];
    const double expected = static_cast<double>(at) + 1;
    if (found == expected) continue;
    throw_unusable("Slice " + to_text(std::min(found, expected)) + " of " +
                   std::to_string(rows.size()) + " in the PAR header is " +
                   (found > expected ? "missing." : "there twice."));
  }
}

struct Slice {
  std::uint64_t place = 0;  // in the REC, in images
  SampleLayout layout;
};

struct Described {
  SourceVolume volume;
  std::vector<Slice> slices;

  std::uint64_t slice_bytes() const {
    return volume.sample_count() / volume.dims[2] * bytes_per_sample(slices.front().layout.type);
  }
};

std::vector<Slice> slices_of(const std::vector<const ImageRow*>& rows) {
  std::vector<Slice> slices;
  for (const ImageRow* row : rows) {
    const double bits = (*row)[kBits];
    if (bits != 8 && bits != 16) {
      throw_unusable("The images of the PAR header have " + to_text(bits) +
                     " bits. 8 and 16 are supported.");
    }
    slices.push_back({.place = whole((*row)[kPlace], "index of an image"),
                      .layout = {.type = bits == 8 ? StoredType::kUint8 : StoredType::kUint16,
                                 .rescale = Rescale{(*row)[kSlope], (*row)[kIntercept]}}});
  }
  return slices;
}

// True if each slice has its own slope and intercept.
bool differ(const std::vector<Slice>& slices) {
  return std::ranges::any_of(slices, [&](const Slice& slice) {
    return slice.layout.rescale != slices.front().layout.rescale;
  });
}

Described describe(const ParHeader& header, const ImportOptions& options) {
  check_rows(header);
  const Volumes volumes = volumes_of(header);
  Described result;
  SourceVolume& volume = result.volume;
  choose_volume(volumes.size(),
                {.what = "echo, instant, phase, type or diffusion",
                 .title = [&](std::uint64_t index) { return title_of(volumes, index); }},
                options, volume);
  const auto& rows =
      std::next(volumes.begin(), static_cast<std::ptrdiff_t>(volume.chosen.index))->second;
  volume.chosen = {};
  check_slices(rows);
  const ImageRow& first = *rows.front();
  const std::array<std::uint64_t, 3> sizes = {whole(first[kWidth], "width of an image"),
                                              whole(first[kHeight], "height of an image"),
                                              rows.size()};
  volume.dims = volume_dims(sizes);
  result.slices = slices_of(rows);
  volume.layout = result.slices.front().layout;
  if (volume.layout.rescale == Rescale{}) volume.layout.rescale.reset();
  if (differ(result.slices)) volume.layout = {.type = StoredType::kFloat32, .rescale = {}};
  volume.geometry = geometry_of_header(header, volume);
  return result;
}

std::string rec_name(const Companions& companions) {
  const auto name = companion_with({".REC", ".rec", ".Rec"}, companions.name(), companions);
  if (name) return *name;
  throw_unusable(
      "The samples of the PAR header are in a .REC file, which is missing. Send both files in one "
      "ZIP or TAR.");
}

bool is_par(std::string_view head) {
  const std::size_t version = head.find("CLINICAL TRYOUT");
  return head.starts_with('#') && version != std::string_view::npos &&
         head.find("Research image export tool", version) != std::string_view::npos;
}

SourceVolume parse_par(const InputFile& file, const Companions& companions,
                       const ImportOptions& options) {
  const std::filesystem::path path = companion(rec_name(companions), companions);
  Described described = describe(read_par_header(file), options);
  const std::uint64_t bytes = described.slice_bytes();
  const std::uint64_t size = InputFile(path).size();
  const bool is_converted = differ(described.slices);
  for (const auto& [place, layout] : described.slices) {
    if (size < bytes || place > (size - bytes) / bytes) {
      throw_unusable("The REC file is truncated: image " + std::to_string(place) + " is missing.");
    }
    described.volume.data_files.push_back({path, {place * bytes, bytes}});
    if (is_converted) described.volume.data_files.back().layout = layout;
  }
  return std::move(described.volume);
}

std::vector<std::string> par_data_names(const InputFile& /*file*/, const Companions& companions) {
  return {rec_name(companions)};
}

MostBytes most_par_bytes(const InputFile& beginning, const ImportTask& task) {
  // The images that follow are not known yet.
  if (beginning.size() >= kBeginningBytes) {
    return {.file = kMostParBytes + kHeadroomBytes,
            .data = task.limits.max_sample_bytes + kHeadroomBytes};
  }
  const ParHeader header = read_par_header(beginning);
  const Described described = describe(header, task.options);
  check_limits(described.volume, task.limits);
  // The REC also has the images of the volumes that were not chosen.
  std::uint64_t most = 0;
  for (const ImageRow& row : header.rows) {
    most = std::max(most, whole(row[kPlace], "index of an image") + 1);
  }
  return {.file = kMostParBytes + kHeadroomBytes,
          .data = most * described.slice_bytes() + kHeadroomBytes};
}

}  // namespace

constinit const Reader kParReader = {.name = "par",
                                     .sniff = is_par,
                                     .describe = parse_par,
                                     .most_bytes = most_par_bytes,
                                     .data_names = par_data_names};

}  // namespace isomesh::import
