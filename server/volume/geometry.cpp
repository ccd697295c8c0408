#include "server/volume/geometry.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/text.h"
#include "server/volume/unusable.h"

namespace isomesh::volume {
namespace {

// The smallest determinant of a direction. A tilted gantry gives about 0.85; no scanner shears a
// lattice below this.
constexpr double kFlattestDeterminant = 0.01;
constexpr double kUnitTolerance = 1e-3;
constexpr std::string_view kAxes = "xyz";
// Bounds on a spacing in millimetres; they include electron microscopy and geology. Beyond them
// areas and volumes overflow or underflow.
constexpr double kFinestSpacing = 1e-6;
constexpr double kCoarsestSpacing = 1e6;
// Leaves 8 of the 24 bits of single precision for positions between neighbouring samples.
constexpr double kFinestRelativeSpacing = 0x1p-16;

Vector3 column(const std::array<double, 9>& matrix, int axis) {
  const auto at = static_cast<std::size_t>(axis);
  return {matrix[at], matrix[at + 3], matrix[at + 6]};
}

double length(const Vector3& v) { return std::hypot(v[0], v[1], v[2]); }

double determinant(const std::array<double, 9>& m) {
  return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
         m[2] * (m[3] * m[7] - m[4] * m[6]);
}

template <class Numbers>
bool all_finite(const Numbers& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](double n) { return std::isfinite(n); });
}

std::optional<FieldError> spacing_fault(const Geometry& geometry) {
  for (int axis = 0; axis < 3; ++axis) {
    const double spacing = geometry.spacing[static_cast<std::size_t>(axis)];
    if (spacing >= kFinestSpacing && spacing <= kCoarsestSpacing) continue;
    return FieldError{"spacing", "the spacing along " + axis_name(static_cast<std::size_t>(axis)) +
                                     " is " + to_text(spacing) +
                                     " mm, which is not between a millionth and a million"};
  }
  return std::nullopt;
}

std::optional<FieldError> direction_fault(const Geometry& geometry) {
  if (!all_finite(geometry.direction)) {
    return FieldError{"direction", "the direction holds a number that is not finite"};
  }
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(length(column(geometry.direction, axis)) - 1) <= kUnitTolerance) continue;
    return FieldError{"direction", "the direction of axis " +
                                       axis_name(static_cast<std::size_t>(axis)) +
                                       " (a column) is not a unit vector"};
  }
  if (std::abs(determinant(geometry.direction)) < kFlattestDeterminant) {
    return FieldError{"direction", "the directions of i, j and k lie in one plane"};
  }
  return std::nullopt;
}

double largest_coordinate(const std::array<std::uint32_t, 3>& dims, const Geometry& geometry) {
  double largest = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    Vector3 position = geometry.origin;
    for (int axis = 0; axis < 3; ++axis) {
      if ((corner >> axis & 1U) == 0) continue;
      const Vector3 step = step_of(geometry, axis);
      const double count = dims[static_cast<std::size_t>(axis)] - 1.0;
      for (std::size_t row = 0; row < 3; ++row) position[row] += step[row] * count;
    }
    for (const double coordinate : position) largest = std::max(largest, std::abs(coordinate));
  }
  return largest;
}

std::optional<FieldError> resolution_fault(const std::array<std::uint32_t, 3>& dims,
                                           const Geometry& geometry) {
  const double finest = *std::min_element(geometry.spacing.begin(), geometry.spacing.end());
  const double largest = largest_coordinate(dims, geometry);
  if (finest >= largest * kFinestRelativeSpacing) return std::nullopt;
  return FieldError{"origin", "samples " + to_text(finest) + " mm apart at coordinates of up to " +
                                  to_text(largest) +
                                  " mm leave no room for positions between them in single "
                                  "precision; a spacing must be at least 1/65536 of that"};
}

bool is_perpendicular(const Geometry& geometry) {
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 one = column(geometry.direction, axis);
    const Vector3 next = column(geometry.direction, (axis + 1) % 3);
    const double cosine = std::inner_product(one.begin(), one.end(), next.begin(), 0.0);
    if (std::abs(cosine) > kUnitTolerance) return false;
  }
  return true;
}

std::size_t axis_at(const AxisOrder& order, std::size_t place) {
  return static_cast<std::size_t>(std::abs(order[place]) - 1);
}

std::array<double, 9> turned(const std::array<double, 9>& direction, const AxisOrder& order) {
  std::array<double, 9> result = {};
  for (std::size_t axis = 0; axis < order.size(); ++axis) {
    for (std::size_t row = 0; row < 3; ++row) {
      const double part = direction[row * 3 + axis_at(order, axis)];
      result[row * 3 + axis] = order[axis] < 0 ? -part : part;
    }
  }
  return result;
}

// --- Canonical form ------------------------------------------------------------------------------

constexpr double kEqualCosines = 1e-4;

struct Candidate {
  AxisOrder order = kFilesOrder;
  std::array<double, 9> direction = {};
};

std::vector<Candidate> right_handed_orders(const std::array<double, 9>& direction) {
  std::vector<Candidate> candidates;
  AxisOrder axes = kFilesOrder;
  do {
    for (unsigned signs = 0; signs < 8; ++signs) {
      AxisOrder order = axes;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if ((signs >> axis & 1U) != 0) order[axis] = -order[axis];
      }
      const Candidate candidate = {order, turned(direction, order)};
      if (determinant(candidate.direction) > 0) candidates.push_back(candidate);
    }
  } while (std::ranges::next_permutation(axes).found);
  return candidates;
}

// Leaves those with the largest value.
template <class Value>
void keep_largest(std::vector<Candidate>& candidates, const Value& value) {
  double largest = -std::numeric_limits<double>::infinity();
  for (const Candidate& each : candidates) largest = std::max(largest, value(each));
  std::erase_if(candidates,
                [&](const Candidate& each) { return value(each) < largest - kEqualCosines; });
}

// A step of a decimal grid: 1, 2 or 5 units of the last of so many decimals. A negative number of
// decimals is one of zeros.
struct GridStep {
  double units = 1;
  int decimals = 0;
};

// The largest such step up to `most`, which may be above it by an error of rounding.
GridStep step_up_to(double most) {
  const double limit = most * (1 + 1e-9);
  const int decade = static_cast<int>(std::floor(std::log10(limit)));
  const double units =
      decade < 0 ? limit * std::pow(10.0, -decade) : limit / std::pow(10.0, decade);
  return {units >= 5 ? 5.0 : units >= 2 ? 2.0 : 1.0, -decade};
}

// The nearest number of the grid. Numbers halfway between two are common, and an error of rounding
// must not decide them. So the border is not halfway.
double rounded(double value, const GridStep& step) {
  constexpr double kBorder = 0.4876543;
  const double scale = std::pow(10.0, std::abs(step.decimals));
  const double size = std::abs(value);
  const double scaled = (step.decimals < 0 ? size / scale : size * scale) / step.units;
  const double count = std::floor(scaled + kBorder) * step.units;
  if (count >= 0x1p53) return value;  // coarser than the grid
  return std::copysign(step.decimals < 0 ? count * scale : count / scale, value);
}

// The grids of a geometry (canonical_geometry). The borders between two steps are on both grids. So
// a number near a border becomes the same on either, and a rounded number stays as it is.
constexpr double kSpacingStep = 5.0 / 7 * 1e-6;  // of the spacing
constexpr GridStep kCosineStep = {2, 7};
constexpr double kPlaceStep = 2e-4;  // of the smallest spacing

double settled_spacing(double spacing) {
  return rounded(spacing, step_up_to(spacing * kSpacingStep));
}

std::array<double, 9> settled_direction(const Geometry& geometry) {
  std::array<double, 9> settled = {};
  std::ranges::transform(geometry.direction, settled.begin(),
                         [](double cosine) { return rounded(cosine, kCosineStep); });
  return settled;
}

// The way from the first sample of a lattice to its middle.
Vector3 way_to_middle(const std::array<std::uint32_t, 3>& dims, const Geometry& geometry) {
  Vector3 way = {0, 0, 0};
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 step = step_of(geometry, axis);
    const double steps = (dims[static_cast<std::size_t>(axis)] - 1.0) / 2;
    for (std::size_t row = 0; row < 3; ++row) way[row] += step[row] * steps;
  }
  return way;
}

// Checks the sizes of a request, as volume_dims does for a file.
void check_dims(const RawDescription& description) {
  const std::array<std::uint64_t, 3> sizes = {description.dims[0], description.dims[1],
                                              description.dims[2]};
  try {
    volume_dims(sizes);
  } catch (const Error& error) {
    throw invalid_parameter("dims", error.what());
  }
}

}  // namespace

std::string axis_name(std::size_t axis) {
  return axis < 3 ? std::string(1, "ijk"[axis]) : std::to_string(axis + 1);
}

Geometry geometry_of(const Vector3& origin, const std::array<Vector3, 3>& steps) {
  Geometry geometry;
  geometry.origin = origin;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    geometry.spacing[axis] = length(steps[axis]);
    if (geometry.spacing[axis] == 0) continue;  // it has no direction, and find_fault names it
    for (std::size_t row = 0; row < 3; ++row) {
      geometry.direction[row * 3 + axis] = steps[axis][row] / geometry.spacing[axis];
    }
  }
  return geometry;
}

Vector3 step_of(const Geometry& geometry, int axis) {
  Vector3 step = column(geometry.direction, axis);
  for (double& part : step) part *= geometry.spacing[static_cast<std::size_t>(axis)];
  return step;
}

Geometry normalised(const Geometry& geometry) {
  Geometry result = geometry;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double size = length(column(geometry.direction, static_cast<int>(axis)));
    if (std::abs(size - 1) <= kUnitTolerance) continue;
    result.spacing[axis] *= size;
    for (std::size_t row = 0; row < 3; ++row) result.direction[row * 3 + axis] /= size;
  }
  const auto drop_sign_of_zero = [](double& value) { value += 0.0; };
  std::for_each(result.origin.begin(), result.origin.end(), drop_sign_of_zero);
  std::for_each(result.spacing.begin(), result.spacing.end(), drop_sign_of_zero);
  std::for_each(result.direction.begin(), result.direction.end(), drop_sign_of_zero);
  return result;
}

AxisOrder in_turn(const AxisOrder& first, const AxisOrder& second) {
  AxisOrder both = {};
  std::ranges::transform(second, both.begin(), [&](int axis) {
    const int before = first[static_cast<std::size_t>(std::abs(axis) - 1)];
    return axis < 0 ? -before : before;
  });
  return both;
}

std::optional<AxisOrder> parse_axis_order(std::string_view text) {
  const std::vector<std::string_view> names = split(text, ',');
  AxisOrder order = {};
  if (names.size() != order.size()) return std::nullopt;
  std::set<int> axes;
  for (std::size_t at = 0; at < order.size(); ++at) {
    const bool is_reversed = names[at].starts_with('-');
    const std::string_view name = names[at].substr(is_reversed ? 1 : 0);
    const std::size_t axis = kAxes.find(name);
    if (name.size() != 1 || axis == std::string_view::npos) return std::nullopt;
    order[at] = static_cast<int>(axis + 1) * (is_reversed ? -1 : 1);
    axes.insert(std::abs(order[at]));
  }
  return axes.size() == order.size() ? std::optional(order) : std::nullopt;
}

std::string to_string(const AxisOrder& order) {
  std::string text;
  for (const int axis : order) {
    if (!text.empty()) text += ',';
    if (axis < 0) text += '-';
    text += kAxes[static_cast<std::size_t>(std::abs(axis) - 1)];
  }
  return text;
}

Geometry reoriented(const std::array<std::uint32_t, 3>& dims, const Geometry& geometry,
                    const AxisOrder& order) {
  Geometry result = geometry;
  result.direction = turned(geometry.direction, order);
  const bool is_turned = axis_at(order, 0) != 0 || axis_at(order, 1) != 1 || axis_at(order, 2) != 2;
  if (is_turned && !is_perpendicular(geometry)) {
    throw_unusable(
        "The axes of this volume are not perpendicular, so it can be flipped, but not turned");
  }
  for (std::size_t axis = 0; axis < order.size(); ++axis) {
    const Vector3 before = step_of(geometry, static_cast<int>(axis));
    const Vector3 after = step_of(result, static_cast<int>(axis));
    for (std::size_t row = 0; row < 3; ++row) {
      result.origin[row] += (before[row] - after[row]) * (dims[axis] - 1.0) / 2;
    }
  }
  return normalised(result);
}

AxisOrder canonical_order(const Geometry& geometry) {
  std::vector<Candidate> candidates = right_handed_orders(settled_direction(geometry));
  keep_largest(candidates, [](const Candidate& each) {
    return each.direction[0] + each.direction[4] + each.direction[8];
  });
  for (std::size_t at = 0; at < geometry.direction.size(); ++at) {
    keep_largest(candidates, [&](const Candidate& each) { return each.direction[at]; });
  }
  return candidates.front().order;
}

AxisOrder along_patient(const AxisOrder& change, const Geometry& geometry) {
  const AxisOrder order = canonical_order(geometry);
  AxisOrder back = {};
  for (std::size_t place = 0; place < order.size(); ++place) {
    const int axis = static_cast<int>(place) + 1;
    back[axis_at(order, place)] = order[place] < 0 ? -axis : axis;
  }
  return in_turn(in_turn(back, change), order);
}

std::string axis_codes(const Geometry& geometry) {
  const AxisOrder order = canonical_order(geometry);
  std::string codes(order.size(), ' ');
  for (std::size_t place = 0; place < order.size(); ++place) {
    codes[axis_at(order, place)] = (order[place] < 0 ? "RAI" : "LPS")[place];
  }
  return codes;
}

std::array<std::uint32_t, 3> in_order(const std::array<std::uint32_t, 3>& dims,
                                      const AxisOrder& order) {
  return {dims[axis_at(order, 0)], dims[axis_at(order, 1)], dims[axis_at(order, 2)]};
}

Geometry in_order(const std::array<std::uint32_t, 3>& dims, const Geometry& geometry,
                  const AxisOrder& order) {
  Geometry result = geometry;
  result.direction = turned(geometry.direction, order);
  for (std::size_t place = 0; place < order.size(); ++place) {
    const std::size_t axis = axis_at(order, place);
    result.spacing[place] = geometry.spacing[axis];
    if (order[place] > 0) continue;
    const Vector3 step = step_of(geometry, static_cast<int>(axis));
    for (std::size_t row = 0; row < 3; ++row) result.origin[row] += step[row] * (dims[axis] - 1.0);
  }
  return normalised(result);
}

Geometry canonical_geometry(const std::array<std::uint32_t, 3>& dims, const Geometry& geometry) {
  const Vector3 before = way_to_middle(dims, geometry);
  Geometry settled = geometry;
  std::ranges::transform(geometry.spacing, settled.spacing.begin(), settled_spacing);
  settled.direction = settled_direction(geometry);
  const AxisOrder order = canonical_order(geometry);
  Geometry result = in_order(dims, settled, order);
  const Vector3 after = way_to_middle(in_order(dims, order), result);
  for (std::size_t row = 0; row < 3; ++row) {
    result.origin[row] = geometry.origin[row] + before[row] - after[row];
  }
  const GridStep step = step_up_to(std::ranges::min(result.spacing) * kPlaceStep);
  for (double& place : result.origin) place = rounded(place, step);
  return normalised(result);
}

AxisOrder make_canonical(std::array<std::uint32_t, 3>& dims, Geometry& geometry) {
  const AxisOrder order = canonical_order(geometry);
  geometry = canonical_geometry(dims, geometry);
  dims = in_order(dims, order);
  return order;
}

std::optional<FieldError> find_fault(const std::array<std::uint32_t, 3>& dims,
                                     const Geometry& geometry) {
  if (auto fault = spacing_fault(geometry)) return fault;
  if (auto fault = direction_fault(geometry)) return fault;
  if (!all_finite(geometry.origin)) {
    return FieldError{"origin", "the origin holds a number that is not finite"};
  }
  return resolution_fault(dims, geometry);
}

std::array<std::uint32_t, 3> volume_dims(std::span<const std::uint64_t> sizes) {
  constexpr std::uint64_t kMostSamples = std::uint64_t{1} << 60;
  assert(sizes.size() <= 3);
  std::array<std::uint32_t, 3> dims = {1, 1, 1};
  std::uint64_t samples = 1;
  for (std::size_t axis = 0; axis < sizes.size(); ++axis) {
    if (sizes[axis] == 0) throw_unusable("The size along " + axis_name(axis) + " is 0.");
    if (sizes[axis] > std::numeric_limits<std::uint32_t>::max() ||
        samples > kMostSamples / sizes[axis]) {
      throw_unusable("The size along " + axis_name(axis) +
                     " is not plausible: " + std::to_string(sizes[axis]) + ".");
    }
    samples *= sizes[axis];
    dims[axis] = static_cast<std::uint32_t>(sizes[axis]);
  }
  return dims;
}

void check_limits(std::uint64_t sample_count, SampleType type, const SizeLimits& limits) {
  if (sample_count <= limits.max_sample_bytes / bytes_per_sample(type)) return;
  throw Error(ErrorCode::kTooLarge, "The volume is too large: its samples take " +
                                        std::to_string(sample_count * bytes_per_sample(type)) +
                                        " bytes, and at most " +
                                        std::to_string(limits.max_sample_bytes) + " are accepted.");
}

void check_raw(const RawDescription& description, const SizeLimits& limits) {
  check_dims(description);
  if (const auto fault = find_fault(description.dims, description.geometry)) {
    throw invalid_parameter(fault->field, fault->message);
  }
  const auto& dims = description.dims;
  check_limits(std::uint64_t{dims[0]} * dims[1] * dims[2], description.type, limits);
}

}  // namespace isomesh::volume
