// Line plots as SVG.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace isomesh::bench {

enum class Scale { kLinear, kLog };

struct Axis {
  std::string label;  // with the unit
  Scale scale = Scale::kLinear;
  std::vector<double> ticks = {};  // chosen when empty
};

struct Series {
  std::string label;
  std::vector<std::array<double, 2>> points;  // in the order of x
  bool joined = true;                         // false: marks alone, for figures from elsewhere
};

// A part of the x axis that stands out.
struct Band {
  double from = 0;
  double to = 0;
  std::string label;
};

struct Plot {
  std::string title;
  Axis x;
  Axis y;
  std::vector<Series> series;
  std::optional<Band> band = {};
};

// A complete document on a white ground. Points that are not finite, or not positive on a
// logarithmic axis, are left out. A linear y axis begins at 0 when no point lies below it.
std::string to_svg(const Plot& plot);

}  // namespace isomesh::bench
