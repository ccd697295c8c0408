#include "server/import/images/tiff_meaning.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "proto/json_text.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/names.h"
#include "server/import/source/units.h"

namespace isomesh::import {
namespace {

// --- ImageJ --------------------------------------------------------------------------------------

std::string_view described_value(std::string_view description, std::string_view name) {
  for (const std::string_view line : lines(description)) {
    if (line.starts_with(name) && line.substr(name.size()).starts_with('=')) {
      return trimmed(line.substr(name.size() + 1));
    }
  }
  return {};
}

// From the description's unit along x, and those along y and z, which may differ.
std::optional<std::array<double, 3>> imagej_spacing(std::string_view description,
                                                    const TiffResolution& resolution) {
  const std::string_view unit = described_value(description, "unit");
  std::string_view gap = described_value(description, "spacing");
  if (gap.starts_with('-')) gap.remove_prefix(1);  // as ImageJ does
  const auto between = described_positive(gap);
  if (unit.empty() || !between || !(resolution.x > 0) || !(resolution.y > 0)) return std::nullopt;
  const auto length = [&](std::string_view name) {
    const std::string_view own = described_value(description, name);
    return described_length(own.empty() ? unit : own);
  };
  const auto x = length("unit");
  const auto y = length("yunit");
  const auto z = length("zunit");
  if (!x || !y || !z) return std::nullopt;
  return std::array{*x / resolution.x, *y / resolution.y, *z * *between};
}

// From stored values to those that ImageJ shows. Signed 16-bit images have one, too: they are
// stored as unsigned ones.
std::optional<Rescale> imagej_rescale(std::string_view description) {
  constexpr std::int64_t kStraightLine = 0;
  constexpr std::int64_t kNone = 20;
  constexpr std::int64_t kOpticalDensity = 21;  // the only function without coefficients
  const std::string_view function = described_value(description, "cf");
  const auto code = parse_int64(function);
  const std::string_view intercept = described_value(description, "c0");
  const std::string_view slope = described_value(description, "c1");
  if (function.empty() || code == kNone) return std::nullopt;
  if (code != kOpticalDensity && (intercept.empty() || slope.empty())) return std::nullopt;
  if (code != kStraightLine) {
    throw_unusable(
        "The values of the ImageJ TIFF are calibrated by its function " + in_quotes(function) +
        ". Only a straight line (0) can be read. Convert the image to 32 bits in ImageJ, "
        "which stores calibrated values.");
  }
  const Rescale rescale = {parse_double(slope).value_or(HUGE_VAL),
                           parse_double(intercept).value_or(HUGE_VAL)};
  if (!std::isfinite(rescale.slope) || !std::isfinite(rescale.intercept) || rescale.slope == 0) {
    throw_unusable("The ImageJ TIFF's calibration of values, c0=" + printable(intercept) +
                   " and c1=" + printable(slope) + ", is not a straight line.");
  }
  if (rescale.slope == 1 && rescale.intercept == 0) return std::nullopt;
  return rescale;
}

TiffMeaning imagej_meaning(std::string_view description, const TiffResolution& resolution,
                           std::uint64_t pages) {
  TiffMeaning meaning;
  meaning.order = "XYCZT";
  meaning.channels = described_count(described_value(description, "channels"), 1);
  meaning.times = described_count(described_value(description, "frames"), 1);
  const std::uint64_t others = meaning.channels * meaning.times;
  meaning.slices = described_count(described_value(description, "slices"), pages / others);
  meaning.spacing = imagej_spacing(description, resolution);
  meaning.rescale = imagej_rescale(description);
  return meaning;
}

// --- SCIFIO and tifffile -------------------------------------------------------------------------

struct PageAxis {
  char name = '?';  // Z, C or T
  std::uint64_t size = 1;
};

// The meaning of the axes beyond x and y, the fastest first. With a single one without a name, all
// pages are slices: tifffile may have written more of them after the description.
TiffMeaning meaning_of(std::vector<PageAxis> axes, std::uint64_t pages) {
  std::erase_if(axes, [](const PageAxis& axis) { return axis.size == 1; });
  TiffMeaning meaning;
  if (axes.size() == 1 && axes[0].name == '?') axes[0] = {'Z', pages};
  meaning.slices = axes.empty() ? pages : 1;
  meaning.order = "XY";
  for (const PageAxis& axis : axes) {
    if (axis.name == '?' || meaning.order.find(axis.name) != std::string::npos) {
      throw_unusable(
          "The TIFF's pages have " + std::to_string(axes.size()) +
          " axes, and its description does not say which of them counts slices, channels and "
          "times. Save it with the names of its axes, as in ZCYX, or with one volume per file.");
    }
    meaning.order += axis.name;
    (axis.name == 'Z'   ? meaning.slices
     : axis.name == 'C' ? meaning.channels
                        : meaning.times) = axis.size;
  }
  for (const char name : std::string_view("ZCT")) {
    if (meaning.order.find(name) == std::string::npos) meaning.order += name;
  }
  return meaning;
}

std::optional<TiffMeaning> scifio_meaning(std::string_view description, std::uint64_t pages) {
  const auto list = [&](std::string_view name) {
    return split(described_value(description, name), ',');
  };
  const std::vector<std::string_view> names = list("axes");
  const std::vector<std::string_view> lengths = list("lengths");
  if (names.size() < 2 || names[0] != "X" || names[1] != "Y" || lengths.size() != names.size()) {
    return std::nullopt;
  }
  std::vector<PageAxis> axes;
  for (std::size_t at = 2; at < names.size(); ++at) {
    const char name = names[at] == "Z"         ? 'Z'
                      : names[at] == "Channel" ? 'C'
                      : names[at] == "Time"    ? 'T'
                                               : '?';
    axes.push_back({name, described_count(lengths[at], 1)});
  }
  TiffMeaning meaning = meaning_of(std::move(axes), pages);
  const std::vector<std::string_view> scales = list("scales");
  const std::vector<std::string_view> units = list("units");
  const auto z = static_cast<std::size_t>(std::ranges::find(names, "Z") - names.begin());
  if (scales.size() != names.size() || units.size() != names.size() || z == names.size()) {
    return meaning;
  }
  std::array<double, 3> spacing = {};
  for (const auto& [axis, at] : {std::pair{0, std::size_t{0}}, {1, std::size_t{1}}, {2, z}}) {
    const auto scale = described_positive(scales[at]);
    const auto length = described_length(units[at]);
    if (!scale || !length) return meaning;
    spacing[static_cast<std::size_t>(axis)] = *scale * *length;
  }
  meaning.spacing = spacing;
  return meaning;
}

struct TifffileArray {
  std::vector<std::uint64_t> shape;  // ends in y and x
  std::string axes;                  // one letter for each; empty if they are not known
  bool is_truncated = false;         // only the first plane has a page
};

std::optional<TifffileArray> tifffile_array(std::string_view description) {
  constexpr std::size_t kLongest = std::size_t{1} << 20;  // tifffile's are below 1 kB
  if (!description.starts_with('{') || description.size() > kLongest) return std::nullopt;
  const auto document = parse_json<nlohmann::json>(description, nullptr, false);
  if (!document.is_object() || !document.contains("shape")) return std::nullopt;
  TifffileArray array;
  for (const auto& size : document["shape"]) {
    if (!size.is_number_unsigned()) return std::nullopt;
    array.shape.push_back(described_count(size.dump(), 1));
  }
  if (document.contains("axes") && document["axes"].is_string()) array.axes = document["axes"];
  if (array.axes.size() != array.shape.size()) array.axes.clear();
  if (array.axes.ends_with('S')) {
    array.axes.pop_back();
    array.shape.pop_back();
  }
  array.is_truncated = document.contains("truncated") && document["truncated"] == true;
  if (array.shape.size() < 2 || (!array.axes.empty() && !array.axes.ends_with("YX"))) {
    return std::nullopt;
  }
  return array;
}

std::optional<TiffMeaning> tifffile_meaning(std::string_view description, std::uint64_t pages) {
  const auto array = tifffile_array(description);
  if (!array) return std::nullopt;
  std::vector<PageAxis> axes;
  for (std::size_t at = array->shape.size() - 2; at-- > 0;) {
    const bool is_known =
        !array->axes.empty() && std::string_view("ZCT").find(array->axes[at]) != std::string::npos;
    axes.push_back({is_known ? array->axes[at] : '?', array->shape[at]});
  }
  return meaning_of(std::move(axes), pages);
}

}  // namespace

TiffMeaning tiff_meaning(std::string_view description, const TiffResolution& resolution,
                         std::uint64_t pages) {
  description = trimmed(description);
  std::optional<TiffMeaning> meaning;
  if (description.starts_with("ImageJ=")) {
    meaning = imagej_meaning(description, resolution, pages);
  } else if (description.starts_with("SCIFIO=")) {
    meaning = scifio_meaning(description, pages);
  } else if (description.starts_with('{')) {
    meaning = tifffile_meaning(description, pages);
  } else {
    meaning = ome_meaning(description, pages);
  }
  return meaning.value_or(TiffMeaning{.slices = pages});
}

std::optional<TiffMeaning> lsm_meaning(std::string_view information) {
  constexpr std::size_t kNeeded = 90;
  if (information.size() < kNeeded) return std::nullopt;
  constexpr bool kIsBigEndian = false;  // in any file
  const HeaderBytes bytes(information, kIsBigEndian);
  const auto magic = bytes.at<std::uint32_t>(0);
  if (magic != 0x0300494C && magic != 0x0400494C) return std::nullopt;
  const auto count = [&](std::size_t offset) -> std::uint64_t {
    const auto number = bytes.at<std::int32_t>(offset);
    return number >= 1 && static_cast<std::uint64_t>(number) <= kMostOfAKind
               ? static_cast<std::uint64_t>(number)
               : 1;
  };
  TiffMeaning meaning;
  meaning.slices = count(16);
  meaning.times = count(24);
  const auto scan = bytes.at<std::uint16_t>(88);
  if (meaning.slices > 1 && meaning.times > 1 && scan != 0 && scan != 6) {
    throw_unusable("The LSM file's scan of type " + std::to_string(scan) +
                   " has slices and times in an order that is not supported. Only stacks (0) and "
                   "time series of stacks (6) are.");
  }
  constexpr double kMillimetresPerMetre = 1000;
  std::array<double, 3> spacing = {};
  bytes.read<double>(40, spacing);
  for (double& size : spacing) size *= kMillimetresPerMetre;
  const auto is_length = [](double size) { return std::isfinite(size) && size > 0; };
  if (std::ranges::all_of(spacing, is_length)) meaning.spacing = spacing;
  return meaning;
}

std::uint64_t images_behind_page(std::string_view description) {
  if (description.starts_with("ImageJ=")) {
    return described_count(described_value(description, "images"), 0);
  }
  const auto array = tifffile_array(description);
  if (!array || !array->is_truncated) return 0;
  std::uint64_t images = 1;
  for (std::size_t at = 0; at + 2 < array->shape.size(); ++at) {
    images = std::min(images * array->shape[at], kMostOfAKind);
  }
  return images;
}

std::vector<std::uint64_t> TiffMeaning::volumes() const {
  std::set<std::uint64_t> found;
  if (!page_of_plane) {
    for (std::uint64_t volume = 0; volume < channels * times; ++volume) found.insert(volume);
  } else {
    for (const auto& [plane, page] : *page_of_plane) found.insert(volume_of(plane));
  }
  return {found.begin(), found.end()};
}

std::uint64_t TiffMeaning::size_of(char axis) const {
  return axis == 'Z' ? slices : axis == 'C' ? channels : times;
}

std::uint64_t TiffMeaning::plane_of(std::uint64_t volume, std::uint64_t slice) const {
  const std::uint64_t channel = volume % channels;
  const std::uint64_t time = volume / channels;
  std::uint64_t plane = 0;
  std::uint64_t step = 1;
  for (const char axis : std::string_view(order).substr(2)) {
    plane += step * (axis == 'Z' ? slice : axis == 'C' ? channel : time);
    step *= size_of(axis);
  }
  return plane;
}

std::uint64_t TiffMeaning::volume_of(std::uint64_t plane) const {
  std::uint64_t volume = 0;
  for (const char axis : std::string_view(order).substr(2)) {
    if (axis == 'C') volume += plane % channels;
    if (axis == 'T') volume += plane % times * channels;
    plane /= size_of(axis);
  }
  return volume;
}

std::uint64_t TiffMeaning::page_of(std::uint64_t volume, std::uint64_t slice) const {
  const std::uint64_t plane = plane_of(volume, slice);
  if (!page_of_plane) return plane;
  const auto page = page_of_plane->find(plane);
  if (page != page_of_plane->end()) return page->second;
  throw_unusable("Slice " + std::to_string(slice) +
                 " of the volume is not in this file, by the description of the OME-TIFF. If an "
                 "OME-TIFF consists of several files, each must have all slices of a volume.");
}

std::string counts_of(const TiffMeaning& meaning) {
  return std::to_string(meaning.slices) + " slices, " + std::to_string(meaning.channels) +
         " channels and " + std::to_string(meaning.times) + " times";
}

void check_pages(const TiffMeaning& meaning, std::uint64_t pages) {
  if (meaning.page_of_plane) {
    if (!meaning.page_of_plane->empty()) return;
    throw_unusable("By its description, the OME-TIFF has no image: they are in other files.");
  }
  if (meaning.slices * meaning.channels * meaning.times == pages) return;
  throw_unusable("The TIFF's description tells of " + counts_of(meaning) + ", but the file has " +
                 std::to_string(pages) + (pages == 1 ? " page." : " pages."));
}

std::optional<double> described_length(std::string_view unit) {
  // As ImageJ escapes letters beyond ASCII.
  if (unit == "\\u00B5m") return millimetres_of("um");
  if (unit == "\\u00C5") return millimetres_of("angstrom");
  return millimetres_of(unit);
}

std::optional<double> described_positive(std::string_view text) {
  const auto number = finite_number(text);
  return number.value_or(0) > 0 ? number : std::nullopt;
}

std::uint64_t described_count(std::string_view text, std::uint64_t otherwise) {
  const auto count = parse_uint64(text);
  return count && *count >= 1 && *count <= kMostOfAKind ? *count : otherwise;
}

}  // namespace isomesh::import
