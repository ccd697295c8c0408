#include "server/mesh/extract/open_cavities.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <stop_token>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/lattice/tetrahedra.h"
#include "server/mesh/topology/topology.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/heap.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::Point;

constexpr double kIso = 0.5;

// Samples, and centres of cells behind them, with the edges between them.
struct Graph {
  std::vector<bool> is_inside;
  std::vector<bool> is_at_border;
  std::vector<std::vector<std::size_t>> neighbours;

  void join(std::size_t a, std::size_t b) {
    neighbours[a].push_back(b);
    neighbours[b].push_back(a);
  }

  // The connected parts of what is inside or outside.
  std::vector<std::vector<std::size_t>> parts(bool of_inside) const {
    std::vector<bool> is_seen(is_inside.size(), false);
    std::vector<std::vector<std::size_t>> result;
    for (std::size_t first = 0; first < is_inside.size(); ++first) {
      if (is_seen[first] || is_inside[first] != of_inside) continue;
      std::vector<std::size_t> part = {first};
      is_seen[first] = true;
      for (std::size_t n = 0; n < part.size(); ++n) {
        for (const std::size_t next : neighbours[part[n]]) {
          if (is_seen[next] || is_inside[next] != of_inside) continue;
          is_seen[next] = true;
          part.push_back(next);
        }
      }
      result.push_back(std::move(part));
    }
    return result;
  }

  bool is_open(const std::vector<std::size_t>& part) const {
    return std::ranges::any_of(part, [&](std::size_t node) { return is_at_border[node]; });
  }
};

// Calls visit(x, y, z, the number of sample (x, y, z)).
template <class Visit>
void visit_samples(const Dims& dims, Visit visit) {
  std::size_t number = 0;
  for (std::uint32_t z = 0; z < dims.z; ++z) {
    for (std::uint32_t y = 0; y < dims.y; ++y) {
      for (std::uint32_t x = 0; x < dims.x; ++x) visit(x, y, z, number++);
    }
  }
}

template <class T>
Graph samples_of(const test::SampleVolume<T>& volume) {
  const Dims& dims = volume.dims;
  Graph graph;
  visit_samples(dims, [&](auto x, auto y, auto z, std::size_t number) {
    graph.is_inside.push_back(static_cast<double>(volume.samples[number]) >= kIso);
    graph.is_at_border.push_back(x == 0 || y == 0 || z == 0 || x + 1 == dims.x || y + 1 == dims.y ||
                                 z + 1 == dims.z);
  });
  graph.neighbours.resize(graph.is_inside.size());
  return graph;
}

// Joined where voxels share faces.
template <class T>
Graph voxels(const test::SampleVolume<T>& volume) {
  Graph graph = samples_of(volume);
  const Dims& dims = volume.dims;
  visit_samples(dims, [&](auto x, auto y, auto z, std::size_t number) {
    if (x + 1 < dims.x) graph.join(number, number + 1);
    if (y + 1 < dims.y) graph.join(number, number + dims.x);
    if (z + 1 < dims.z) graph.join(number, number + std::size_t{dims.x} * dims.y);
  });
  return graph;
}

// Its tetrahedra have two centres of neighbouring cells, and two neighbouring corners that both
// cells have.
template <class T>
Graph body_centred(const test::SampleVolume<T>& volume) {
  Graph graph = voxels(volume);
  const Dims& dims = volume.dims;
  const std::size_t samples = graph.is_inside.size();
  graph.is_inside.resize(2 * samples, true);  // those behind the last samples are in no part
  graph.is_at_border.resize(2 * samples, false);
  graph.neighbours.resize(2 * samples);
  visit_samples(dims, [&](auto x, auto y, auto z, std::size_t number) {
    if (x + 1 == dims.x || y + 1 == dims.y || z + 1 == dims.z) return;
    const std::size_t centre = samples + number;
    double sum = 0;
    for (unsigned corner = 0; corner < 8; ++corner) {
      const std::size_t at = number + static_cast<std::size_t>(sample_offset(dims, corner));
      sum += static_cast<double>(volume.samples[at]);
      graph.join(centre, at);
    }
    graph.is_inside[centre] = sum / 8 >= kIso;
    if (x > 0) graph.join(centre, centre - 1);
    if (y > 0) graph.join(centre, centre - dims.x);
    if (z > 0) graph.join(centre, centre - std::size_t{dims.x} * dims.y);
  });
  // No cell begins at a last sample.
  visit_samples(dims, [&](auto x, auto y, auto z, std::size_t number) {
    if (x + 1 == dims.x || y + 1 == dims.y || z + 1 == dims.z) {
      graph.neighbours[samples + number].clear();
      graph.is_inside[samples + number] = true;
    }
  });
  return graph;
}

// Joined by all edges of the tetrahedra, as the tables of extraction have them.
template <class T>
Graph lattice_of(const test::SampleVolume<T>& volume, Scheme scheme) {
  if (scheme == Scheme::kBcc) return body_centred(volume);
  Graph graph = samples_of(volume);
  const Dims& dims = volume.dims;
  visit_samples(dims, [&](auto x, auto y, auto z, std::size_t number) {
    if (x + 1 == dims.x || y + 1 == dims.y || z + 1 == dims.z) return;
    const CellSplit& split = cell_split(scheme, ((x + y + z) & 1) != 0);
    for (std::size_t t = 0; t < split.tetrahedra; ++t) {
      for (const unsigned a : split.corners[t]) {
        for (const unsigned b : split.corners[t]) {
          if (a < b) {
            graph.join(number + static_cast<std::size_t>(sample_offset(dims, a)),
                       number + static_cast<std::size_t>(sample_offset(dims, b)));
          }
        }
      }
    }
  });
  return graph;
}

template <class T>
CavityCount expected(const test::SampleVolume<T>& volume) {
  const Graph faces = voxels(volume);
  std::vector<std::vector<std::size_t>> cavities;
  for (auto& part : faces.parts(false)) {
    if (part.size() >= kLeastCavity && !faces.is_open(part)) cavities.push_back(std::move(part));
  }
  CavityCount count = {.cavities = cavities.size()};
  for (const Scheme scheme : test::kSchemes) {
    const Graph lattice = lattice_of(volume, scheme);
    std::vector<bool> is_open(lattice.is_inside.size(), false);
    for (const auto& part : lattice.parts(false)) {
      const bool is_part_open = lattice.is_open(part);
      for (const std::size_t node : part) is_open[node] = is_part_open;
    }
    CavityCount::Open& open = count.open.emplace_back();
    for (const auto& cavity : cavities) {
      if (!is_open[cavity.front()]) continue;
      ++open.cavities;
      open.samples += cavity.size();
    }
  }
  return count;
}

template <class T>
CavityCount found(const test::SampleVolume<T>& volume) {
  const Lattice<T> lattice = volume.lattice();
  return count_cavities(sign_rows(lattice, {.iso = kIso}), test::kSchemes, {});
}

// Noise with features of a few voxels: the mean of each sample and its six neighbours.
test::SampleVolume<float> blobs(double share, const Dims& dims, std::uint64_t seed) {
  const auto noise = test::noise_between<float>(0, 1, dims, seed);
  auto blobs = noise;
  visit_samples(dims, [&](auto x, auto y, auto z, std::size_t number) {
    if (x == 0 || y == 0 || z == 0 || x + 1 == dims.x || y + 1 == dims.y || z + 1 == dims.z) return;
    double sum = noise.samples[number];
    for (const unsigned axis : {1U, 2U, 4U}) {
      const auto step = static_cast<std::size_t>(sample_offset(dims, axis));
      sum += noise.samples[number - step] + noise.samples[number + step];
    }
    blobs.samples[number] = static_cast<float>(sum / 7 - share + kIso);
  });
  return blobs;
}

test::SampleVolume<std::uint8_t> mask_of(const test::SampleVolume<float>& volume) {
  test::SampleVolume<std::uint8_t> mask = {{}, volume.dims, volume.geometry};
  for (const float sample : volume.samples) mask.samples.push_back(sample >= kIso ? 1 : 0);
  return mask;
}

test::SampleVolume<std::uint8_t> mask(const std::function<bool(const Point&)>& is_inside,
                                      std::uint32_t size) {
  test::SampleVolume<std::uint8_t> mask = {{}, {size, size, size}, {}};
  visit_samples(mask.dims, [&](auto x, auto y, auto z, std::size_t) {
    const Point point = {static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)};
    mask.samples.push_back(is_inside(point) ? 1 : 0);
  });
  return mask;
}

// A hollow ball in a cube of 32 samples.
test::SampleVolume<std::uint8_t> shell(double wall, const Point& centre) {
  constexpr double kRadius = 12;
  return mask(
      [=](const Point& p) {
        const double r = std::hypot(p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]);
        return std::abs(r - kRadius) <= wall / 2;
      },
      32);
}

constexpr Point kOffCentre = {15.6, 15.3, 15.8};

// A disc with a normal.
test::SampleVolume<std::uint8_t> disc(double thickness, const Point& normal) {
  constexpr double kRadius = 9;
  const double length = std::hypot(normal[0], normal[1], normal[2]);
  return mask(
      [=](const Point& p) {
        double height = 0;
        double square = 0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const double from = p[axis] - kOffCentre[axis];
          height += from * normal[axis] / length;
          square += from * from;
        }
        return std::abs(height) <= thickness / 2 && square <= kRadius * kRadius;
      },
      32);
}

template <class T>
Topology topology(const test::SampleVolume<T>& volume, Scheme scheme) {
  return measure_topology(test::extracted(volume, {.iso = kIso, .scheme = scheme, .close = true}),
                          {});
}

TEST(OpenCavities, AreThoseOfASlowSearch) {
  std::array<std::uint64_t, 3> open = {};
  std::array<std::uint64_t, 3> closed = {};
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    SCOPED_TRACE(seed);
    // Rows of one word and of two, planes of one slab and of two.
    const Dims dims = {seed % 3 == 0 ? 67U : 21U, 19, seed % 2 == 0 ? 34U : 17U};
    const auto grey = blobs(0.37 + 0.02 * static_cast<double>(seed % 6), dims, seed);
    const CavityCount count = found(grey);
    EXPECT_EQ(count, expected(grey));
    const auto mask = mask_of(grey);
    EXPECT_EQ(found(mask), expected(mask));
    // So low that two centres outside are joined across four samples inside.
    auto low = grey;
    std::ranges::transform(mask.samples, low.samples.begin(),
                           [](int one) { return 0.6F * static_cast<float>(one); });
    EXPECT_EQ(found(low), expected(low));
    for (std::size_t n = 0; n < open.size(); ++n) {
      open[n] += count.open[n].cavities;
      closed[n] += count.cavities - count.open[n].cavities;
    }
  }
  for (const std::uint64_t each : open) EXPECT_GT(each, 10U);
  for (const std::uint64_t each : closed) EXPECT_GT(each, 10U);
}

// The rule of connectivity, on surfaces as they are extracted.
TEST(OpenCavities, FollowTheRuleOfTheSurface) {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    auto volume = blobs(0.5, {14, 15, 16}, seed);
    test::set_border(volume, 0.0F);
    for (const Scheme scheme : test::kSchemes) {
      const Graph lattice = lattice_of(volume, scheme);
      std::uint64_t shells = lattice.parts(true).size();
      for (const auto& part : lattice.parts(false)) shells += lattice.is_open(part) ? 0 : 1;
      const std::uint64_t unused = scheme == Scheme::kBcc ? 14 * 15 * 16 - 13 * 14 * 15 : 0;
      EXPECT_EQ(topology(volume, scheme).components, shells - unused);
    }
  }
}

TEST(OpenCavities, OfAShellAreWhereItsSurfaceHasHoles) {
  for (const Point& centre : {kOffCentre, Point{16, 16, 16}, Point{15.5, 15.5, 15.5}}) {
    // Up to the longest edge of the lattice, the wall may have holes.
    const std::array longest = {std::sqrt(3.0), std::sqrt(2.0), 1.5};
    for (const double wall : {1.0, 1.25, 1.5, 1.75, 2.0}) {
      SCOPED_TRACE(wall);
      const auto volume = shell(wall, centre);
      const CavityCount count = found(volume);
      EXPECT_EQ(count.cavities, 1U);
      for (std::size_t n = 0; n < test::kSchemes.size(); ++n) {
        const Topology surface = topology(volume, test::kSchemes[n]);
        const bool is_whole = surface.components == 2;
        EXPECT_EQ(count.open[n].cavities, is_whole ? 0U : 1U);
        EXPECT_EQ(count.open[n].samples > 0, !is_whole);
        EXPECT_EQ(surface.euler == 4, is_whole);
        EXPECT_TRUE(is_whole || wall < longest[n]);
      }
      EXPECT_EQ(count.open[0].cavities, wall <= 1.5 ? 1U : 0U);
    }
  }
}

TEST(OpenCavities, AreNotInWhatIsSolid) {
  const auto ball =
      mask([](const Point& p) { return std::hypot(p[0] - 15, p[1] - 15, p[2] - 15) < 11; }, 32);
  const auto box = mask([](const Point& p) { return p[0] > 3 && p[1] > 5 && p[2] < 20; }, 32);
  for (const auto& solid : {ball, box, test::constant<std::uint8_t>(1, {9, 9, 9}),
                            test::constant<std::uint8_t>(0, {9, 9, 9})}) {
    EXPECT_EQ(found(solid).cavities, 0U);
  }
  EXPECT_EQ(found(test::constant<std::uint8_t>(1, {9, 9, 1})).cavities, 0U);
}

// Two centres are joined through a wall of one voxel, if the samples in it are hardly inside. One
// of the walls is where two slabs meet.
TEST(OpenCavities, AreOpenedByCentresOnBothSidesOfAWall) {
  for (const std::uint32_t wall : {31U, 32U, 33U}) {
    auto volume = test::constant<float>(0, {20, 20, 50});
    visit_samples(volume.dims, [&](auto x, auto y, auto z, std::size_t number) {
      const bool is_in_box = std::min(x, y) > 2 && std::max(x, y) < 17 && z >= wall && z < 46;
      const bool is_in_hole = std::min(x, y) > 5 && std::max(x, y) < 14 && z > wall && z < 43;
      if (is_in_box && !is_in_hole) volume.samples[number] = 0.6F;
    });
    EXPECT_EQ(found(volume).open, (std::vector<CavityCount::Open>{
                                      {0, 0}, {0, 0}, {1, std::uint64_t{8} * 8 * (42 - wall)}}));
    EXPECT_EQ(found(mask_of(volume)).open[2].cavities, 0U);
  }
}

// Pits of fewer samples than a cavity has are open to a corner of the outside.
TEST(OpenCavities, HaveALeastSize) {
  const auto block = [](std::uint32_t pit) {
    return mask(
        [pit](const Point& p) {
          const auto within = [&](double low, double high) {
            return std::ranges::all_of(p, [&](double x) { return x >= low && x <= high; });
          };
          return within(3, 12) && !within(4, 3 + pit) && !within(3, 3);
        },
        16);
  };
  EXPECT_EQ(found(block(1)).cavities, 0U);
  EXPECT_EQ(found(block(2)).cavities, 1U);
  EXPECT_EQ(found(block(2)).open, (std::vector<CavityCount::Open>{{1, 8}, {0, 0}, {0, 0}}));
}

TEST(OpenCavities, OfDiscsAreNone) {
  // A disc as thick as the longest edge has no hole, whatever its direction.
  const std::array longest = {std::sqrt(3.0) + 1e-9, std::sqrt(2.0) + 1e-9, 2.0};
  for (const Point& normal : {Point{0, 0, 1}, Point{1, 1, 0}, Point{1, -1, 0}, Point{1, 1, 1},
                              Point{-1, 1, 1}, Point{1, 2, 3}, Point{3, -2, 1}, Point{5, 1, -2}}) {
    for (std::size_t n = 0; n < test::kSchemes.size(); ++n) {
      const auto volume = disc(longest[n], normal);
      const Topology surface = topology(volume, test::kSchemes[n]);
      EXPECT_EQ(surface.components, 1U);
      EXPECT_EQ(surface.euler, 2);
      EXPECT_EQ(found(volume).cavities, 0U);
    }
  }
  // The long diagonal of a cell passes a thinner one where it is one of the lattice's edges.
  EXPECT_LT(topology(disc(1.5, {1, 1, 1}), Scheme::kSix).euler, 2);
  EXPECT_EQ(topology(disc(1.5, {-1, 1, 1}), Scheme::kSix).euler, 2);
}

TEST(OpenCavities, AreTheSameOnAnyNumberOfThreads) {
  const auto volume = blobs(0.47, {70, 33, 100}, 5);
  const CavityCount count = test::expect_same_on_any_threads([&] { return found(volume); });
  EXPECT_GT(count.cavities, 10U);
}

TEST(OpenCavities, AreNotCountedInNoiseSoThatMemoryIsBounded) {
  const auto with_cavity = [](std::uint32_t planes) {
    auto volume = test::checkerboard<std::uint8_t>(1, 0, {128, 128, planes});
    visit_samples(volume.dims, [&](auto x, auto y, auto z, std::size_t number) {
      const std::uint32_t most = std::max({x, y, z});
      if (most < 7) volume.samples[number] = std::min({x, y, z}) > 1 && most < 5 ? 0 : 1;
    });
    return volume;
  };
  EXPECT_EQ(found(with_cavity(100)).cavities, 1U);
  const auto noise = with_cavity(140);
  constexpr std::uint64_t kBytesPerStart = 120;
  test::HeapPeak peak;
  EXPECT_EQ(found(noise).cavities, 0U);
  EXPECT_LE(peak.bytes(), kMostRegionStarts * kBytesPerStart);
}

// Planes at the ends of slabs are stripes of few regions, and the others are inside.
TEST(OpenCavities, AreNotCountedBetweenTooManyRunsSoThatMemoryIsBounded) {
  constexpr std::uint32_t kSlab = 32;
  const auto count = [](std::uint32_t slabs) {
    constexpr std::uint32_t kWords = 64;
    const auto classify = [](std::uint32_t y, std::uint32_t z, std::uint64_t* out) {
      constexpr std::uint64_t kStripes = 0x5555'5555'5555'5555;
      std::fill_n(out, kWords, z % kSlab == 0 ? kStripes : ~std::uint64_t{0});
      if (y == 3 && z == 3) out[0] = 0xFF;  // a cavity of 56 samples
    };
    const SignRows rows = {.dims = {kWords * 64, 128, slabs * kSlab + 1}, .classify = classify};
    return count_cavities(rows, std::array{Scheme::kSix}, {}).cavities;
  };
  EXPECT_EQ(count(18), 1U);
  const test::ThreadCount threads(2);  // each has planes of its own
  test::HeapPeak peak;
  EXPECT_EQ(count(60), 0U);
  EXPECT_LE(peak.bytes(), 2 * kMostRunBytes);
}

TEST(OpenCavities, TakeNoMoreMemoryThanIsEstimated) {
  const test::ThreadCount threads(2);
  const auto expect_enough = [](const test::SampleVolume<std::uint8_t>& volume) {
    const Lattice<std::uint8_t> lattice = volume.lattice();
    const ExtractOptions options = {.iso = kIso, .regularize = true};
    const SurfaceSize size = size_of(count_surface(lattice, options, {}));
    test::HeapPeak peak;
    count_cavities(sign_rows(lattice, options), test::kSchemes, {});
    const std::uint64_t estimated =
        cavity_search_memory({.dims = lattice.dims,
                              .vertices = size.vertices,
                              .vertices_at_work = size.most_vertices(kCavityPlanes + 1),
                              .schemes = test::kSchemes.size()});
    EXPECT_GE(estimated, peak.bytes());
    return estimated;
  };
  expect_enough(test::noise<std::uint8_t>({0, 1}, {100, 110, 130}, 7));
  expect_enough(test::noise<std::uint8_t>({0, 1, 1, 1, 1}, {130, 100, 110}, 8));
  expect_enough(test::noise<std::uint8_t>({0, 0, 1}, {600, 500, 2}, 9));
  EXPECT_LT(expect_enough(shell(1.5, kOffCentre)), std::uint64_t{1} << 20);
}

// Labels that are searched at once share the vertices.
TEST(OpenCavities, TakeLittleMoreOnManyThreads) {
  const auto estimated = [](int count) {
    const test::ThreadCount threads(count);
    return cavity_search_memory({.dims = {512, 512, 512},
                                 .vertices = 4'000'000,
                                 .vertices_at_work = 100'000,
                                 .schemes = test::kSchemes.size(),
                                 .at_once = static_cast<std::uint64_t>(count)});
  };
  EXPECT_LT(estimated(16), 2 * estimated(2));
}

TEST(OpenCavities, StopWhenTheyAreCancelled) {
  std::stop_source stop;
  stop.request_stop();
  const auto volume = shell(1.5, kOffCentre);
  const Lattice<std::uint8_t> lattice = volume.lattice();
  EXPECT_EQ(test::code_thrown_by([&] {
              count_cavities(sign_rows(lattice, {.iso = kIso}), test::kSchemes,
                             {stop.get_token(), nullptr});
            }),
            ErrorCode::kCancelled);
}

TEST(IsMask, TellsTwoValuesFromOneAndThree) {
  const auto tells = [](const std::vector<std::int16_t>& values) {
    return is_mask(test::noise<std::int16_t>(values, {30, 40, 50}, 3).lattice(), {});
  };
  EXPECT_TRUE(tells({0, 255}));
  EXPECT_TRUE(tells({-7, 3}));
  EXPECT_FALSE(tells({4}));
  EXPECT_FALSE(is_mask(Lattice<std::int16_t>(), {}));
  EXPECT_FALSE(tells({0, 1, 2}));
  auto volume = test::constant<std::int16_t>(0, {30, 40, 50});
  volume.samples[59'000] = 1;
  EXPECT_TRUE(is_mask(volume.lattice(), {}));
  volume.samples[59'999] = 2;
  EXPECT_FALSE(is_mask(volume.lattice(), {}));
}

}  // namespace
}  // namespace isomesh::mesh
