// Random headers of NRRD and MetaImage: what they say about space is read as ITK reads it, to the
// last bit, and refused where ITK refuses it.
#include <algorithm>
#include <cmath>
#include <random>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "server/volume/geometry.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/itk_reader.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

constexpr int kHeaders = 3000;

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  std::size_t below(std::size_t count) {
    return std::uniform_int_distribution<std::size_t>(0, count - 1)(engine_);
  }
  // True once in so many times.
  bool once_in(std::size_t times) { return below(times) == 0; }

  template <class Choice>
  Choice one_of(std::initializer_list<Choice> choices) {
    return *(choices.begin() + below(choices.size()));
  }

  // A number as programs write them: short, or with all of its digits, or in scientific notation.
  std::string number() {
    std::ostringstream text;
    text.precision(one_of({3, 6, 17}));
    if (once_in(4)) text << std::scientific;
    text << std::uniform_real_distribution<double>(-300, 300)(engine_);
    return text.str();
  }
  std::string spacing() {
    std::ostringstream text;
    text.precision(one_of({2, 6, 17}));
    text << std::uniform_real_distribution<double>(0.1, 5)(engine_);
    return text.str();
  }

 private:
  std::mt19937_64 engine_;
};

template <class Make>
std::string repeated(std::size_t count, std::string_view between, const Make& make) {
  std::string text;
  for (std::size_t at = 0; at < count; ++at) {
    if (at > 0) text += between;
    text += make(at);
  }
  return text;
}

// A geometry is compared as it is kept: with unit vectors, or not at all where it is unusable, or
// that of a flat image.
std::optional<Geometry> kept(const std::optional<Geometry>& geometry,
                             const std::array<std::uint32_t, 3>& dims) {
  if (!geometry || std::ranges::count(dims, 1U) > 0) return std::nullopt;
  const Geometry unit = volume::normalised(*geometry);
  if (volume::find_fault(dims, unit)) return std::nullopt;
  return unit;
}

std::optional<Geometry> ours(const Outcome& outcome) {
  if (outcome.imported()) return outcome.volume.geometry;
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume) << outcome.error;
  return std::nullopt;
}

// Up to the rounding of the canonical geometry, which may begin at another corner.
void expect_same(const Geometry& found, const Geometry& expected, const std::string& file) {
  const double rounding =
      2e-4 * std::ranges::min(expected.spacing) + 4e-6 * std::ranges::max(expected.spacing);
  for (std::size_t n = 0; n < found.origin.size(); ++n) {
    EXPECT_NEAR(found.spacing[n], expected.spacing[n], 4e-7 * expected.spacing[n]) << file;
    EXPECT_NEAR(found.origin[n], expected.origin[n], rounding) << file;
  }
  for (std::size_t n = 0; n < found.direction.size(); ++n) {
    EXPECT_NEAR(found.direction[n], expected.direction[n], 2e-7) << file;
  }
}

// --- NRRD ----------------------------------------------------------------------------------------

// A header of four samples along each of its axes, one along those of components and beyond the
// third; `space` is told apart, because ITK is told LPS instead of it.
struct NrrdHeader {
  Lines lines;
  std::string space;
  std::array<std::uint32_t, 3> dims = {1, 1, 1};
  std::size_t samples = 1;
  bool leaves_open = false;  // says "none" or "nan", which ITK takes for 1 mm where we may refuse
};

std::string vector_of(Random& random, std::size_t size) {
  const std::string between = random.one_of<std::string>({",", ", "});
  return "(" + repeated(size, between, [&](std::size_t) { return random.number(); }) + ")";
}

// A step mostly along one axis, so that most geometries can be used.
std::string step_of(Random& random, std::size_t size, std::size_t along) {
  return "(" +
         repeated(size, ",",
                  [&](std::size_t row) {
                    if (row == along % size)
                      return (random.once_in(2) ? "-" : "") + random.spacing();
                    return random.once_in(2) ? std::string("0")
                                             : "0.0" + std::to_string(random.below(100));
                  }) +
         ")";
}

// A number of values that is one too many or too few once in so many times.
std::size_t wrong_once_in(Random& random, std::size_t times, std::size_t axes) {
  if (!random.once_in(times)) return axes;
  return axes > 1 && random.once_in(2) ? axes - 1 : axes + 1;
}

std::string nrrd_numbers(Random& random, std::size_t axes, bool positive) {
  return repeated(wrong_once_in(random, 25, axes), " ", [&](std::size_t) -> std::string {
    if (random.once_in(60)) return random.one_of<std::string>({"nan", "inf", "0", "x", "1x", "-1"});
    return positive ? random.spacing() : random.number();
  });
}

void add_space(Random& random, NrrdHeader& header, std::size_t axes, std::size_t component) {
  const bool has_component = component < axes;
  std::size_t dimension = axes - (has_component ? 1 : 0);
  if (random.once_in(20)) dimension = 1 + random.below(5);
  if (random.once_in(3) || dimension != 3) {
    header.lines.emplace_back("space dimension", std::to_string(dimension));
  } else {
    header.space = random.one_of<std::string>({"left-posterior-superior", "LPS", "RAS",
                                               "right-anterior-superior", "LAS", "scanner-xyz",
                                               "3D-right-handed", "left-anterior-superior"});
  }
  if (!random.once_in(10)) {
    std::size_t along = 0;
    const std::string between = random.one_of<std::string>({" ", "  ", ""});
    std::string directions = repeated(axes, between, [&](std::size_t axis) -> std::string {
      if (axis == component || random.once_in(60)) return between.empty() ? " none " : "none";
      if (random.once_in(40)) return vector_of(random, dimension + random.below(2));
      return step_of(random, dimension, along++);
    });
    if (random.once_in(50)) directions += random.one_of<std::string>({" (1,2,3)", " x", "("});
    header.lines.emplace_back("space directions", directions);
  }
  if (!random.once_in(4)) header.lines.emplace_back("space origin", vector_of(random, dimension));
  if (random.once_in(25)) {
    header.lines.emplace_back("spacings", nrrd_numbers(random, axes, true));
  }
}

void add_plain_axes(Random& random, NrrdHeader& header, std::size_t axes) {
  if (!random.once_in(4)) {
    header.lines.emplace_back("spacings", nrrd_numbers(random, axes, true));
  }
  if (random.once_in(2)) {
    header.lines.emplace_back("axis mins", nrrd_numbers(random, axes, false));
  }
  if (random.once_in(3)) {
    header.lines.emplace_back("axis maxs", nrrd_numbers(random, axes, false));
  }
  if (random.once_in(2)) {
    header.lines.emplace_back(
        random.one_of<std::string>({"centers", "centerings"}),
        repeated(wrong_once_in(random, 30, axes), " ", [&](std::size_t) {
          return random.one_of<std::string>({"cell", "node", "Node", "???", "none"});
        }));
  }
  if (random.once_in(40)) header.lines.emplace_back("space origin", vector_of(random, 3));
}

NrrdHeader random_nrrd(Random& random) {
  NrrdHeader header;
  const std::size_t axes = random.one_of<std::size_t>({1, 2, 3, 3, 3, 3, 4, 4, 5});
  const std::size_t component = axes > 1 && random.once_in(3) ? random.below(axes) : axes;
  header.lines = {{"type", "uint8"}, {"dimension", std::to_string(axes)}, {"encoding", "raw"}};
  std::size_t lattice = 0;
  const std::string sizes = repeated(axes, " ", [&](std::size_t axis) -> std::string {
    if (axis == component || lattice >= 3) return "1";
    header.dims[lattice++] = 4;
    header.samples *= 4;
    return "4";
  });
  header.lines.emplace_back("sizes", sizes);
  if (random.once_in(3)) {
    add_plain_axes(random, header, axes);
  } else {
    add_space(random, header, axes, component);
  }
  // Last, as programs write them: the format's own library forgets the centering of an axis of kind
  // "none" where it has read it before.
  if (component < axes || random.once_in(3)) {
    header.lines.emplace_back(
        "kinds", repeated(axes, " ", [&](std::size_t axis) {
          if (axis != component) {
            return random.one_of<std::string>({"domain", "space", "Domain", "???", "none"});
          }
          return random.one_of<std::string>({"vector", "list", "scalar", "stub", "Point", "normal",
                                             "covariant-vector", "contravariant-vector",
                                             "RGB-color", "unheard-of"});
        }));
  }
  for (const auto& [name, value] : header.lines) {
    if (name == "kinds" || name == "centers" || name == "centerings") continue;
    if (value.find("none") != value.npos || value.find("nan") != value.npos) {
      header.leaves_open = true;
    }
  }
  return header;
}

std::string file_of(const NrrdHeader& header, const std::string& space) {
  Lines lines = header.lines;
  // Before the fields that need it.
  if (!space.empty()) lines.insert(lines.begin() + 2, {"space", space});
  return nrrd(lines, std::string(header.samples, 'a'));
}

std::string value_in(const NrrdHeader& header, const std::string& name) {
  for (const auto& [field, value] : header.lines) {
    if (field == name) return value;
  }
  return "";
}

// ITK takes axes of which only min and max are told for axes of steps of 1 mm.
bool has_spacing_of_extent(const NrrdHeader& header) {
  return !value_in(header, "axis maxs").empty() && value_in(header, "spacings").empty();
}

// Random ones contradict each other, which ITK does not notice.
bool has_spacing_and_extent(const NrrdHeader& header) {
  return !value_in(header, "spacings").empty() && !value_in(header, "axis mins").empty() &&
         !value_in(header, "axis maxs").empty();
}

// ITK turns LAS around the wrong axis, so it is told that all spaces are LPS, and the signs are
// written down here.
std::optional<Geometry> itk_reading(const Folder& folder, const NrrdHeader& header) {
  const std::string file = file_of(header, header.space.empty() ? "" : "LPS");
  auto geometry = itk_geometry(ItkFormat::kNrrd, folder.write("header.nrrd", file));
  if (!geometry || header.space.empty()) return geometry;
  const bool from_right = header.space == "RAS" || header.space.starts_with("right-");
  const bool from_anterior =
      from_right || header.space == "LAS" || header.space.starts_with("left-anterior");
  const std::array<double, 3> signs = {from_right ? -1.0 : 1.0, from_anterior ? -1.0 : 1.0, 1.0};
  for (std::size_t row = 0; row < 3; ++row) {
    geometry->origin[row] *= signs[row];
    for (std::size_t axis = 0; axis < 3; ++axis) geometry->direction[row * 3 + axis] *= signs[row];
  }
  return geometry;
}

TEST(ItkSpace, NrrdIsReadAsItkReadsIt) {
  const Folder folder;
  Random random(20261120);
  std::size_t imported = 0;
  std::size_t refused = 0;
  for (int round = 0; round < kHeaders; ++round) {
    const NrrdHeader header = random_nrrd(random);
    if (has_spacing_of_extent(header)) continue;
    const std::string file = file_of(header, header.space);
    const auto expected = kept(itk_reading(folder, header), header.dims);
    const Outcome outcome = import_bytes(file, {}, {.accept = {"space-assumed"}});
    const auto found = ours(outcome);
    if (!found && (header.leaves_open || has_spacing_and_extent(header))) continue;
    EXPECT_EQ(found.has_value(), expected.has_value()) << file << outcome.error;
    if (found && expected) expect_same(*found, *expected, file);
    ++(found ? imported : refused);
  }
  EXPECT_GT(imported, kHeaders / 3U);
  EXPECT_GT(refused, kHeaders / 20U);
}

// --- MetaImage -----------------------------------------------------------------------------------

struct MetaImageHeader {
  Lines lines;
  std::array<std::uint32_t, 3> dims = {1, 1, 1};
  std::size_t samples = 1;
};

std::string metaimage_numbers(Random& random, std::size_t count, bool positive) {
  return repeated(count, random.one_of<std::string>({" ", "  ", "\t"}),
                  [&](std::size_t) { return positive ? random.spacing() : random.number(); });
}

// Rows of unit length that are nearly the axes, so that most geometries can be used.
std::string metaimage_matrix(Random& random, std::size_t axes) {
  const std::size_t shift = random.below(axes);
  return repeated(axes * axes, " ", [&](std::size_t at) -> std::string {
    const bool is_main = (at / axes + shift) % axes == at % axes;
    if (is_main) return random.one_of<std::string>({"1", "-1", "0.9999", "1.5"});
    return random.once_in(3) ? "0.01" + std::to_string(random.below(100)) : "0";
  });
}

MetaImageHeader random_metaimage(Random& random) {
  MetaImageHeader header;
  const std::size_t axes = random.one_of<std::size_t>({1, 2, 3, 3, 3, 3, 4, 5});
  header.lines = {{"ObjectType", "Image"}, {"NDims", std::to_string(axes)}};
  if (random.once_in(3)) header.lines.emplace_back("BinaryData", "True");
  if (random.once_in(3)) {
    header.lines.emplace_back("CenterOfRotation", metaimage_numbers(random, axes, false));
  }
  if (!random.once_in(4)) {
    header.lines.emplace_back(
        random.one_of<std::string>({"TransformMatrix", "Rotation", "Orientation"}),
        metaimage_matrix(random, axes));
  }
  if (!random.once_in(4)) {
    header.lines.emplace_back(random.one_of<std::string>({"Offset", "Position", "Origin"}),
                              metaimage_numbers(random, axes, false));
  }
  if (axes == 3 && random.once_in(3)) {
    header.lines.emplace_back("AnatomicalOrientation",
                              random.one_of<std::string>({"RAI", "LPS", "RAS", "LSA", "???"}));
  }
  if (!random.once_in(3)) {
    header.lines.emplace_back("ElementSpacing", metaimage_numbers(random, axes, true));
  }
  if (random.once_in(3)) {
    header.lines.emplace_back("ElementSize", metaimage_numbers(random, axes, true));
  }
  const std::string sizes = repeated(axes, " ", [&](std::size_t axis) -> std::string {
    if (axis >= 3) return "1";
    header.dims[axis] = 4;
    header.samples *= 4;
    return "4";
  });
  header.lines.emplace_back("DimSize", sizes);
  header.lines.emplace_back("ElementType", "MET_UCHAR");
  header.lines.emplace_back("ElementDataFile", "LOCAL");
  return header;
}

TEST(ItkSpace, MetaImageIsReadAsItkReadsIt) {
  const Folder folder;
  Random random(20261121);
  std::size_t imported = 0;
  for (int round = 0; round < kHeaders; ++round) {
    const MetaImageHeader header = random_metaimage(random);
    const std::string file = metaimage(header.lines, std::string(header.samples, 'a'));
    const auto expected =
        kept(itk_geometry(ItkFormat::kMetaImage, folder.write("header.mha", file)), header.dims);
    const auto found = ours(import_bytes(file));
    EXPECT_EQ(found.has_value(), expected.has_value()) << file << import_bytes(file).error;
    if (found && expected) expect_same(*found, *expected, file);
    if (found) ++imported;
  }
  EXPECT_GT(imported, kHeaders / 2U);
}

}  // namespace
}  // namespace isomesh::import::test
