#include "server/codec/label_titles.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string>

namespace isomesh::codec {
namespace {

// The fractional part of that many golden sections.
double golden_part(std::int64_t label) {
  constexpr double kGoldenSection = 0.6180339887498949;
  constexpr std::int64_t kMostExact = std::int64_t{1} << 32;
  if (label >= -kMostExact && label <= kMostExact) {
    const double turns = static_cast<double>(label) * kGoldenSection;
    return turns - std::floor(turns);
  }
  // A double would lose the fraction. This is it in units of 2^-64, modulo 1.
  constexpr std::uint64_t kGoldenPart = 0x9E3779B97F4A7C15;
  return static_cast<double>((static_cast<std::uint64_t>(label) * kGoldenPart) >> 11) * 0x1p-53;
}

// Consecutive labels are a golden section of the hue circle apart.
std::array<double, 3> series_color(std::int64_t label) {
  constexpr double kSaturation = 0.5;
  constexpr double kValue = 0.9;
  const double hue = 6 * golden_part(label);
  std::array<double, 3> color;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    // A. R. Smith's hexcone (1978), in the form without case distinctions.
    const double k = std::fmod(5 - 2 * static_cast<double>(channel) + hue, 6);
    color[channel] = kValue * (1 - kSaturation * std::max(0.0, std::min({k, 4 - k, 1.0})));
  }
  return color;
}

}  // namespace

std::string title_of(const LabelSummary& label) {
  return label.name.value_or("label " + std::to_string(label.label));
}

std::array<double, 3> color_of(const LabelSummary& label) {
  if (!label.color || label.color->size() != 7) return series_color(label.label);
  std::array<double, 3> color;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    unsigned byte = 0;
    const char* digits = label.color->data() + 1 + 2 * channel;
    std::from_chars(digits, digits + 2, byte, 16);
    color[channel] = byte / 255.0;
  }
  return color;
}

std::string ObjGroups::of(const LabelSummary& label) {
  std::string title = title_of(label);
  std::ranges::replace_if(
      title, [](char c) { return c == ' ' || c == '\t' || c == '\\'; }, '_');
  std::string group = title;
  for (int more = 0; !taken_.insert(group).second; ++more) {
    group =
        title + '-' + std::to_string(label.label) + (more == 0 ? "" : '-' + std::to_string(more));
  }
  return group;
}

std::string mtl_material(const std::string& group, const LabelSummary& label) {
  std::string text = "newmtl " + group + "\nKd";
  for (const double channel : color_of(label)) {
    std::array<char, 32> number = {};
    text += ' ';
    text.append(
        number.data(),
        std::to_chars(number.begin(), number.end(), channel, std::chars_format::fixed, 6).ptr);
  }
  return text + '\n';
}

double linear_of(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}

}  // namespace isomesh::codec
