#include "server/import/formats/zarr_meaning.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string_view>
#include <utility>

#include "base/text.h"
#include "server/import/formats/placing.h"
#include "server/import/labels/label_table.h"
#include "server/import/source/units.h"

namespace isomesh::import {
namespace {

bool is_spatial(const ZarrAxis& axis) {
  if (!axis.type.empty()) return axis.type == "space";
  return axis.name == "x" || axis.name == "y" || axis.name == "z";
}

struct Line {
  std::vector<double> scale;
  std::vector<double> translation;
  bool has_scale = false;
};

// The transformations of one list, on top of `line`.
void apply(const Json& transformations, Line& line) {
  if (!transformations.is_array()) return;
  for (const Json& each : transformations) {
    const std::string type = zarr_text(zarr_member(each, "type"));
    if (type == "identity") continue;
    const bool is_scale = type == "scale";
    const Json& numbers = zarr_member(each, type.c_str());
    if ((!is_scale && type != "translation") || !numbers.is_array() ||
        numbers.size() != line.scale.size()) {
      throw_unusable("The OME-Zarr's transformation " + in_quotes(type) +
                     " is not supported. A scale and a translation are.");
    }
    line.has_scale |= is_scale;
    for (std::size_t axis = 0; axis < line.scale.size(); ++axis) {
      const double number = numbers[axis].is_number() ? numbers[axis].get<double>() : std::nan("");
      if (!std::isfinite(number)) throw_unusable("The OME-Zarr's scale or translation is damaged.");
      if (is_scale) line.scale[axis] *= number;
      line.translation[axis] =
          is_scale ? line.translation[axis] * number : line.translation[axis] + number;
    }
  }
}

// The millimetres of one step in each axis' unit.
std::vector<double> millimetres_of(const std::vector<ZarrAxis>& axes,
                                   const std::array<std::size_t, 3>& spatial,
                                   SourceVolume& source) {
  std::vector<double> factors;
  for (const std::size_t axis : spatial) factors.push_back(take_unit(axes[axis].unit, source));
  const bool is_missing =
      std::ranges::any_of(spatial, [&](std::size_t axis) { return is_no_unit(axes[axis].unit); });
  if (is_missing && !source.unknown_unit) {
    source.unknown_unit = {.why = "The OME-Zarr does not say the unit of its axes.",
                           .is_assumed = true};
  }
  return factors;
}

// The direction in which an axis grows, in LPS. Empty if the file does not say it.
std::optional<Vector3> direction_of(const std::string& orientation) {
  static const std::map<std::string, Vector3, std::less<>> directions = {
      {"right-to-left", {1, 0, 0}},         {"left-to-right", {-1, 0, 0}},
      {"anterior-to-posterior", {0, 1, 0}}, {"posterior-to-anterior", {0, -1, 0}},
      {"inferior-to-superior", {0, 0, 1}},  {"superior-to-inferior", {0, 0, -1}}};
  const auto found = directions.find(orientation);
  return found == directions.end() ? std::nullopt : std::optional(found->second);
}

// The directions of x, y and z, with a note if the file does not say all of them.
std::array<Vector3, 3> directions_of(const std::vector<ZarrAxis>& axes,
                                     const std::array<std::size_t, 3>& spatial,
                                     std::vector<Note>& notes) {
  constexpr std::array<Vector3, 3> kLps = {Vector3{1, 0, 0}, Vector3{0, 1, 0}, Vector3{0, 0, 1}};
  std::array<Vector3, 3> directions = kLps;
  std::size_t known = 0;
  std::string unknown;
  for (std::size_t each = 0; each < 3; ++each) {
    const std::string& orientation = axes[spatial[each]].orientation;
    if (const auto direction = direction_of(orientation)) {
      directions[each] = *direction;
      ++known;
    } else if (!orientation.empty()) {
      unknown += (unknown.empty() ? "" : ", ") + in_quotes(orientation);
    }
  }
  if (known == 3) return directions;
  if (known == 0 && unknown.empty()) {
    notes.push_back(lps_assumed("An OME-Zarr"));
  } else {
    const std::string why =
        unknown.empty() ? "The OME-Zarr gives the orientation of only some of its axes."
                        : "The OME-Zarr has an orientation of axes that is not known: " + unknown +
                              ". Those such as \"left-to-right\" are.";
    notes.push_back(
        note_of(NoteCode::kSpaceAssumed, why + " Its axes x, y and z were read as those of LPS."));
  }
  return kLps;
}

std::int64_t label_of(const Json& value) {
  if (value.is_number_unsigned() && !std::in_range<std::int64_t>(value.get<std::uint64_t>())) {
    throw_unusable("The OME-Zarr's \"label-value\" " + std::to_string(value.get<std::uint64_t>()) +
                   " is too large. Labels are below 2^63: number them anew.");
  }
  return value.get<std::int64_t>();
}

}  // namespace

const Json& zarr_ome(const Json& group) {
  const Json& attributes = zarr_member(group, "attributes");
  return attributes.is_null() ? group : zarr_member(attributes, "ome");
}

std::vector<ZarrAxis> zarr_axes(const Json& scales, std::size_t count) {
  std::vector<ZarrAxis> axes;
  const Json& listed = zarr_member(scales, "axes");
  if (listed.is_null() && count == 5) {
    for (const char* name : {"t", "c", "z", "y", "x"}) axes.push_back({.name = name});
  }
  if (listed.is_array() && listed.size() <= ZarrArray::kMostAxes) {
    for (const Json& axis : listed) {
      if (axis.is_string()) axes.push_back({.name = zarr_text(axis)});
      if (!axis.is_object()) continue;
      axes.push_back({zarr_text(zarr_member(axis, "name")), zarr_text(zarr_member(axis, "type")),
                      zarr_text(zarr_member(axis, "unit")),
                      zarr_text(zarr_member(zarr_member(axis, "orientation"), "value"))});
    }
  }
  if (axes.size() != count) {
    throw_unusable("The OME-Zarr's metadata does not name the " + std::to_string(count) +
                   " axes of its array.");
  }
  return axes;
}

std::array<std::size_t, 3> zarr_spatial_axes(const std::vector<ZarrAxis>& axes) {
  std::vector<std::size_t> found;
  for (std::size_t axis = axes.size(); axis-- > 0;) {
    if (is_spatial(axes[axis])) found.push_back(axis);
  }
  if (found.size() != 3) {
    throw_unusable("The OME-Zarr has " + std::to_string(found.size()) +
                   " axes of space. A volume has three.");
  }
  std::array<std::size_t, 3> named = {found[0], found[1], found[2]};
  constexpr std::string_view kNames = "xyz";
  std::array<bool, 3> seen = {};
  for (const std::size_t axis : found) {
    const std::size_t place = axes[axis].name.size() == 1 ? kNames.find(axes[axis].name) : 3;
    if (place >= 3 || seen[place]) return {found[0], found[1], found[2]};
    seen[place] = true;
    named[place] = axis;
  }
  return named;
}

void set_zarr_geometry(const Json& scales, const std::vector<ZarrAxis>& axes,
                       const std::array<std::size_t, 3>& spatial, SourceVolume& source) {
  Line line = {std::vector<double>(axes.size(), 1), std::vector<double>(axes.size(), 0)};
  apply(zarr_member(zarr_member(scales, "datasets")[0], "coordinateTransformations"), line);
  apply(zarr_member(scales, "coordinateTransformations"), line);
  const std::array<Vector3, 3> directions = directions_of(axes, spatial, source.notes);
  const std::vector<double> units = millimetres_of(axes, spatial, source);
  source.assumes_spacing |= !line.has_scale;
  Geometry& geometry = source.geometry;
  geometry.origin = {0, 0, 0};
  for (std::size_t each = 0; each < 3; ++each) {
    const std::size_t axis = spatial[each];
    geometry.spacing[each] = line.scale[axis] * units[each];
    for (std::size_t row = 0; row < 3; ++row) {
      geometry.direction[row * 3 + each] = directions[each][row];
      geometry.origin[row] += directions[each][row] * line.translation[axis] * units[each];
    }
  }
}

void set_zarr_labels(const Json& group, SourceVolume& source) {
  const Json& described = zarr_member(zarr_ome(group), "image-label");
  if (!described.is_object()) return;
  source.are_labels = true;
  std::map<std::int64_t, LabelEntry> entries;
  const auto for_each = [&](const char* list, const auto& use) {
    const Json& items = zarr_member(described, list);
    if (!items.is_array()) return;
    for (const Json& item : items) {
      const Json& value = zarr_member(item, "label-value");
      if (!value.is_number_integer()) continue;
      if (const std::int64_t label = label_of(value); label != 0) use(item, entries[label]);
    }
  };
  for_each("colors", [](const Json& item, LabelEntry& entry) {
    const Json& rgba = zarr_member(item, "rgba");
    if (!rgba.is_array() || rgba.size() < 3) return;
    std::array<double, 3> color = {};
    for (std::size_t part = 0; part < 3; ++part) {
      if (!rgba[part].is_number_unsigned()) return;
      color[part] = rgba[part].get<double>() / 255;
    }
    entry.color = label_color(color);
  });
  for_each("properties", [](const Json& item, LabelEntry& entry) {
    for (const char* name : {"name", "label", "class"}) {
      if (entry.name.empty()) entry.name = label_name(zarr_text(zarr_member(item, name)));
    }
  });
  std::vector<LabelEntry> labels;
  for (auto& [label, entry] : entries) {
    entry.label = label;
    labels.push_back(std::move(entry));
  }
  source.labels = label_table(std::move(labels));
}

}  // namespace isomesh::import
