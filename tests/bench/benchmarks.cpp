#include "tests/bench/benchmarks.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <sstream>

#include <benchmark/benchmark.h>
#include <unistd.h>

#include "tests/bench/machine.h"
#include "tests/bench/peers.h"
#include "tests/bench/stages.h"

namespace isomesh::bench {
namespace {

constexpr int kPasses = 5;
constexpr std::uint32_t kLargeField = 512;  // from here on fewer repetitions
constexpr std::uint32_t kLargestSlowPeer = 256;

// One volume of the plan; a synthetic one is made when it is needed.
struct Source {
  std::string name;
  double iso = 0;
  std::function<Samples()> make;
  std::uint32_t field_size = 0;  // 0 for a real volume
};

// The volume that is being measured and what is made of it. Only one is held at a time: benchmarks
// run in the order of their registration, volume by volume.
class Workbench {
 public:
  const Samples& samples(const Source& source) {
    if (!samples_ || samples_->name != source.name) {
      peers_.reset();
      stages_.reset();
      samples_ = std::make_unique<Samples>(source.make());
    }
    return *samples_;
  }

  Stages& stages(const Source& source, const Surface& surface) {
    const Samples& of_source = samples(source);
    peers_.reset();
    stages_ = std::make_unique<Stages>(of_source, surface);
    return *stages_;
  }

  Peers& peers(const Source& source) {
    const Samples& of_source = samples(source);
    stages_.reset();
    peers_ = std::make_unique<Peers>(of_source, source.iso);
    return *peers_;
  }

 private:
  std::unique_ptr<Samples> samples_;
  std::unique_ptr<Stages> stages_;
  std::unique_ptr<Peers> peers_;
};

// One stage: how it is set up once, what precedes every run untimed, and what is timed. `run`
// returns the bytes that it encoded, or 0.
struct StageCase {
  std::string name;
  std::function<std::uint64_t(Stages&)> run;
  std::function<void(Stages&)> set_up = [](Stages&) {};
  std::function<void(Stages&)> prepare = nullptr;
  int passes = 0;
  bool parallel = true;
  // The volumes on which the midpoint rule is timed too.
  enum class Midpoint { kNever, kRealVolume, kAlways } midpoint = Midpoint::kNever;
  bool regular = false;  // whether surfaces that are regularised are timed too

  bool is_for(Interpolation way, const Source& source) const {
    if (way == Interpolation::kLinear || midpoint == Midpoint::kAlways) return true;
    return midpoint == Midpoint::kRealVolume && source.field_size == 0;
  }
};

void make_smooth_mesh(Stages& stages) {
  stages.extract();
  stages.smooth(kPasses);
}

template <class Void>
std::function<std::uint64_t(Stages&)> without_bytes(Void stage) {
  return [stage](Stages& stages) {
    stage(stages);
    return std::uint64_t{0};
  };
}

std::vector<StageCase> stage_cases() {
  const auto extract = [](Stages& stages) { stages.extract(); };
  std::vector<StageCase> cases = {
      {.name = "count",
       .run = without_bytes([](Stages& stages) { benchmark::DoNotOptimize(stages.count()); }),
       .set_up = extract,
       .regular = true},
      {.name = "extract_reused_memory",
       .run = without_bytes(extract),
       .set_up = extract,
       .midpoint = StageCase::Midpoint::kAlways,
       .regular = true},
      {.name = "extract_fresh_memory",
       .run = without_bytes(extract),
       .prepare = [](Stages& stages) { stages.release_memory(); },
       .midpoint = StageCase::Midpoint::kAlways},
      // Every run starts from the extracted positions.
      {.name = "smooth",
       .run = without_bytes([](Stages& stages) { stages.smooth(kPasses); }),
       .set_up = make_smooth_mesh,
       .prepare = extract,
       .passes = kPasses},
      {.name = "measure",
       .run = without_bytes([](Stages& stages) { stages.measure(); }),
       .set_up = make_smooth_mesh},
  };
  for (const Encoding encoding : kEncodings) {
    cases.push_back({.name = std::string("encode_") + name_of(encoding),
                     .run = [encoding](Stages& stages) { return stages.encode(encoding); },
                     .set_up = make_smooth_mesh,
                     .parallel = is_parallel(encoding)});
  }
  for (const MeshFormat format : {MeshFormat::kDrc, MeshFormat::kGlb}) {
    cases.push_back({.name = "job_" + std::string(to_string(format)),
                     .run = [format](Stages& stages) { return stages.run_job(kPasses, format); },
                     .set_up = make_smooth_mesh,
                     .midpoint = StageCase::Midpoint::kRealVolume,
                     .regular = true});
  }
  return cases;
}

struct PeerCase {
  std::string name;
  std::function<void(Peers&)> run;
  std::function<void(Peers&)> set_up = [](Peers&) {};
  std::function<void(Peers&)> prepare = nullptr;
  int passes = 0;
  bool parallel = true;
  bool slow = false;
};

std::vector<PeerCase> peer_cases() {
  const auto release = [](Peers& peers) { peers.release(); };
  const auto contour = [](Peers& peers) { peers.flying_edges(); };
  return {
      {.name = "flying_edges", .run = contour, .prepare = release},
      {.name = "marching_cubes",
       .run = [](Peers& peers) { peers.marching_cubes(); },
       .set_up = contour,
       .parallel = false,
       .slow = true},
      {.name = "smooth_poly_data",
       .run = [](Peers& peers) { peers.smooth(kPasses); },
       .set_up = contour,
       .passes = kPasses,
       .parallel = false,
       .slow = true},
      {.name = "windowed_sinc",
       .run = [](Peers& peers) { peers.windowed_sinc(kPeerSincPasses); },
       .set_up = contour,
       .passes = kPeerSincPasses},
      {.name = "draco_one_call",
       .run = [](Peers& peers) { peers.draco(); },
       .set_up = contour,
       .parallel = false},
      {.name = "pipeline",
       .run = [](Peers& peers) { peers.pipeline(); },
       .set_up = contour,
       .prepare = release},
  };
}

// Times `run`, with `prepare` before each run outside the time.
template <class Subject, class Run>
void time_runs(benchmark::State& state, Subject& subject,
               const std::function<void(Subject&)>& prepare, Run run) {
  for ([[maybe_unused]] auto _ : state) {
    if (prepare) {
      state.PauseTiming();
      prepare(subject);
      state.ResumeTiming();
    }
    run(subject);
  }
}

void set_rates(benchmark::State& state, const MeshSize& size, int passes) {
  const auto rate = [](double amount) {
    return benchmark::Counter(amount, benchmark::Counter::kIsIterationInvariantRate);
  };
  state.counters["triangles"] = static_cast<double>(size.triangles);
  if (passes > 0) {
    state.counters["vertex_passes/s"] = rate(static_cast<double>(size.vertices) * passes);
  } else {
    state.counters["triangles/s"] = rate(static_cast<double>(size.triangles));
  }
}

// Medians of a few short repetitions: the machine is never quiet for long.
void configure(benchmark::internal::Benchmark* registered, const Source& source) {
  registered->UseRealTime()
      ->Unit(benchmark::kMillisecond)
      ->MinTime(0.05)
      ->Repetitions(source.field_size >= kLargeField ? 3 : 5)
      ->ReportAggregatesOnly();
}

const char* lattice_name(Scheme scheme) {
  if (scheme == Scheme::kBcc) return "/bcc/";
  return scheme == Scheme::kSix ? "/six/" : "/five/";
}

class Registry {
 public:
  explicit Registry(const Plan& plan) : plan_(plan) {}

  void add(const Source& source) {
    for (const StageCase& stage : stage_cases()) {
      for (const Scheme scheme : {Scheme::kSix, Scheme::kFive, Scheme::kBcc}) {
        for (const Interpolation way : {Interpolation::kLinear, Interpolation::kMidpoint}) {
          if (!stage.is_for(way, source)) continue;
          for (const int threads : threads_of(stage.parallel)) {
            add_stage(source, stage, {source.iso, scheme, way}, threads);
            if (!stage.regular || way != Interpolation::kLinear) continue;
            add_stage(source, stage, {source.iso, scheme, way, false, true}, threads);
          }
        }
      }
    }
    if (!peers_available()) return;
    for (const PeerCase& peer : peer_cases()) {
      if (peer.slow && source.field_size > kLargestSlowPeer) continue;
      for (const int threads : threads_of(peer.parallel)) add_peer(source, peer, threads);
    }
  }

 private:
  std::vector<int> threads_of(bool parallel) const {
    return parallel ? plan_.threads : std::vector{plan_.threads.front()};
  }

  static std::string suffix(const Source& source, int threads) {
    return "/" + source.name + "/threads:" + std::to_string(threads);
  }

  void add_stage(const Source& source, const StageCase& stage, const Surface& surface,
                 int threads) {
    const std::string name =
        stage.name + lattice_name(surface.scheme) + (surface.regularize ? "regular/" : "") +
        std::string(to_string(surface.interpolation)) + suffix(source, threads);
    const auto body = [this, source, stage, surface, threads](benchmark::State& state) {
      set_threads(threads);
      Stages& stages = workbench_.stages(source, surface);
      stage.set_up(stages);
      std::uint64_t bytes = 0;
      time_runs(state, stages, stage.prepare, [&](Stages& subject) { bytes = stage.run(subject); });
      set_rates(state, stages.size(), stage.passes);
      if (bytes > 0) state.counters["bytes"] = static_cast<double>(bytes);
      if (stage.regular) state.counters["angle"] = stages.shapes().smallest_angle_deg.mean;
    };
    configure(benchmark::RegisterBenchmark(name.c_str(), body), source);
  }

  void add_peer(const Source& source, const PeerCase& peer, int threads) {
    const auto body = [this, source, peer, threads](benchmark::State& state) {
      set_threads(threads);
      Peers::set_threads(threads);
      Peers& peers = workbench_.peers(source);
      peer.set_up(peers);
      time_runs(state, peers, peer.prepare, peer.run);
      set_rates(state, peers.size(), peer.passes);
    };
    const std::string name = "peer_" + peer.name + suffix(source, threads);
    configure(benchmark::RegisterBenchmark(name.c_str(), body), source);
  }

  const Plan& plan_;
  Workbench workbench_;
};

// Prints one line a benchmark: the median.
class MedianReporter : public benchmark::ConsoleReporter {
 public:
  MedianReporter() : ConsoleReporter(isatty(STDOUT_FILENO) != 0 ? OO_Color : OO_None) {}

  void ReportRuns(const std::vector<Run>& runs) override {
    std::vector<Run> medians;
    for (Run run : runs) {
      if (run.aggregate_name != "median") continue;
      run.run_name.min_time.clear();  // the same for all
      run.run_name.repetitions.clear();
      run.run_name.time_type.clear();
      medians.push_back(std::move(run));
    }
    if (!medians.empty()) ConsoleReporter::ReportRuns(medians);
  }
};

}  // namespace

std::string run_benchmarks(const Plan& plan) {
  Registry registry(plan);
  if (plan.volume) {
    registry.add({plan.volume->name, plan.iso, [&plan] { return *plan.volume; }});
  }
  for (const std::uint32_t size : plan.field_sizes) {
    registry.add({"field-" + std::to_string(size), kFieldIso,
                  [size] { return synthetic_field(size); }, size});
  }
  if (plan.json) {
    for (const auto& [key, value] : describe_machine()) benchmark::AddCustomContext(key, value);
  }

  std::ostringstream document;
  benchmark::JSONReporter json;
  json.SetOutputStream(&document);
  json.SetErrorStream(&document);
  MedianReporter console;
  benchmark::BenchmarkReporter* reporter = &console;
  if (plan.json) reporter = &json;
  benchmark::RunSpecifiedBenchmarks(reporter, plan.filter);
  benchmark::Shutdown();
  return document.str();
}

}  // namespace isomesh::bench
