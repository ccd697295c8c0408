// One volume in each of the 48 orders in which a file can store its axes: its mesh is the same in
// space.
#include "tests/support/storages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/sha256.h"
#include "server/import/import.h"
#include "server/jobs/library/defaults.h"
#include "server/jobs/making/make_samples.h"
#include "server/mesh/labels/label_surface.h"
#include "server/volume/canonical.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using isomesh::test::all_storages;
using isomesh::test::SampleVolume;
using isomesh::test::Storage;
using isomesh::test::stored_as;
using isomesh::test::TemporaryFolder;

template <class T>
std::string as_nrrd(const SampleVolume<T>& volume) {
  const auto place = [](const std::array<double, 3>& numbers) {
    std::ostringstream text;
    text.precision(17);
    text << '(' << numbers[0] << ',' << numbers[1] << ',' << numbers[2] << ')';
    return text.str();
  };
  std::string directions;
  for (int axis = 0; axis < 3; ++axis) {
    directions += (axis == 0 ? "" : " ") + place(step_of(volume.geometry, axis));
  }
  const std::string sizes = std::to_string(volume.dims.x) + ' ' + std::to_string(volume.dims.y) +
                            ' ' + std::to_string(volume.dims.z);
  return nrrd({{"type", std::is_same_v<T, float> ? "float" : "uint8"},
               {"dimension", "3"},
               {"space", "left-posterior-superior"},
               {"sizes", sizes},
               {"space directions", directions},
               {"endian", "little"},
               {"encoding", "raw"},
               {"space origin", place(volume.geometry.origin)}},
              bytes_of(volume.samples));
}

// Its matrix has single precision, so the places differ a little from those of the volume.
template <class T>
std::string as_nifti(const SampleVolume<T>& volume) {
  NiftiFields fields;
  fields.dim = {3, volume.dims.x, volume.dims.y, volume.dims.z, 1, 1, 1, 1};
  std::tie(fields.datatype, fields.bitpix) = nifti_type<T>();
  for (std::size_t row = 0; row < 3; ++row) {
    const double sign = row == 2 ? 1 : -1;  // LPS to RAS
    for (int axis = 0; axis < 3; ++axis) {
      fields.srow[row * 4 + axis] = sign * step_of(volume.geometry, axis)[row];
    }
    fields.srow[row * 4 + 3] = sign * volume.geometry.origin[row];
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    fields.pixdim[axis + 1] = volume.geometry.spacing[axis];
  }
  return nifti(fields, bytes_of(volume.samples));
}

struct Surface {
  std::string samples;  // the digest of the canonical file
  std::vector<mesh::Vec3> vertices;
  std::vector<std::array<std::int64_t, 4>> triangles;  // corners, and the label
};

void append(const mesh::Mesh& mesh, std::int64_t label, Surface& surface) {
  const auto first = static_cast<std::int64_t>(surface.vertices.size());
  surface.vertices.insert(surface.vertices.end(), mesh.positions.begin(), mesh.positions.end());
  for (const mesh::Triangle& corners : mesh.triangles) {
    surface.triangles.push_back(
        {first + corners[0], first + corners[1], first + corners[2], label});
  }
}

// Imports the file, and makes the mesh as the program of jobs does, unless its samples are known.
Surface surface_of(const std::string& file, MeshParameters parameters, const std::string& known) {
  const TemporaryFolder folder(isomesh::test::fast_place());
  isomesh::test::write_file(folder / "upload", file);
  const std::filesystem::path target = folder / "canonical";
  const Volume volume = import_volume(
      {.source = folder / "upload", .scratch = folder.path(), .target = target, .options = {}});
  Surface surface;
  surface.samples = sha256_of(isomesh::test::read_file(target));
  if (surface.samples == known) return surface;
  const volume::CanonicalVolume canonical(target);
  if (parameters.labels) jobs::limit_displacement(volume, parameters);
  parameters.formats.clear();
  const jobs::Report report = [](Stage, double, const Timing&) {};
  jobs::Progress progress({}, report, {});
  jobs::Workspace workspace;
  jobs::make_from_samples({volume.type, volume.dims, volume.geometry, canonical.samples().data()},
                          {.volume = volume,
                           .parameters = parameters,
                           .iso = parameters.iso.value_or(0),
                           .measures = {},
                           .memory_bytes = std::uint64_t{1} << 30},
                          {}, progress, workspace);
  if (!parameters.labels) append(workspace.mesh, 0, surface);
  if (parameters.labels) {
    const auto labels = label_surfaces(workspace.walls, {});
    for (std::size_t n = 0; n < labels.size(); ++n) {
      append(labels[n].mesh, workspace.walls.labels[n], surface);
    }
  }
  return surface;
}

// Finds vertices by their places.
class Places {
 public:
  Places(const Surface& surface, double tolerance) : surface_(surface), tolerance_(tolerance) {
    for (std::size_t n = 0; n < surface.vertices.size(); ++n) {
      cells_.emplace(cell_of(surface.vertices[n], {}), n);
    }
  }

  // The lowest number of a vertex there: labels repeat those that they share.
  std::optional<std::int64_t> at(const mesh::Vec3& place) const {
    std::optional<std::int64_t> lowest;
    for (int n = 0; n < 27; ++n) {
      const std::array<int, 3> beside = {n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1};
      const auto [begin, end] = cells_.equal_range(cell_of(place, beside));
      for (auto each = begin; each != end; ++each) {
        const mesh::Vec3& other = surface_.vertices[each->second];
        const double apart =
            std::hypot(place[0] - other[0], place[1] - other[1], place[2] - other[2]);
        const auto number = static_cast<std::int64_t>(each->second);
        if (apart <= tolerance_) lowest = std::min(lowest.value_or(number), number);
      }
    }
    return lowest;
  }

 private:
  using Cell = std::array<std::int64_t, 3>;

  Cell cell_of(const mesh::Vec3& place, const std::array<int, 3>& beside) const {
    Cell cell;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      cell[axis] =
          static_cast<std::int64_t>(std::floor(place[axis] / (2 * tolerance_))) + beside[axis];
    }
    return cell;
  }

  const Surface& surface_;
  const double tolerance_;
  std::multimap<Cell, std::size_t> cells_;
};

// The triangles in any order, each by its vertices in `places`; empty if a vertex is not there.
std::vector<std::array<std::int64_t, 4>> triangles_at(const Places& places,
                                                      const Surface& surface) {
  std::vector<std::array<std::int64_t, 4>> result;
  for (const auto& triangle : surface.triangles) {
    std::array<std::int64_t, 4> found = triangle;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto vertex = places.at(surface.vertices[static_cast<std::size_t>(triangle[corner])]);
      if (!vertex) return {};
      found[corner] = *vertex;
    }
    std::rotate(found.begin(), std::min_element(found.begin(), found.begin() + 3),
                found.begin() + 3);
    result.push_back(found);
  }
  std::ranges::sort(result);
  return result;
}

// The same triangles, turned the same way, wherever they are in the arrays.
bool are_same(const Surface& one, const Surface& other, double tolerance) {
  if (one.vertices.size() != other.vertices.size()) return false;
  const Places places(one, tolerance);
  return triangles_at(places, one) == triangles_at(places, other);
}

// Counts the storages that give another surface, or other samples, than the first one.
struct Differing {
  int surfaces = 0;
  int samples = 0;

  bool operator==(const Differing&) const = default;
};

template <class T>
Differing differing(const SampleVolume<T>& volume, const MeshParameters& parameters,
                    const std::function<std::string(const SampleVolume<T>&)>& write = as_nrrd<T>) {
  // Equal files of samples give equal meshes, so few of them are made again.
  constexpr int kMadeAgain = 12;
  Differing count;
  std::optional<Surface> first;
  int at = 0;
  const double tolerance = 1e-4 * std::ranges::min(volume.geometry.spacing);
  for (const Storage& storage : all_storages()) {
    const bool is_made = ++at % kMadeAgain == 0 || !first;
    Surface surface = surface_of(write(stored_as(volume, storage)), parameters,
                                 is_made ? std::string() : first->samples);
    if (!first) {
      EXPECT_GT(surface.triangles.size(), 100U);
      first = std::move(surface);
      continue;
    }
    if (surface.samples != first->samples) ++count.samples;
    if (!is_made && surface.samples == first->samples) continue;
    if (!are_same(*first, surface, tolerance)) ++count.surfaces;
  }
  return count;
}

// Numbers whose sums are exact, so that all storages name the same places.
Geometry exact_geometry() {
  return {{-12.5, 8, 3.25}, {0.75, 1, 1.5}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

SampleVolume<float> noise(const Geometry& geometry, std::uint32_t seed) {
  std::mt19937 random(seed);
  SampleVolume<float> volume = {.samples = {}, .dims = {8, 7, 9}, .geometry = geometry};
  while (volume.samples.size() < 8 * 7 * 9) {
    volume.samples.push_back(static_cast<float>(random()) / 4294967296.0F - 0.5F);
  }
  return volume;
}

// Three labels in blobs of a few voxels, and single voxels.
SampleVolume<std::uint8_t> labels(const Geometry& geometry) {
  std::mt19937 random(5);
  SampleVolume<std::uint8_t> volume = {.samples = {}, .dims = {12, 11, 10}, .geometry = geometry};
  std::array<std::array<double, 4>, 9> balls;
  for (auto& ball : balls) {
    for (double& number : ball) number = static_cast<double>(random() % 1000) / 90;
  }
  for (std::uint32_t k = 0; k < 10; ++k) {
    for (std::uint32_t j = 0; j < 11; ++j) {
      for (std::uint32_t i = 0; i < 12; ++i) {
        std::uint8_t label = random() % 40 == 0 ? 2 : 0;
        for (std::size_t n = 0; n < balls.size(); ++n) {
          const auto& [x, y, z, r] = balls[n];
          if (std::hypot(i - x, j - y, k - z) < 1.5 + r / 5) label = n % 3 + 1;
        }
        volume.samples.push_back(label);
      }
    }
  }
  return volume;
}

SampleVolume<float> ball(const Geometry& geometry) {
  SampleVolume<float> volume = noise(geometry, 3);
  volume.dims = {16, 14, 12};
  std::mt19937 random(7);
  volume.samples.clear();
  for (std::uint32_t k = 0; k < 12; ++k) {
    for (std::uint32_t j = 0; j < 14; ++j) {
      for (std::uint32_t i = 0; i < 16; ++i) {
        const double shade = static_cast<double>(random() % 1000) / 5000;
        volume.samples.push_back(
            static_cast<float>(5.3 - std::hypot(i - 7.6, j - 6.7, k - 5.8) + shade));
      }
    }
  }
  return volume;
}

struct IsoCase {
  std::string name;
  MeshParameters parameters;
};

std::vector<IsoCase> iso_cases() {
  std::vector<IsoCase> cases;
  const auto add = [&](const std::string& name, const auto& change) {
    MeshParameters parameters;
    parameters.iso = 0.03;
    change(parameters);
    cases.push_back({name, std::move(parameters)});
  };
  for (const SchemeName scheme : {SchemeName::kSix, SchemeName::kFive, SchemeName::kBcc}) {
    const std::string name = std::to_string(static_cast<int>(scheme_of(scheme)));
    add(name, [&](MeshParameters& p) { p.scheme = scheme; });
    add(name + " as extracted", [&](MeshParameters& p) {
      p.scheme = scheme;
      p.regularize = false;
      p.passes = 0;
    });
    add(name + " midpoints, closed", [&](MeshParameters& p) {
      p.scheme = scheme;
      p.interpolation = Interpolation::kMidpoint;
      p.close = true;
    });
  }
  add("taubin, largest component", [](MeshParameters& p) {
    p.smoothing = Smoothing::kTaubin;
    p.components.keep = 1;
  });
  add("optimize, untangled", [](MeshParameters& p) {
    p.smoothing = Smoothing::kOptimize;
    p.untangle = true;
  });
  return cases;
}

void expect_one_answer(const Differing& differing, const std::string& name) {
  EXPECT_EQ(differing.surfaces, 0) << "of 48 storages differ: " << name;
  EXPECT_EQ(differing.samples, 0) << "of 48 storages have other samples: " << name;
}

TEST(Storages, GiveOneSurface) {
  for (const IsoCase& each : iso_cases()) {
    expect_one_answer(differing(noise(exact_geometry(), 1), each.parameters), each.name);
  }
}

TEST(Storages, GiveOneSurfaceOfAnObliqueVolume) {
  const std::vector<std::pair<std::string, Geometry>> geometries = {
      {"oblique", isomesh::test::oblique_geometry()},
      {"left-handed", isomesh::test::oblique_left_handed_geometry()},
      {"sheared", isomesh::test::tilted_geometry()}};
  for (const auto& [name, geometry] : geometries) {
    for (const SchemeName scheme : {SchemeName::kSix, SchemeName::kFive, SchemeName::kBcc}) {
      MeshParameters parameters;
      parameters.iso = 0.03;
      parameters.scheme = scheme;
      expect_one_answer(differing(noise(geometry, 2), parameters), name);
    }
  }
}

TEST(Storages, GiveOneSurfaceOfEachLabel) {
  for (const bool close : {false, true}) {
    for (const SchemeName scheme : {SchemeName::kSix, SchemeName::kFive}) {
      MeshParameters parameters = label_parameters({});
      parameters.close = close;
      parameters.scheme = scheme;
      expect_one_answer(differing(labels(exact_geometry()), parameters), "labels");
    }
  }
  expect_one_answer(differing(labels(isomesh::test::oblique_geometry()), label_parameters({})),
                    "oblique labels");
}

TEST(Storages, GiveOneSimplifiedSurface) {
  MeshParameters proven;
  proven.iso = 0.03;
  proven.max_error_mm = 0.2;
  expect_one_answer(differing(ball(exact_geometry()), proven), "proven");
  proven.close = true;
  proven.scheme = SchemeName::kFive;
  expect_one_answer(differing(ball(exact_geometry()), proven), "proven, closed");
  MeshParameters fewer;
  fewer.iso = 0.03;
  fewer.triangles = 400;
  expect_one_answer(differing(ball(exact_geometry()), fewer), "simplified");
  MeshParameters labelled = label_parameters({});
  labelled.triangles = 400;
  expect_one_answer(differing(labels(exact_geometry()), labelled), "simplified labels");
}

// A crop takes the same samples whatever their order.
TEST(Storages, GiveOneSurfaceOfABox) {
  MeshParameters parameters;
  parameters.iso = 0.03;
  parameters.crop = {{{-12, 9, 4}, {-8, 12.5, 12}}};
  expect_one_answer(differing(noise(exact_geometry(), 4), parameters), "crop");
}

TEST(Storages, GiveOneSurfaceOfNifti) {
  MeshParameters parameters;
  parameters.iso = 0.03;
  expect_one_answer(differing<float>(noise(exact_geometry(), 1), parameters, as_nifti<float>),
                    "exact");
  EXPECT_EQ(
      differing<float>(noise(isomesh::test::oblique_geometry(), 2), parameters, as_nifti<float>)
          .surfaces,
      0);
  EXPECT_EQ(differing<std::uint8_t>(labels(isomesh::test::oblique_geometry()), label_parameters({}),
                                    as_nifti<std::uint8_t>)
                .surfaces,
            0);
}

}  // namespace
}  // namespace isomesh::import::test
