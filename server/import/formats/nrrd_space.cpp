#include "server/import/formats/nrrd_space.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <optional>

#include "base/text.h"
#include "server/import/formats/nrrd_numbers.h"
#include "server/import/source/names.h"
#include "server/import/source/source.h"

namespace isomesh::import {
namespace {

bool is_lattice_kind(std::string_view kind) {
  return kind == "domain" || kind == "space" || kind == "???" || kind == "none";
}

// Kinds of axes along which volumes lie. A vector's components count as volumes.
bool is_volume_kind(std::string_view kind) {
  return kind == "list" || kind == "time" || kind == "vector";
}

std::vector<std::string> kinds_of(const NrrdFields& fields, std::size_t axes) {
  const auto said = words(value_of(fields, "kinds"));
  std::vector<std::string> kinds;
  for (std::size_t axis = 0; axis < axes; ++axis) {
    kinds.push_back(axis < said.size() ? lower(said[axis]) : "none");
  }
  return kinds;
}

std::size_t count_of(std::string_view text, std::string_view part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != text.npos; at = text.find(part, at + 1)) ++count;
  return count;
}

// Only the axes of components may have no direction.
void check_space_is_told(const NrrdFields& fields, std::size_t component_axes) {
  const std::string directions = lower(value_of(fields, "spacedirections"));
  const std::string spacings = lower(value_of(fields, "spacings"));
  const std::string origin = lower(value_of(fields, "spaceorigin"));
  if (count_of(directions, "none") > component_axes || count_of(spacings, "nan") > component_axes ||
      count_of(directions, "nan") > component_axes * 3 || count_of(origin, "nan") > 0) {
    throw_unusable(
        "The NRRD header does not define how its samples are spaced: it has \"none\" or \"nan\".");
  }
}

// The signs that convert a space to LPS.
struct Space {
  std::string_view name;
  std::array<double, 3> to_lps;
};

// Read unchanged, but only if the request accepts it.
constexpr std::string_view kLeftHanded = "3d-left-handed";

// The header's space. Throws for spaces without a known relation to LPS.
std::optional<Space> space_of(const NrrdFields& fields) {
  static constexpr std::array<double, 3> kSame = {1, 1, 1};
  static constexpr Space kReadable[] = {
      {"left-posterior-superior", kSame},
      {"lps", kSame},
      {"right-anterior-superior", {-1, -1, 1}},
      {"ras", {-1, -1, 1}},
      {"left-anterior-superior", {1, -1, 1}},
      {"las", {1, -1, 1}},
      {"scanner-xyz", kSame},
      {"3d-right-handed", kSame},
      {kLeftHanded, kSame},
  };
  const std::string name = lower(value_of(fields, "space"));
  if (name.empty()) return std::nullopt;
  for (const Space& space : kReadable) {
    if (space.name == name) return space;
  }
  throw_unusable("The NRRD header's space " + in_quotes(name) +
                 " is unknown or has more than three dimensions.");
}

// --- Axes ----------------------------------------------------------------------------------------

struct Axis {
  std::uint64_t size = 1;
  bool is_component = false;
  bool is_node = false;  // min and max are the outer samples, not the borders of their cells
  double spacing = kUnknown;
  double min = kUnknown;
  double max = kUnknown;
  std::vector<double> direction;  // the step between samples; NaN if it has none

  bool has_direction() const { return !direction.empty() && is_known(direction.front()); }
};

// The component kinds that an axis of size 1 may have.
bool is_kind_of_one(std::string_view kind) {
  static constexpr std::string_view kKinds[] = {
      "list",   "time", "point", "vector", "contravariant-vector", "covariant-vector",
      "normal", "stub", "scalar"};
  return std::ranges::find(kKinds, kind) != std::end(kKinds);
}

// The format allows "none" and "???" only in this spelling.
bool is_unknown_word(std::string_view word) { return word == "none" || word == "???"; }

void set_kind(Axis& axis, std::string_view word) {
  if (is_unknown_word(word)) {
    // The format's own library ignores the centering of such an axis.
    if (word == "none") axis.is_node = false;
    return;
  }
  const std::string kind = lower(word);
  if (kind == "domain" || kind == "space") return;
  if (!is_kind_of_one(kind)) throw_not_understood("kinds", word);
  axis.is_component = true;
}

void set_center(Axis& axis, std::string_view word) {
  const std::string center = lower(word);
  axis.is_node = center == "node";
  if (!axis.is_node && center != "cell" && !is_unknown_word(word)) {
    throw_not_understood("centers", word);
  }
}

// The number of dimensions of the axes' space; 0 if it is unknown.
std::size_t space_dimension(const NrrdFields& fields) {
  constexpr std::uint64_t kMost = 8;
  const std::string_view text = value_of(fields, "spacedimension");
  const bool is_named = space_of(fields).has_value();
  if (text.empty()) return is_named ? 3 : 0;
  const auto dimension = parse_uint64(text);
  if (is_named || !dimension || *dimension > kMost) throw_not_understood("space dimension", text);
  return *dimension;
}

void set_directions(std::vector<Axis>& axes, const NrrdFields& fields, std::size_t dimension) {
  const std::string_view value = value_of(fields, "spacedirections");
  if (value.empty()) return;
  if (dimension == 0) {
    throw_unusable("The NRRD header has space directions, but no space.");
  }
  std::string_view rest = value;
  for (Axis& axis : axes) {
    const auto direction = take_vector(rest, dimension);
    if (!direction) throw_not_understood("space directions", value);
    axis.direction = *direction;
    if (axis.has_direction() &&
        (is_known(axis.spacing) || is_known(axis.min) || is_known(axis.max))) {
      throw_unusable(
          "The NRRD header has both a direction and a spacing, min or max for the same axis.");
    }
  }
  skip_spaces(rest);
  if (!rest.empty()) throw_not_understood("space directions", value);
}

std::vector<Axis> all_axes(const NrrdFields& fields, std::span<const std::uint64_t> sizes) {
  std::vector<Axis> axes(sizes.size());
  const auto spacings = axis_numbers(fields, "spacings", axes.size());
  const auto mins = axis_numbers(fields, "axismins", axes.size());
  const auto maxs = axis_numbers(fields, "axismaxs", axes.size());
  const auto centers = axis_words(fields, "centers", axes.size());
  const auto kinds = axis_words(fields, "kinds", axes.size());
  for (std::size_t at = 0; at < axes.size(); ++at) {
    Axis& axis = axes[at];
    axis.size = sizes[at];
    axis.spacing = spacings[at];
    if (axis.spacing == 0) throw_not_understood("spacings", "0");
    axis.min = mins[at];
    axis.max = maxs[at];
    if (!centers.empty()) set_center(axis, centers[at]);
    if (!kinds.empty()) set_kind(axis, kinds[at]);
  }
  return axes;
}

// The axes of samples.
std::vector<Axis> lattice_axes(const NrrdFields& fields, std::span<const std::uint64_t> sizes,
                               std::size_t dimension) {
  std::vector<Axis> axes = all_axes(fields, sizes);
  set_directions(axes, fields, dimension);
  const auto components = std::erase_if(axes, [](const Axis& axis) { return axis.is_component; });
  if (components > 1) {
    throw_unusable("The NRRD header has " + std::to_string(components) +
                   " axes of components. At most one is supported.");
  }
  const bool is_plane = dimension == 3 && axes.size() == 2;
  if (dimension != 0 && dimension != axes.size() && !is_plane) {
    throw_unusable("The NRRD header's space has " + std::to_string(dimension) +
                   " dimensions, but its samples lie on " + std::to_string(axes.size()) + " axes.");
  }
  return axes;
}

// --- Geometry ------------------------------------------------------------------------------------

bool has_extent(const Axis& axis) { return is_known(axis.min) && is_known(axis.max); }

// The distance between samples; min and max are the outer samples or the borders of their cells.
double spacing_of_extent(const Axis& axis) {
  const std::uint64_t steps = axis.is_node ? axis.size - 1 : axis.size;
  const double spacing = (axis.max - axis.min) / static_cast<double>(steps);
  if (steps == 0) return 1;
  if (!std::isfinite(spacing) || !(spacing > 0)) {
    throw_unusable(
        "The NRRD header's axis mins and maxs do not give a positive distance between samples.");
  }
  return spacing;
}

// The distance from min to max must be as many spacings as the axis has samples, or one fewer.
// Writers round, and their centers are often missing.
void check_extent(const Axis& axis) {
  constexpr double kTolerance = 0.01;
  const double extent = std::abs(axis.max - axis.min);
  const auto fits = [&](std::uint64_t steps) {
    const double expected = std::abs(axis.spacing) * static_cast<double>(steps);
    return std::abs(extent - expected) <= kTolerance * expected;
  };
  if (!has_extent(axis) || fits(axis.size) || fits(axis.size - 1)) return;
  throw_unusable("The NRRD header contradicts itself: " + std::to_string(axis.size) +
                 " samples with a spacing of " + to_text(axis.spacing) +
                 " do not fit between the axis min " + to_text(axis.min) + " and the axis max " +
                 to_text(axis.max) + ".");
}

void set_step(Geometry& geometry, std::size_t at, const Axis& axis, bool in_space) {
  if (is_known(axis.spacing)) {
    if (in_space) {
      throw_unusable(
          "The NRRD header has a space, but an axis with a spacing instead of a direction.");
    }
    check_extent(axis);
    geometry.spacing[at] = axis.spacing;
    return;
  }
  if (!axis.has_direction()) {
    if (!in_space && has_extent(axis)) geometry.spacing[at] = spacing_of_extent(axis);
    return;
  }
  // Computed as in the format's own library, so that earlier volumes keep the same canonical file,
  // to the last bit.
  double squares = 0;
  for (const double part : axis.direction) squares += part * part;
  const double spacing = std::sqrt(squares);
  if (!std::isfinite(spacing) || spacing == 0) {
    throw_unusable("The NRRD header's space directions are too long or too short for an axis.");
  }
  geometry.spacing[at] = spacing;
  for (std::size_t row = 0; row < 3; ++row) {
    const double part = row < axis.direction.size() ? axis.direction[row] : 0;
    geometry.direction[row * 3 + at] = 1 / spacing * part;
  }
}

void set_space_origin(Geometry& geometry, const NrrdFields& fields, std::size_t dimension) {
  const std::string_view value = value_of(fields, "spaceorigin");
  if (value.empty()) return;
  if (dimension == 0) {
    throw_unusable("The NRRD header has a space origin, but no space.");
  }
  std::string_view rest = value;
  const auto origin = take_vector(rest, dimension);
  if (!origin) throw_not_understood("space origin", value);
  if (!is_known(origin->front())) return;
  std::copy_n(origin->begin(), std::min<std::size_t>(dimension, 3), geometry.origin.begin());
}

// Without a space, the first sample lies half a spacing after the axis min if that is the border of
// a cell.
void set_origin_from_mins(Geometry& geometry, std::span<const Axis> axes) {
  const auto has_length = [](const Axis& axis) {
    return is_known(axis.max) || is_known(axis.spacing);
  };
  if (!is_known(axes.front().min) || !std::ranges::all_of(axes, has_length)) return;
  for (std::size_t at = 0; at < std::min<std::size_t>(axes.size(), 3); ++at) {
    const Axis& axis = axes[at];
    const double spacing = is_known(axis.spacing) ? axis.spacing : spacing_of_extent(axis);
    geometry.origin[at] = axis.min + (axis.is_node ? 0 : spacing / 2);
  }
}

void turn_into_lps(Geometry& geometry, const Space& space) {
  for (std::size_t row = 0; row < 3; ++row) {
    geometry.origin[row] *= space.to_lps[row];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      geometry.direction[row * 3 + axis] *= space.to_lps[row];
    }
  }
}

// A plane in space: the third axis, along which images follow each other, is perpendicular.
void set_normal(Geometry& geometry) {
  auto& m = geometry.direction;
  m[2] = m[3] * m[7] - m[6] * m[4];
  m[5] = m[6] * m[1] - m[0] * m[7];
  m[8] = m[0] * m[4] - m[3] * m[1];
}

// The unit of all axes of the lattice; empty if the header has none. Components may have others.
std::string unit_of(const NrrdFields& fields, const std::vector<std::string>& kinds) {
  const bool in_space = fields.contains("spaceunits");
  const std::string_view text = value_of(fields, in_space ? "spaceunits" : "units");
  std::vector<std::string_view> units;
  for (std::size_t next = text.find('"'), axis = 0; next != text.npos && units.size() < 3; ++axis) {
    const std::size_t end = text.find('"', next + 1);
    if (end == text.npos) throw_unusable("The NRRD header's units are not in quotes.");
    if (in_space || axis >= kinds.size() || is_lattice_kind(kinds[axis])) {
      units.push_back(text.substr(next + 1, end - next - 1));
    }
    next = text.find('"', end + 1);
  }
  if (std::ranges::adjacent_find(units, std::not_equal_to{}) != units.end()) {
    throw_unusable("The NRRD header has different units along its axes.");
  }
  return units.empty() ? "" : std::string(units.front());
}

}  // namespace

std::string own_key(std::string_view key) { return std::string(key) + ":="; }

NrrdSizes nrrd_sizes(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes) {
  const std::vector<std::string> kinds = kinds_of(fields, sizes.size());
  NrrdSizes result;
  result.all = sizes;
  for (std::size_t axis = 0; axis < sizes.size(); ++axis) {
    const std::string& kind = kinds[axis];
    const bool is_fourth = result.lattice.size() == 3;
    if (is_lattice_kind(kind) && !is_fourth) {
      result.lattice.push_back(sizes[axis]);
      continue;
    }
    if (sizes[axis] == 1) continue;
    if (!is_volume_kind(kind) && !is_lattice_kind(kind)) {
      throw_unusable("Each sample has " + std::to_string(sizes[axis]) +
                     " components (an axis of kind " + in_quotes(kind) +
                     "). A sample must be one real number.");
    }
    if (result.volumes > 1) {
      throw_unusable("The NRRD header has a second axis of several volumes, " + axis_name(axis) +
                     " (kind " + in_quotes(kind) + "). Only one such axis is supported.");
    }
    result.volumes = sizes[axis];
    result.volume_kind = is_volume_kind(kind) ? kind : "axis " + axis_name(axis);
    for (const std::uint64_t faster : result.lattice)
      result.run *= std::max<std::uint64_t>(faster, 1);
  }
  return result;
}

namespace {

// The first indices of a Slicer extent, (first, last) along each axis. Empty unless the extent
// matches the sizes.
std::optional<std::array<double, 3>> first_of_extent(const NrrdFields& fields, std::string_view key,
                                                     const std::vector<std::uint64_t>& sizes) {
  const std::vector<std::string_view> numbers = words(value_of(fields, own_key(key)));
  std::array<double, 3> first = {};
  if (numbers.size() != 6 || sizes.size() < 3) return std::nullopt;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto low = parse_int64(numbers[axis * 2]);
    const auto high = parse_int64(numbers[axis * 2 + 1]);
    const bool fits =
        low && high && *high >= *low &&
        static_cast<std::uint64_t>(*high) - static_cast<std::uint64_t>(*low) == sizes[axis] - 1;
    if (!fits) return std::nullopt;
    first[axis] = static_cast<double>(*low);
  }
  return first;
}

// Converts the geometry of old Slicer versions to LPS.
void place_as_slicer(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes,
                     Geometry& geometry, std::vector<Note>& notes) {
  auto first = first_of_extent(fields, "Segment0_Extent", sizes);
  if (!first) first = first_of_extent(fields, "Segmentation_Extent", sizes);
  for (std::size_t row = 0; first && row < 3; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      geometry.origin[row] +=
          geometry.direction[row * 3 + axis] * geometry.spacing[axis] * (*first)[axis];
    }
  }
  turn_into_lps(geometry, {"ras", {-1, -1, 1}});
  notes.push_back(note_of(
      NoteCode::kSpaceAssumed,
      std::string("The NRRD header's space has four dimensions and no name. It has segments "
                  "of 3D Slicer, so it was read as RAS, as 3D Slicer does") +
          (first ? ". The samples begin where the segment's extent begins." : ".")));
}

bool has_pairs_of_slicer(const NrrdFields& fields) {
  return std::ranges::any_of(fields, [](const auto& field) {
    return field.first.starts_with("Segment0_") || field.first.starts_with("Segmentation_");
  });
}

// ITK gives each axis of samples this kind, and names only spaces of three dimensions.
bool has_kinds_of_itk(const std::vector<std::string>& kinds) {
  return std::ranges::all_of(
      kinds, [](const std::string& kind) { return kind == "domain" || kind == "vector"; });
}

// The space has four dimensions and no name. The headers of two programs have that. ITK's space is
// LPS as elsewhere, and old versions of 3D Slicer wrote RAS.
void place_unnamed_4d(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes,
                      const ImportOptions& options, Geometry& geometry, std::vector<Note>& notes) {
  if (has_pairs_of_slicer(fields)) return place_as_slicer(fields, sizes, geometry, notes);
  const bool is_of_itk = has_kinds_of_itk(kinds_of(fields, sizes.size()));
  const std::string reason = "The NRRD header's space has four dimensions and no name";
  if (!is_of_itk && !options.accepts(NoteCode::kSpaceAssumed)) {
    throw_overridable(NoteCode::kSpaceAssumed,
                      reason +
                          ". Programs that write it so differ: ITK means LPS, old versions of 3D "
                          "Slicer mean RAS. If accepted, it is read as LPS.");
  }
  notes.push_back(note_of(
      NoteCode::kSpaceAssumed,
      reason + (is_of_itk ? ". All axes are of the kind \"domain\", as ITK writes them, so it was "
                            "read as LPS, as ITK does."
                          : ". It was read as LPS, as ITK does.")));
}

// A space without a name, or one that is not the patient's.
void note_space(const NrrdFields& fields, std::vector<Note>& notes) {
  const std::string_view name = value_of(fields, "space");
  const std::string lowered = lower(name);
  if (!name.empty() && lowered != "scanner-xyz" && lowered != "3d-right-handed") return;
  const std::string reason = name.empty() ? "The NRRD header does not name the space of its axes"
                                          : "The NRRD header's space, " + in_quotes(name) +
                                                ", does not say how its axes lie in the patient";
  notes.push_back(note_of(NoteCode::kSpaceAssumed,
                          reason +
                              ". They were read as those of LPS, as ITK reads them. Some other "
                              "programs read them as RAS."));
}

void check_handedness(const NrrdFields& fields, const ImportOptions& options,
                      std::vector<Note>& notes) {
  if (lower(value_of(fields, "space")) != kLeftHanded) return;
  if (!options.accepts(NoteCode::kSpaceAssumed)) {
    throw_overridable(
        NoteCode::kSpaceAssumed,
        "The NRRD header's space is left-handed (3D-left-handed), and its directions in "
        "the patient are unknown. If accepted, its axes are read as those of LPS, so "
        "shapes may be mirrored.");
  }
  notes.push_back(note_of(NoteCode::kSpaceAssumed,
                          "The NRRD header's space is left-handed. Its axes were read as those of "
                          "LPS, so shapes may be mirrored."));
}

}  // namespace

Geometry nrrd_geometry(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes,
                       const ImportOptions& options, std::vector<Note>& notes) {
  check_handedness(fields, options, notes);
  const std::vector<std::string> kinds = kinds_of(fields, sizes.size());
  const auto apart = static_cast<std::size_t>(
      std::ranges::count_if(kinds, [](const std::string& kind) { return !is_lattice_kind(kind); }));
  check_space_is_told(fields, apart);
  const std::size_t dimension = space_dimension(fields);
  const std::vector<Axis> axes = lattice_axes(fields, sizes, dimension);
  Geometry geometry;
  for (std::size_t at = 0; at < std::min<std::size_t>(axes.size(), 3); ++at) {
    set_step(geometry, at, axes[at], dimension != 0);
  }
  if (dimension == 3 && axes.size() == 2) set_normal(geometry);
  set_space_origin(geometry, fields, dimension);
  if (dimension == 0 && !axes.empty()) set_origin_from_mins(geometry, axes);
  if (const auto space = space_of(fields)) turn_into_lps(geometry, *space);
  if (dimension == 4 && !space_of(fields)) {
    place_unnamed_4d(fields, sizes, options, geometry, notes);
  } else {
    note_space(fields, notes);
  }
  return geometry;
}

std::string nrrd_unit(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes) {
  return unit_of(fields, kinds_of(fields, sizes.size()));
}

bool nrrd_has_spacing(const NrrdFields& fields, const std::vector<std::uint64_t>& sizes) {
  return std::ranges::any_of(
      lattice_axes(fields, sizes, space_dimension(fields)), [](const Axis& axis) {
        return is_known(axis.spacing) || axis.has_direction() || has_extent(axis);
      });
}

}  // namespace isomesh::import
