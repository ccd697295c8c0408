#include "server/mesh/walk/walk.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <memory>
#include <new>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "base/mutex.h"
#include "server/mesh/extract/windows.h"
#include "server/mesh/measure/normals.h"
#include "server/mesh/measure/shapes.h"
#include "server/mesh/topology/window_topology.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/memory_spool.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"
#include "tests/support/step.h"

namespace isomesh::mesh {
namespace {

using test::means;
using Bytes = test::SampleVolume<std::uint8_t>;

// What is found of a surface, as a whole or in windows.
struct Made {
  Mesh mesh;
  Buffer<Vec3> normals;
  SmoothingEffect effect;
  Shapes extracted;
  Shapes smoothed;
  Topology topology;
};

bool are_same(const Extent& a, const Extent& b) {
  return a.area_mm2 == b.area_mm2 && a.volume_mm3 == b.volume_mm3 && a.low == b.low &&
         a.high == b.high;
}

void expect_same(const Made& walked, const Made& whole) {
  EXPECT_TRUE(test::same_bytes(walked.mesh, whole.mesh));
  EXPECT_TRUE(std::ranges::equal(walked.normals, whole.normals));
  EXPECT_TRUE(are_same(walked.effect.before, whole.effect.before));
  EXPECT_TRUE(are_same(walked.effect.after, whole.effect.after));
  EXPECT_EQ(walked.effect.mean_displacement_mm, whole.effect.mean_displacement_mm);
  EXPECT_EQ(walked.effect.max_displacement_mm, whole.effect.max_displacement_mm);
  EXPECT_EQ(walked.extracted.aspect_ratio, whole.extracted.aspect_ratio);
  EXPECT_EQ(walked.extracted.smallest_angle_deg, whole.extracted.smallest_angle_deg);
  EXPECT_EQ(walked.smoothed.aspect_ratio, whole.smoothed.aspect_ratio);
  EXPECT_EQ(walked.smoothed.smallest_angle_deg, whole.smoothed.smallest_angle_deg);
  EXPECT_EQ(walked.topology, whole.topology);
}

struct Case {
  const Bytes& volume;
  ExtractOptions extract;
  SmoothOptions smooth;
  Spool* spool = nullptr;
  Lattice<std::uint8_t> lattice = volume.lattice();
};

Made made_whole(const Case& one) {
  Made made;
  made.mesh = test::extracted(one.volume, one.extract);
  made.extracted = measure_shapes(made.mesh, {});
  made.topology = measure_topology(made.mesh, {});
  made.effect = smooth(one.smooth, {}, made.mesh);
  made.smoothed = measure_shapes(made.mesh, {});
  vertex_normals(made.mesh, {}, made.normals);
  return made;
}

SurfaceWindows windows_of(const Case& one) { return {one.lattice, one.extract, {}, one.spool}; }

// Puts windows together again, each copied in two parts.
class Collector : public WindowUser {
 public:
  explicit Collector(const SurfaceCount& count)
      : extracted_(count.triangles()), smoothed_(count.triangles()) {
    made_.mesh.layer_vertices = count.layer_vertices;
    made_.mesh.layer_triangles = count.layer_triangles;
    made_.mesh.positions.resize_for_overwrite(count.vertices());
    made_.normals.resize_for_overwrite(count.vertices());
    made_.mesh.triangles.resize_for_overwrite(count.triangles());
  }

  void see_extracted(const Mesh& mesh, std::size_t begin, std::size_t end) override {
    extracted_.add(mesh, begin, end);
  }

  std::size_t begin(const Window& window) override {
    const Mesh& mesh = window.mesh;
    smoothed_.add(mesh, 0, mesh.triangles.size());
    places_.insert(&window);
    bytes_ = std::max(bytes_, mesh.positions.capacity_bytes() + mesh.triangles.capacity_bytes());
    made_.mesh.origin = mesh.origin;
    if (!mesh.on_border.empty()) {
      made_.mesh.on_border.resize((made_.mesh.positions.size() + kFlagBits - 1) / kFlagBits);
    }
    return 3;
  }

  InOrder work(const Window& window, std::size_t part) override {
    const auto number = window.first_layer * 3 + part;
    if (part == 2) {
      const auto found = std::make_shared<WindowTopology>(window.mesh, window.below, Context{});
      return [this, found, number] {
        topology_.add(*found);
        order_.push_back(number);
      };
    }
    const Mesh& from = window.mesh;
    const std::uint64_t first = made_.mesh.layer_vertices[window.first_layer];
    if (part == 0) {
      const std::size_t own = from.layer_vertices[from.layers() - 1];
      std::copy_n(from.positions.data(), own, made_.mesh.positions.data() + first);
      std::copy_n(window.normals.data(), own, made_.normals.data() + first);
      // The vertices behind the window are copies of the next window's.
      Tail tail = {first + own,
                   {from.positions.begin() + own, from.positions.end()},
                   {window.normals.begin() + own, window.normals.begin() + from.positions.size()}};
      return [this, number, flags = flags_of(from, own), tail = std::move(tail), first] {
        tails_.push_back(tail);
        for (const std::size_t v : flags) {
          made_.mesh.on_border[(first + v) / kFlagBits] |= std::uint64_t{1}
                                                           << ((first + v) % kFlagBits);
        }
        order_.push_back(number);
      };
    }
    Triangle* to = made_.mesh.triangles.data() + made_.mesh.layer_triangles[window.first_layer];
    const auto shift = static_cast<std::uint32_t>(first);
    for (const auto& [a, b, c] : from.triangles) *to++ = {a + shift, b + shift, c + shift};
    return [this, number] { order_.push_back(number); };
  }

  Made made(const SmoothingEffect& effect) {
    EXPECT_TRUE(std::ranges::is_sorted(order_));
    for (const auto& [first, positions, normals] : tails_) {
      EXPECT_TRUE(std::ranges::equal(positions,
                                     made_.mesh.positions.span().subspan(first, positions.size())));
      EXPECT_TRUE(std::ranges::equal(normals, made_.normals.span().subspan(first, normals.size())));
    }
    made_.effect = effect;
    made_.extracted = extracted_.result();
    made_.smoothed = smoothed_.result();
    made_.topology = topology_.result(made_.mesh.positions.size(), made_.mesh.triangles.size());
    return std::move(made_);
  }

  std::size_t bytes() const { return bytes_ * places_.size(); }

 private:
  // Copies of positions and normals, and the number of the first of them.
  struct Tail {
    std::uint64_t first;
    std::vector<Vec3> positions;
    std::vector<Vec3> normals;
  };

  static std::vector<std::size_t> flags_of(const Mesh& mesh, std::size_t count) {
    std::vector<std::size_t> flags;
    for (std::size_t v = 0; v < count; ++v) {
      if (mesh.is_on_border(v)) flags.push_back(v);
    }
    return flags;
  }

  Made made_;
  ShapesSum extracted_;
  ShapesSum smoothed_;
  TopologySum topology_;
  std::vector<std::size_t> order_;
  std::vector<Tail> tails_;
  std::set<const Window*> places_;
  std::size_t bytes_ = 0;
};

Made made_by_walk(const Case& one, std::uint32_t depth) {
  SurfaceWindows windows = windows_of(one);
  Collector collector(windows.count());
  const WalkEnd end = walk(windows, {one.smooth, depth, true}, {}, collector);
  return collector.made(end.effect);
}

// Empty layers at both ends and in the middle, and components that lie in many layers.
Bytes balls() {
  const test::Field low = test::sphere({6.2, 6.8, 8.1}, 4.3);
  const test::Field high = test::sphere({7.1, 6.2, 23.3}, 4.9);
  return test::sample<std::uint8_t>(
      [=](const test::Point& at) { return 100 + 20 * std::max(low(at), high(at)); }, {14, 14, 32});
}

// Many components, some around single samples that equal the iso-value: smoothing leaves triangles
// without area.
Bytes specks() { return test::noise<std::uint8_t>({0, 1, 60, 61, 200}, {11, 9, 37}, 31); }

Bytes oblique() {
  return test::noise<std::uint8_t>({0, 60, 90}, {9, 12, 21}, 5,
                                   test::oblique_left_handed_geometry());
}

std::vector<SmoothOptions> smoothings() {
  return {{},
          {.steps = means(5, {1})},
          {.steps = means(13, {0.9})},
          {.steps = means(4, {0.33, -0.34})},
          {.steps = means(6, {1}), .max_displacement_mm = 0.2}};
}

// Extraction by every scheme, plain and regularised, open and closed.
std::vector<ExtractOptions> extractions() {
  std::vector<ExtractOptions> result;
  for (const Scheme scheme : test::kSchemes) {
    for (const bool close : {false, true}) {
      for (const bool regularize : {false, true}) {
        result.push_back({.iso = 60, .scheme = scheme, .close = close, .regularize = regularize});
      }
    }
  }
  return result;
}

TEST(Walk, MakesWhatIsMadeOfTheWholeSurface) {
  const std::vector<SmoothOptions> all = smoothings();
  std::uint32_t number = 0;
  for (const Bytes& volume : {balls(), specks(), oblique()}) {
    for (const ExtractOptions& extraction : extractions()) {
      for (const SmoothOptions& smoothing : all) {
        if (++number % test::kStep != 0) continue;
        const Case one = {volume, extraction, smoothing};
        const Made whole = made_whole(one);
        ASSERT_GT(whole.mesh.triangles.size(), 0U);
        const std::uint32_t depth = 1 + number % 4;
        const int threads = depth == 1 ? 3 : 1;
        SCOPED_TRACE(testing::Message()
                     << "scheme " << static_cast<int>(extraction.scheme) << ", regularised "
                     << extraction.regularize << ", closed " << extraction.close << ", steps "
                     << smoothing.steps.size() << ", depth " << depth);
        const test::ThreadCount several(threads);
        expect_same(made_by_walk(one, depth), whole);
      }
    }
  }
}

TEST(Walk, DoesNotDependOnThreadsOrTheDepthOfWindows) {
  const Bytes volume = specks();
  const Case one = {volume, {.iso = 60, .regularize = true}, {.steps = means(20, {1})}};
  const Made whole = made_whole(one);
  for (const std::uint32_t depth : {0U, 1U, 2U, 3U, 5U, 36U, 37U, 64U}) {
    for (const int threads : {1, 2, 8}) {
      SCOPED_TRACE(testing::Message() << "depth " << depth << ", threads " << threads);
      const test::ThreadCount several(threads);
      expect_same(made_by_walk(one, depth), whole);
    }
  }
}

// Vertices that are put back, and the nudged ones beside them, at the seams of windows.
TEST(Walk, PutsVerticesBackAsTheWholeDoes) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const Bytes volume = test::noise<std::uint8_t>({0, 60, 60, 61, 200}, {8, 8, 13}, seed);
    for (const bool regularize : {false, true}) {
      const Case one = {volume, {.iso = 60, .regularize = regularize}, {.steps = means(3, {1})}};
      SCOPED_TRACE(seed);
      expect_same(made_by_walk(one, 1), made_whole(one));
    }
  }
}

TEST(Walk, TakesSurfacesOfNoTrianglesAndOfFewLayers) {
  for (const Bytes& volume :
       {test::constant<std::uint8_t>(0, {5, 5, 9}), test::constant<std::uint8_t>(200, {5, 5, 9}),
        test::constant<std::uint8_t>(200, {5, 5, 1}),
        test::noise<std::uint8_t>({0, 200}, {7, 6, 2}, 3)}) {
    for (const bool close : {false, true}) {
      const Case one = {
          volume, {.iso = 60, .close = close, .regularize = true}, {.steps = means(5, {1})}};
      for (const std::uint32_t depth : {0U, 1U, 2U}) {
        expect_same(made_by_walk(one, depth), made_whole(one));
      }
    }
  }
}

TEST(Walk, TakesAsMuchMemoryForTwiceAsManyLayers) {
  const test::ThreadCount two(2);
  const auto bytes_of = [](std::uint32_t layers) {
    const Bytes volume =
        test::sample<std::uint8_t>(test::scaled(test::gyroid(8), 50, 60), {24, 24, layers});
    const Case one = {volume, {.iso = 60, .regularize = true}, {.steps = means(5, {1})}};
    SurfaceWindows windows = windows_of(one);
    Collector collector(windows.count());
    walk(windows, {one.smooth, 4, true}, {}, collector);
    return collector.bytes();
  };
  const std::size_t bytes = bytes_of(64);
  EXPECT_EQ(bytes_of(128), bytes);
  EXPECT_GT(bytes, 0U);
}

TEST(Walk, MakesTheSameWithASpool) {
  const Bytes volume = specks();
  for (const Scheme scheme : test::kSchemes) {
    for (const int threads : {1, 8}) {
      const test::ThreadCount several(threads);
      test::MemorySpool spool;
      const Case one = {volume,
                        {.iso = 60, .scheme = scheme, .regularize = true},
                        {.steps = means(5, {1})},
                        &spool};
      expect_same(made_by_walk(one, 2), made_whole(one));
      EXPECT_GT(spool.size(), 1000U);
    }
  }
}

TEST(Walk, SaysThatTheSpoolIsFull) {
  const Bytes volume = specks();
  test::MemorySpool spool(1000);
  const Case one = {volume, {.iso = 60, .regularize = true}, {}, &spool};
  EXPECT_EQ(test::code_thrown_by([&] { windows_of(one); }), ErrorCode::kOutOfSpace);
}

// Fails when so many arrays have been read from it.
class FailingSpool : public test::MemorySpool {
 public:
  void read(std::uint64_t at, std::span<std::byte> bytes) const override {
    if (++reads_ > 40) throw Error(ErrorCode::kInternal, "what was set aside is not there");
    test::MemorySpool::read(at, bytes);
  }

 private:
  mutable std::atomic<int> reads_ = 0;
};

TEST(Walk, EndsWithWhatTheSpoolThrows) {
  const Bytes volume = specks();
  for (const int threads : {1, 2, 8}) {
    const test::ThreadCount several(threads);
    FailingSpool spool;
    const Case one = {volume, {.iso = 60, .regularize = true}, {.steps = means(5, {1})}, &spool};
    SurfaceWindows windows = windows_of(one);
    Collector collector(windows.count());
    EXPECT_EQ(test::code_thrown_by([&] {
                walk(windows, {one.smooth, 1, true}, {}, collector);
              }),
              ErrorCode::kInternal);
  }
}

// Ends a walk in one kind of its tasks.
class Thrower : public Collector {
 public:
  enum class In { kSee, kBegin, kWork, kEnd };

  Thrower(const SurfaceCount& count, In in) : Collector(count), in_(in) {}

  void see_extracted(const Mesh& mesh, std::size_t begin, std::size_t end) override {
    if (in_ == In::kSee && ++seen_ == 9) fail();
    Collector::see_extracted(mesh, begin, end);
  }
  std::size_t begin(const Window& window) override {
    if (in_ == In::kBegin && window.first_layer > 8) fail();
    return Collector::begin(window);
  }
  InOrder work(const Window& window, std::size_t part) override {
    const bool is_late = window.first_layer > 8;
    if (in_ == In::kWork && is_late) fail();
    InOrder end = Collector::work(window, part);
    if (in_ == In::kEnd && is_late) return fail;
    return end;
  }

 private:
  static void fail() { throw std::runtime_error("the disk is full"); }

  const In in_;
  std::size_t seen_ = 0;
};

TEST(Walk, EndsWithWhatItsUserThrows) {
  const Bytes volume = specks();
  const Case one = {volume, {.iso = 60, .regularize = true}, {.steps = means(5, {1})}};
  using In = Thrower::In;
  for (const int threads : {1, 2, 8}) {
    const test::ThreadCount several(threads);
    for (const In in : {In::kSee, In::kBegin, In::kWork, In::kEnd}) {
      SurfaceWindows windows = windows_of(one);
      Thrower thrower(windows.count(), in);
      EXPECT_THROW(walk(windows, {one.smooth, 2, true}, {}, thrower), std::runtime_error);
    }
  }
}

// As a report of progress that runs out of memory: it stands between two tasks.
TEST(Walk, EndsWithWhatItsProgressThrows) {
  const Bytes volume = specks();
  const Case one = {volume, {.iso = 60, .regularize = true}, {.steps = means(5, {1})}};
  for (const int threads : {1, 2, 8}) {
    const test::ThreadCount several(threads);
    for (const double from : {0.0, 0.5}) {
      SurfaceWindows windows = windows_of(one);
      Collector collector(windows.count());
      const Context context = {{}, [from](double done) {
                                 if (done >= from) throw std::bad_alloc();
                               }};
      EXPECT_THROW(walk(windows, {one.smooth, 2, true}, context, collector), std::bad_alloc);
    }
  }
}

// Its first part ends when a later window has been begun, as if bytes went to a slow client.
class SlowUser : public Collector {
 public:
  explicit SlowUser(const SurfaceCount& count) : Collector(count) {}

  std::size_t begin(const Window& window) override {
    const Lock lock(mutex_);
    ++begun_;
    changed_.notify_all();
    return Collector::begin(window);
  }

  InOrder work(const Window& window, std::size_t part) override {
    InOrder end = Collector::work(window, part);
    if (window.first_layer > 0 || part > 0) return end;
    return [this, end = std::move(end)] {
      {
        constexpr std::chrono::seconds kLongest(60);  // on a busy machine
        Lock lock(mutex_);
        has_gone_on_ = changed_.wait_for(lock, kLongest,
                                         [this]() ISOMESH_REQUIRES(mutex_) { return begun_ > 1; });
      }
      end();
    };
  }

  bool has_gone_on() const { return has_gone_on_; }

 private:
  Mutex mutex_;
  Condition changed_;
  std::size_t begun_ ISOMESH_GUARDED_BY(mutex_) = 0;  // windows
  bool has_gone_on_ = false;
};

TEST(Walk, GoesOnSmoothingWhileItsUserIsSlow) {
  const Bytes volume = specks();
  const Case one = {volume, {.iso = 60, .regularize = true}, {.steps = means(5, {1})}};
  const test::ThreadCount two(2);
  SurfaceWindows windows = windows_of(one);
  SlowUser slow(windows.count());
  const WalkEnd end = walk(windows, {one.smooth, 2, true}, {}, slow);
  EXPECT_TRUE(slow.has_gone_on());
  expect_same(slow.made(end.effect), made_whole(one));
}

TEST(Walk, StopsWithinAWindow) {
  const Bytes volume = specks();
  const Case one = {volume, {.iso = 60, .regularize = true}, {.steps = means(5, {1})}};
  for (const int threads : {1, 8}) {
    const test::ThreadCount several(threads);
    std::stop_source stop;
    std::size_t told = 0;
    const Context context = {stop.get_token(), [&](double /*share*/) {
                               if (++told == 10) stop.request_stop();
                             }};
    SurfaceWindows windows = windows_of(one);
    Collector collector(windows.count());
    EXPECT_EQ(test::code_thrown_by([&] {
                walk(windows, {one.smooth, 2, true}, context, collector);
              }),
              ErrorCode::kCancelled);
    EXPECT_LE(told, 10U + static_cast<std::size_t>(threads));
  }
}

}  // namespace
}  // namespace isomesh::mesh
