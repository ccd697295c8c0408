#include "server/import/images/tiff_meaning.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/text.h"
#include "proto/error.h"
#include "server/import/source/names.h"
#include "server/import/source/source.h"

namespace isomesh::import {
namespace {

constexpr std::uint64_t kMostOfAKind = 1'000'000;

// The length of a unit in millimetres; empty for unknown units and for pixels.
std::optional<double> length_of(std::string_view unit) {
  Geometry geometry;
  std::vector<Note> notes;
  try {
    scale_to_millimetres(geometry, unit == "\\u00B5m" ? "um" : unit, notes);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kUnusableVolume) throw;
    return std::nullopt;
  }
  if (!notes.empty()) return std::nullopt;
  return geometry.spacing[0];
}

std::optional<double> positive(std::string_view text) {
  const auto number = parse_double(text);
  return number && std::isfinite(*number) && *number > 0 ? number : std::nullopt;
}

std::uint64_t count_of(std::string_view text, std::uint64_t otherwise) {
  const auto count = parse_uint64(text);
  return count && *count >= 1 && *count <= kMostOfAKind ? *count : otherwise;
}

// --- OME -----------------------------------------------------------------------------------------

// The value of an attribute in the text of one tag.
std::string_view attribute(std::string_view tag, std::string_view name) {
  const std::string begin = " " + std::string(name) + "=";
  const std::size_t at = tag.find(begin);
  if (at == std::string_view::npos || at + begin.size() >= tag.size()) return {};
  const char quote = tag[at + begin.size()];
  const std::size_t from = at + begin.size() + 1;
  const std::size_t end = tag.find(quote, from);
  if (end == std::string_view::npos) return {};
  return tag.substr(from, end - from);
}

std::optional<std::array<double, 3>> ome_spacing(std::string_view pixels) {
  std::array<double, 3> spacing = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string name = std::string("PhysicalSize") + "XYZ"[axis];
    const std::string_view unit = attribute(pixels, name + "Unit");
    const auto size = positive(attribute(pixels, name));
    const auto length = length_of(unit.empty() ? "um" : unit);
    if (!size || !length) return std::nullopt;
    spacing[axis] = *size * *length;
  }
  return spacing;
}

TiffMeaning ome_meaning(std::string_view description, std::size_t at) {
  const std::string_view pixels = description.substr(at, description.find('>', at) - at);
  TiffMeaning meaning;
  const std::string_view order = attribute(pixels, "DimensionOrder");
  std::string sorted(order);
  std::ranges::sort(sorted);
  if (sorted != "CTXYZ" || !order.starts_with("XY")) {
    throw_unusable("The DimensionOrder of the OME-TIFF, " + in_quotes(order) + ", is unknown.");
  }
  meaning.order = order;
  meaning.slices = count_of(attribute(pixels, "SizeZ"), 1);
  meaning.channels = count_of(attribute(pixels, "SizeC"), 1);
  meaning.times = count_of(attribute(pixels, "SizeT"), 1);
  meaning.spacing = ome_spacing(pixels);
  return meaning;
}

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
  const auto between = positive(described_value(description, "spacing"));
  if (unit.empty() || !between || !(resolution.x > 0) || !(resolution.y > 0)) return std::nullopt;
  const auto length = [&](std::string_view name) {
    const std::string_view own = described_value(description, name);
    return length_of(own.empty() ? unit : own);
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
  meaning.channels = count_of(described_value(description, "channels"), 1);
  meaning.times = count_of(described_value(description, "frames"), 1);
  const std::uint64_t others = meaning.channels * meaning.times;
  meaning.slices = count_of(described_value(description, "slices"), pages / others);
  meaning.spacing = imagej_spacing(description, resolution);
  meaning.rescale = imagej_rescale(description);
  return meaning;
}

}  // namespace

TiffMeaning tiff_meaning(std::string_view description, const TiffResolution& resolution,
                         std::uint64_t pages) {
  const std::size_t pixels = description.find("<Pixels");
  if (pixels != std::string_view::npos && description.find("<OME") < pixels) {
    return ome_meaning(description, pixels);
  }
  if (description.starts_with("ImageJ=")) return imagej_meaning(description, resolution, pages);
  TiffMeaning meaning;
  meaning.slices = pages;
  return meaning;
}

std::uint64_t TiffMeaning::page_of(std::uint64_t volume, std::uint64_t slice) const {
  const std::uint64_t channel = volume % channels;
  const std::uint64_t time = volume / channels;
  std::uint64_t page = 0;
  std::uint64_t step = 1;
  for (const char axis : std::string_view(order).substr(2)) {
    page += step * (axis == 'Z' ? slice : axis == 'C' ? channel : time);
    step *= axis == 'Z' ? slices : axis == 'C' ? channels : times;
  }
  return page;
}

void check_pages(const TiffMeaning& meaning, std::uint64_t pages) {
  if (meaning.slices * meaning.channels * meaning.times == pages) return;
  throw_unusable("The TIFF's description tells of " + std::to_string(meaning.slices) + " slices, " +
                 std::to_string(meaning.channels) + " channels and " +
                 std::to_string(meaning.times) + " times, but the file has " +
                 std::to_string(pages) + (pages == 1 ? " page." : " pages."));
}

}  // namespace isomesh::import
