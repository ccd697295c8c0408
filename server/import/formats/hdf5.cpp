#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"
#include "proto/samples.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/hdf5_file.h"
#include "server/import/formats/placing.h"
#include "server/import/samples/transfer.h"
#include "server/import/source/source.h"
#include "server/import/source/units.h"

namespace isomesh::import {
namespace {

const std::string kItk = "ITKImage/0";
const std::string kMinc = "minc-2.0";
const std::string kMincImage = "minc-2.0/image/0";

// The samples of one volume in a file of their own, in the byte order of this machine.
Volume write_volume(const ScratchFile& samples, SourceVolume source, const Input& input) {
  source.chosen = {};
  return write_canonical(InputFile(samples.path()), source, input.task);
}

// Sets the sizes from those of an array, in which the last axis is x, and selects one of the
// volumes along a first of four axes. Returns the range of first indices to read.
struct Planes {
  std::uint64_t first = 0;
  std::uint64_t count = 0;
};

Planes choose_planes(const Hdf5Array& array, const Input& input, SourceVolume& source) {
  const std::vector<std::uint64_t> xyz(array.sizes().rbegin(), array.sizes().rend());
  if (xyz.size() < 2 || xyz.size() > 4) {
    throw_unusable("The HDF5 file's image has " + std::to_string(xyz.size()) +
                   " dimensions. 2 to 4 are supported.");
  }
  source.dims = volume_dims(std::span(xyz).first(std::min<std::size_t>(xyz.size(), 3)));
  source.layout.type = array.type();
  choose_volume(volumes_beyond(xyz), numbered("time", "time"), input.task.options, source);
  check_limits(source, input.task.limits);
  if (xyz.size() == 4) return {source.chosen.index, 1};
  return {0, array.sizes().front()};
}

// --- ITK -----------------------------------------------------------------------------------------

Geometry itk_geometry(const Hdf5File& file, std::size_t axes) {
  const auto origin = file.array(kItk + "/Origin").numbers();
  const auto spacing = file.array(kItk + "/Spacing").numbers();
  const auto directions = file.array(kItk + "/Directions").numbers();
  if (origin.size() != axes || spacing.size() != axes || directions.size() != axes * axes) {
    throw_unusable("The HDF5 file's origin, spacing and directions do not fit its dimensions.");
  }
  Geometry geometry;
  for (std::size_t axis = 0; axis < std::min<std::size_t>(axes, 3); ++axis) {
    geometry.origin[axis] = origin[axis];
    geometry.spacing[axis] = spacing[axis];
    // The file has a row for each axis.
    for (std::size_t row = 0; row < std::min<std::size_t>(axes, 3); ++row) {
      geometry.direction[row * 3 + axis] = directions[axis * axes + row];
    }
  }
  return geometry;
}

Volume read_itk(const Hdf5File& file, const Input& input) {
  const Hdf5Array array = file.array(kItk + "/VoxelData");
  const auto dimension = file.array(kItk + "/Dimension").numbers();
  if (dimension.size() != array.sizes().size()) {
    throw_unusable(
        "The samples of the HDF5 file have several components. A sample must be one real "
        "number.");
  }
  SourceVolume source;
  const auto [first, count] = choose_planes(array, input, source);
  source.geometry = itk_geometry(file, dimension.size());
  ScratchFile samples(input.task.scratch, ".samples");
  array.read(first, count, [&](std::span<const std::byte> piece) { samples.write(piece); });
  return write_volume(samples, std::move(source), input);
}

// --- MINC 2 --------------------------------------------------------------------------------------

// The axes of the image, the slowest first: "zspace", "yspace", "xspace", maybe after "time".
std::vector<std::string> minc_axes(const Hdf5File& file) {
  const std::string order = file.text(kMincImage + "/image", "dimorder").value_or("");
  std::vector<std::string> axes;
  for (const std::string_view name : split(order, ',')) axes.emplace_back(name);
  return axes;
}

// The row of a spatial axis: x runs to the right, y to the front and z up.
std::optional<std::size_t> axis_row(std::string_view axis) {
  if (axis == "xspace") return 0;
  if (axis == "yspace") return 1;
  if (axis == "zspace") return 2;
  return std::nullopt;
}

double number_of(const Hdf5File& file, const std::string& path, const std::string& name,
                 double otherwise) {
  const auto numbers = file.numbers(path, name);
  return numbers.empty() ? otherwise : numbers.front();
}

void set_minc_geometry(const Hdf5File& file, std::span<const std::string> axes,
                       SourceVolume& source) {
  Vector3 origin = {0, 0, 0};
  std::array<Vector3, 3> steps = {};
  for (std::size_t at = 0; at < axes.size(); ++at) {
    const std::string path = kMinc + "/dimensions/" + axes[at];
    if (file.text(path, "spacing").value_or("").starts_with("irregular")) {
      throw_unusable("The MINC file's slices are not equally spaced.");
    }
    Vector3 cosines = {0, 0, 0};
    cosines[axis_row(axes[at]).value()] = 1;
    const auto told = file.numbers(path, "direction_cosines");
    if (told.size() == 3) std::ranges::copy(told, cosines.begin());
    const double unit = take_unit(file.text(path, "units").value_or(""), source);
    const double start = number_of(file, path, "start", 0) * unit;
    const double step = number_of(file, path, "step", 1) * unit;
    for (std::size_t row = 0; row < 3; ++row) {
      origin[row] += start * cosines[row];
      steps[axes.size() - 1 - at][row] = step * cosines[row];
    }
  }
  source.geometry = geometry_of_ras(origin, steps);
}

// The last three axes must be spatial and different; a time may precede them.
std::vector<std::string> spatial_axes(const Hdf5File& file, const Hdf5Array& array) {
  std::vector<std::string> axes = minc_axes(file);
  if (axes.size() != array.sizes().size() || axes.size() < 3 || axes.size() > 4) {
    throw_unusable("The MINC file's image has other dimensions than x, y, z and time.");
  }
  if (axes.size() == 4 && axes.front() == "time") axes.erase(axes.begin());
  std::vector<std::string> sorted = axes;
  std::ranges::sort(sorted);
  if (sorted != std::vector<std::string>{"xspace", "yspace", "zspace"}) {
    throw_unusable("The MINC file's image has other dimensions than x, y, z and time.");
  }
  return axes;
}

// From stored integers to real values, by the ranges of both; the image has one range of real
// values, or one for each index of its slowest axes.
struct MincScale {
  double least = 0;  // stored
  double most = 1;
  std::vector<double> real_least;
  std::vector<double> real_most;
  std::uint64_t samples_each = 0;

  double slope(std::uint64_t block) const {
    return (real_most[block] - real_least[block]) / (most - least);
  }
  bool changes_nothing() const {
    for (std::uint64_t block = 0; block < real_least.size(); ++block) {
      if (real_least[block] != least || real_most[block] != most) return false;
    }
    return true;
  }
};

template <class Stored>
std::array<double, 2> range_of_type() {
  return {static_cast<double>(std::numeric_limits<Stored>::lowest()),
          static_cast<double>(std::numeric_limits<Stored>::max())};
}

MincScale scale_of(const Hdf5File& file, const Hdf5Array& array) {
  MincScale scale;
  const auto valid = file.numbers(kMincImage + "/image", "valid_range");
  std::array<double, 2> range = with_stored_sample(
      array.type(), [](auto sample) { return range_of_type<decltype(sample)>(); });
  if (valid.size() == 2) range = {std::min(valid[0], valid[1]), std::max(valid[0], valid[1])};
  scale.least = range[0];
  scale.most = range[1];
  const Hdf5Array least = file.array(kMincImage + "/image-min");
  const Hdf5Array most = file.array(kMincImage + "/image-max");
  const std::size_t axes = least.sizes().size();
  const auto& sizes = array.sizes();
  const bool fits = axes < sizes.size() && least.sizes() == most.sizes() &&
                    std::equal(least.sizes().begin(), least.sizes().end(), sizes.begin());
  if (!fits || !(scale.most > scale.least)) {
    throw_unusable("The MINC file's ranges of values do not fit its image.");
  }
  scale.real_least = least.numbers();
  scale.real_most = most.numbers();
  scale.samples_each = 1;
  for (std::size_t axis = axes; axis < sizes.size(); ++axis) scale.samples_each *= sizes[axis];
  return scale;
}

template <class Stored, class Real>
std::vector<Real> scaled(std::span<const std::byte> piece, const MincScale& scale,
                         std::uint64_t first) {
  std::vector<Stored> stored(piece.size() / sizeof(Stored));
  std::ranges::copy(piece, std::as_writable_bytes(std::span(stored)).begin());
  std::vector<Real> real(stored.size());
  for (std::size_t at = 0; at < stored.size(); ++at) {
    const std::uint64_t block = (first + at) / scale.samples_each;
    const double value = std::clamp(static_cast<double>(stored[at]), scale.least, scale.most);
    real[at] =
        static_cast<Real>((value - scale.least) * scale.slope(block) + scale.real_least[block]);
  }
  return real;
}

void write_scaled(const Hdf5Array& array, const Planes& planes, const MincScale& scale,
                  const SourceVolume& source, ScratchFile& samples) {
  std::uint64_t next = planes.first;
  for (std::size_t axis = 1; axis < array.sizes().size(); ++axis) next *= array.sizes()[axis];
  const bool is_short = source.layout.type == StoredType::kFloat32;
  const auto write = [&](const auto& real) { samples.write(std::as_bytes(std::span(real))); };
  array.read(planes.first, planes.count, [&](std::span<const std::byte> piece) {
    with_stored_sample(array.type(), [&](auto sample) {
      using Stored = decltype(sample);
      if (is_short) {
        write(scaled<Stored, float>(piece, scale, next));
      } else {
        write(scaled<Stored, double>(piece, scale, next));
      }
    });
    next += piece.size() / bytes_per_sample(array.type());
  });
}

// The samples lie by their own order of axes. x, y and z follow from their directions.
Volume read_minc(const Hdf5File& file, const Input& input) {
  const Hdf5Array array = file.array(kMincImage + "/image");
  const std::vector<std::string> axes = spatial_axes(file, array);
  SourceVolume source;
  const Planes planes = choose_planes(array, input, source);
  set_minc_geometry(file, axes, source);
  ScratchFile samples(input.task.scratch, ".samples");
  const bool is_real = array.type() == StoredType::kFloat32 || array.type() == StoredType::kFloat64;
  const auto scale = is_real ? std::nullopt : std::optional(scale_of(file, array));
  if (scale && !scale->changes_nothing()) {
    // Integers of 16 bits fit float32.
    source.layout.type =
        bytes_per_sample(array.type()) <= 2 ? StoredType::kFloat32 : StoredType::kFloat64;
    check_limits(source, input.task.limits);
    write_scaled(array, planes, *scale, source, samples);
  } else {
    array.read(planes.first, planes.count,
               [&](std::span<const std::byte> piece) { samples.write(piece); });
  }
  return write_volume(samples, std::move(source), input);
}

[[noreturn]] void throw_other_file(const Hdf5File& file) {
  const bool is_imaris = file.has("DataSetInfo") && file.has("DataSet");
  throw Error(ErrorCode::kUnsupportedMedia,
              std::string(is_imaris ? "This is an Imaris file"
                                    : "This is an HDF5 file of an unknown "
                                      "program") +
                  ", which cannot be read. Of HDF5 files, images of ITK and MINC 2 can.");
}

bool is_hdf5(std::string_view head) { return head.starts_with("\x89HDF\r\n\x1a\n"); }

Volume parse_hdf5(const Input& input) {
  const Hdf5File file(input.path);
  if (file.has(kItk)) return read_itk(file, input);
  if (file.has(kMincImage)) return read_minc(file, input);
  throw_other_file(file);
}

MostBytes most_hdf5_bytes(const InputFile& /*beginning*/, const ImportTask& task) {
  return {.file = task.limits.max_sample_bytes + kHeadroomBytes};
}

}  // namespace

constinit const Reader kHdf5Reader = {
    .name = "hdf5", .sniff = is_hdf5, .parse = parse_hdf5, .most_bytes = most_hdf5_bytes};

}  // namespace isomesh::import
