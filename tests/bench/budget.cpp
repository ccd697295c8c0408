#include "tests/bench/budget.h"

#include <algorithm>
#include <ctime>
#include <functional>
#include <limits>
#include <vector>

#include "tests/bench/samples.h"
#include "tests/bench/stages.h"

namespace isomesh::bench {
namespace {

constexpr std::uint32_t kSize = 96;
constexpr int kPasses = 5;
constexpr int kRounds = 5;
constexpr double kAllowance = 2;

// The time that this process had of the processors: others on the machine do not count.
double processor_ms() {
  timespec time = {};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

double processor_ms_of(const std::function<void()>& run) {
  const double begin = processor_ms();
  run();
  return processor_ms() - begin;
}

// What anybody would write: finds each change of sign along the axes and the place where it lies,
// then moves each vertex of a mesh to the mean of its triangles' corners. The sum is returned so
// that nothing is left out.
double plain_loop(const Samples& field, const mesh::Mesh& mesh) {
  const auto* samples = field.as<std::uint8_t>();
  const std::size_t row = field.dims.x;
  const std::size_t plane = row * field.dims.y;
  double sum = 0;
  for (std::size_t i = 0; i + plane < field.dims.samples(); ++i) {
    for (const std::size_t step : {std::size_t{1}, row, plane}) {
      const double here = samples[i] - kFieldIso;
      const double there = samples[i + step] - kFieldIso;
      if ((here < 0) != (there < 0)) sum += here / (here - there);
    }
  }
  std::vector<mesh::Vec3> means(mesh.positions.size());
  std::vector<float> counts(mesh.positions.size());
  for (const mesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) {
      for (const std::uint32_t other : triangle) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          means[vertex][axis] += mesh.positions[other][axis];
        }
      }
      counts[vertex] += 3;
    }
  }
  for (std::size_t v = 0; v < means.size(); ++v) sum += means[v][0] / counts[v];
  return sum;
}

struct Stage {
  const char* name;
  double usual;  // of the loop's time, measured on an AMD EPYC with AVX-512
  std::function<void()> run;
  std::function<void()> prepare = [] {};
};

}  // namespace

Json measure_budget() {
  set_threads(1);
  const Samples field = synthetic_field(kSize);
  Stages plain(field, {.iso = kFieldIso});
  Stages regular(field, {.iso = kFieldIso, .regularize = true});
  Stages job(field, {.iso = kFieldIso});
  MeshParameters simplified = job_to(MeshFormat::kStl, kPasses);
  simplified.max_error_mm = 0.1;
  const auto extract = [&] { plain.extract(); };
  const std::vector<Stage> stages = {
      {"extract", 0.52, extract},
      {"extract, regularised", 1.4, [&] { regular.extract(); }},
      {"smooth", 1.65, [&] { plain.smooth(kPasses); }, extract},
      {"encode to drc", 4.6, [&] { plain.encode(MeshFormat::kDrc); }},
      {"encode to glb", 6.1, [&] { plain.encode(MeshFormat::kGlb); }},
      {"job that simplifies", 69, [&] { job.run_job(simplified); }},
  };
  extract();
  Json rows = Json::array();
  volatile double kept = 0;
  for (const Stage& stage : stages) {
    double stage_ms = std::numeric_limits<double>::infinity();
    double loop_ms = stage_ms;
    for (int round = 0; round < kRounds; ++round) {
      stage.prepare();
      stage_ms = std::min(stage_ms, processor_ms_of(stage.run));
      loop_ms = std::min(loop_ms, processor_ms_of([&] { kept = plain_loop(field, plain.mesh()); }));
    }
    const double ratio = stage_ms / loop_ms;
    rows.push_back({{"stage", stage.name},
                    {"stage_ms", stage_ms},
                    {"loop_ms", loop_ms},
                    {"ratio", ratio},
                    {"usual", stage.usual},
                    {"within", ratio <= kAllowance * stage.usual}});
  }
  return rows;
}

}  // namespace isomesh::bench
