#include "server/import/source/units.h"

#include <algorithm>
#include <iterator>
#include <string>

#include "base/text.h"

namespace isomesh::import {
namespace {

struct Prefix {
  std::string_view symbol;
  std::string_view name;
  double millimetres;  // of that part of a metre
};

constexpr Prefix kPrefixes[] = {
    {"Y", "yotta", 1e27},   {"Z", "zetta", 1e24},   {"E", "exa", 1e21},   {"P", "peta", 1e18},
    {"T", "tera", 1e15},    {"G", "giga", 1e12},    {"M", "mega", 1e9},   {"k", "kilo", 1e6},
    {"h", "hecto", 1e5},    {"da", "deca", 1e4},    {"da", "deka", 1e4},  {"", "", 1e3},
    {"d", "deci", 1e2},     {"c", "centi", 1e1},    {"m", "milli", 1},    {"u", "micro", 1e-3},
    {"\xc2\xb5", "", 1e-3}, {"\xce\xbc", "", 1e-3}, {"\xb5", "", 1e-3},   {"n", "nano", 1e-6},
    {"p", "pico", 1e-9},    {"f", "femto", 1e-12},  {"a", "atto", 1e-15}, {"z", "zepto", 1e-18},
    {"y", "yocto", 1e-21}};

struct Other {
  std::string_view name;
  double millimetres;
};

constexpr double kInch = 25.4;
constexpr double kAngstrom = 1e-7;
constexpr double kAstronomical = 149'597'870'700'000;

constexpr Other kOthers[] = {{"angstrom", kAngstrom},
                             {"\xc3\x85", kAngstrom},
                             {"\xe2\x84\xab", kAngstrom},
                             {"micron", 1e-3},
                             {"thou", kInch / 1000},
                             {"pt", kInch / 72},
                             {"li", kInch / 12},
                             {"in", kInch},
                             {"inch", kInch},
                             {"inche", kInch},  // without the s of a plural
                             {"ft", 304.8},
                             {"foot", 304.8},
                             {"feet", 304.8},
                             {"yd", 914.4},
                             {"yard", 914.4},
                             {"mi", 1'609'344},
                             {"mile", 1'609'344},
                             {"ua", kAstronomical},
                             {"ly", 9.4607304725808e18},
                             {"pc", 3.0856775814913673e19},
                             {"parsec", 3.0856775814913673e19}};

std::optional<double> of_symbol(std::string_view symbol) {
  if (!symbol.ends_with('m')) return std::nullopt;
  symbol.remove_suffix(1);
  const auto* found = std::ranges::find(kPrefixes, symbol, &Prefix::symbol);
  return found == std::end(kPrefixes) ? std::nullopt : std::optional(found->millimetres);
}

// `name` is in small letters.
std::optional<double> of_name(std::string_view name) {
  if (name.size() > 2 && name.ends_with('s')) name.remove_suffix(1);
  const auto* other = std::ranges::find(kOthers, name, &Other::name);
  if (other != std::end(kOthers)) return other->millimetres;
  if (!name.ends_with("meter") && !name.ends_with("metre")) return std::nullopt;
  name.remove_suffix(5);
  const auto* found = std::ranges::find(kPrefixes, name, &Prefix::name);
  return found == std::end(kPrefixes) ? std::nullopt : std::optional(found->millimetres);
}

bool counts_samples(std::string_view unit) {
  static constexpr std::string_view kNames[] = {"pixel", "pixels", "voxel", "voxels", "px"};
  return std::ranges::find(kNames, lower(unit)) != std::end(kNames);
}

}  // namespace

std::optional<double> millimetres_of(std::string_view unit) {
  unit = trimmed(unit);
  if (const auto length = of_symbol(unit)) return length;
  const std::string small = lower(unit);
  if (const auto length = of_symbol(small)) return length;
  return of_name(small);
}

bool is_no_unit(std::string_view unit) {
  unit = trimmed(unit);
  return unit.empty() || unit == "?" || unit == "???";
}

double take_unit(std::string_view unit, SourceVolume& volume) {
  unit = trimmed(unit);
  if (is_no_unit(unit)) return 1;
  if (const auto length = millimetres_of(unit)) return *length;
  const bool is_assumed = counts_samples(unit);
  const std::string why = is_assumed
                              ? "The file's unit, " + in_quotes(unit) + ", is not a length."
                              : "The header's unit of length " + in_quotes(unit) + " is unknown.";
  // Axes may have several. One that cannot be assumed decides.
  if (!volume.unknown_unit || !is_assumed) volume.unknown_unit = {why, is_assumed};
  return 1;
}

void scale_to_millimetres(std::string_view unit, SourceVolume& volume) {
  const double millimetres = take_unit(unit, volume);
  if (millimetres == 1) return;
  for (double& value : volume.geometry.origin) value *= millimetres;
  for (double& value : volume.geometry.spacing) value *= millimetres;
}

}  // namespace isomesh::import
