#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/text.h"
#include "server/import/formats/format_readers.h"
#include "server/import/formats/placing.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/line_reader.h"

namespace isomesh::import {
namespace {

constexpr double kAngstromPerBohr = 0.529177210903;  // CODATA 2018
constexpr std::int64_t kMostAtoms = 1'000'000;
constexpr std::uint64_t kMostValues = 10'000;

// A count and a vector, and for the atoms maybe the number of values at a point.
struct CountLine {
  std::int64_t count = 0;
  Vector3 vector = {};
  std::uint64_t values = 1;
};

std::optional<CountLine> count_line(std::optional<std::string_view> line, bool may_have_values) {
  if (!line) return std::nullopt;
  const auto parts = words(*line);
  if (parts.size() < 4 || parts.size() > (may_have_values ? 5 : 4)) return std::nullopt;
  CountLine result;
  const auto count = parse_int64(parts[0]);
  if (!count) return std::nullopt;
  result.count = *count;
  const auto numbers = finite_numbers(*line);
  if (numbers.empty()) return std::nullopt;
  std::copy_n(numbers.begin() + 1, 3, result.vector.begin());
  if (parts.size() == 5) {
    const auto values = parse_uint64(parts[4]);
    if (!values || *values < 1 || *values > kMostValues) return std::nullopt;
    result.values = *values;
  }
  return result;
}

struct CubeHeader {
  CountLine atoms;  // the vector is the origin
  std::array<CountLine, 3> axes;
};

std::optional<CubeHeader> read_cube_header(LineReader& lines) {
  lines.next_ended();
  lines.next_ended();
  const auto atoms = count_line(lines.next_ended(), true);
  if (!atoms || std::abs(atoms->count) > kMostAtoms) return std::nullopt;
  CubeHeader header{*atoms, {}};
  for (CountLine& axis : header.axes) {
    const auto line = count_line(lines.next_ended(), false);
    if (!line || line->count == 0) return std::nullopt;
    axis = *line;
  }
  return header;
}

// The numbers of the orbitals, which follow the atoms if their count is negative: how many there
// are, and then each, on one or more lines.
std::uint64_t read_orbitals(LineReader& lines) {
  std::optional<std::uint64_t> count;
  for (std::uint64_t found = 0; !count || found < *count;) {
    const auto line = lines.next_ended();
    if (!line) throw_unusable("The cube file ends within its list of orbitals.");
    auto parts = words(*line);
    if (!count) {
      count = parts.empty() ? std::nullopt : parse_uint64(parts.front());
      if (!count || *count < 1 || *count > kMostValues) {
        throw_unusable("The cube file's number of orbitals is not plausible.");
      }
      parts.erase(parts.begin());
    }
    if (parts.empty() && found < *count) {
      throw_unusable("The cube file's list of orbitals is damaged.");
    }
    found += parts.size();
  }
  return *count;
}

std::uint64_t skip_atoms(LineReader& lines, const CountLine& atoms) {
  for (std::int64_t atom = 0; atom < std::abs(atoms.count); ++atom) {
    if (!lines.next_ended()) throw_unusable("The cube file ends within its list of atoms.");
  }
  return atoms.count < 0 ? read_orbitals(lines) : atoms.values;
}

// A positive number of samples means that lengths are in bohr.
Geometry geometry_of_header(const CubeHeader& header) {
  const bool is_bohr = header.axes[0].count > 0;
  const double unit = is_bohr ? kAngstromPerBohr : 1;
  const auto scaled = [&](Vector3 vector) {
    for (double& part : vector) part *= unit;
    return vector;
  };
  return geometry_of(scaled(header.atoms.vector),
                     {scaled(header.axes[0].vector), scaled(header.axes[1].vector),
                      scaled(header.axes[2].vector)});
}

bool is_cube(std::string_view head) {
  LineReader lines(head);
  return read_cube_header(lines).has_value();
}

SourceVolume parse_cube(const InputFile& file, const Companions& /*companions*/,
                        const ImportOptions& options) {
  LineReader lines(file, {.header = "The header of the cube file"});
  const auto header = read_cube_header(lines);
  if (!header) throw_unusable("The header of the cube file is damaged.");
  SourceVolume volume;
  std::array<std::uint64_t, 3> sizes = {};
  std::ranges::transform(header->axes, sizes.begin(), [](const CountLine& axis) {
    return static_cast<std::uint64_t>(std::abs(axis.count));
  });
  volume.dims = volume_dims(sizes);
  volume.storage_order = {2, 1, 0};
  volume.layout.type = StoredType::kFloat32;
  volume.encoding = Encoding::kText;
  const std::uint64_t values = skip_atoms(lines, header->atoms);
  choose_volume(values, numbered("their value at each point", "value"), options, volume);
  if (values > 1) volume.chosen.run = 1;
  volume.payload = range_from(file, lines.offset());
  volume.geometry = geometry_of_header(*header);
  volume.notes.push_back(angstrom_note("the cube file"));
  return volume;
}

}  // namespace

constinit const Reader kCubeReader = {.name = "cube", .sniff = is_cube, .describe = parse_cube};

}  // namespace isomesh::import
