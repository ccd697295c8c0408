#include "tests/bench/memory.h"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>

#include "tests/bench/label_body.h"
#include "tests/bench/label_stages.h"
#include "tests/bench/peers.h"
#include "tests/bench/samples.h"
#include "tests/bench/stages.h"
#include "tests/support/process.h"

namespace isomesh::bench {
namespace {

constexpr int kPasses = 5;

// A field of /proc/self/status, in bytes.
std::uint64_t own_status(const std::string& field) {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with(field + ':')) return std::stoull(line.substr(field.size() + 1)) << 10;
  }
  return 0;
}

bool reset_peak() {
  std::ofstream file("/proc/self/clear_refs");
  file << "5" << std::flush;
  return static_cast<bool>(file);
}

// Runs a stage. Returns the sizes that are known from it; the peak is not.
PeakMemory run_stage(const std::string& stage, const Samples& field) {
  PeakMemory memory = {.input_bytes = field.bytes.size()};
  if (stage == kLabelJobStage) {
    memory.output_bytes = LabelStages(field).run_job().bytes;
    return memory;
  }
  const Surface surface = {.iso = kFieldIso};
  if (stage == kPeerExtractStage || stage == kPeerJobStage) {
    Peers peers(field, surface.iso);
    if (stage == kPeerJobStage) {
      memory.output_bytes = peers.pipeline();
      return memory;
    }
    peers.flying_edges();
    constexpr std::uint64_t kVertexBytes = 12;
    constexpr std::uint64_t kTriangleBytes = 12;  // as we count our own, whatever VTK takes
    memory.output_bytes =
        peers.size().vertices * kVertexBytes + peers.size().triangles * kTriangleBytes;
    return memory;
  }
  Stages stages(field, surface);
  if (stage == kJobStage) {
    memory.output_bytes = stages.run_job(job_to(MeshFormat::kDrc, kPasses)).bytes;
    return memory;
  }
  stages.extract();
  if (stage == kSmoothStage) {
    stages.smooth(kPasses);
    memory.layer_bytes = stages.smoothing_memory(kPasses);
  }
  memory.output_bytes = stages.mesh_bytes();
  return memory;
}

Samples samples_of(const std::string& stage, const std::string& size_or_file) {
  const bool is_size = size_or_file.find_first_not_of("0123456789") == std::string::npos;
  if (!is_size) return load_labels(size_or_file);
  const auto size = static_cast<std::uint32_t>(std::stoul(size_or_file));
  return stage == kLabelJobStage ? label_body(size) : synthetic_field(size);
}

}  // namespace

std::optional<PeakMemory> measure_memory(const std::string& stage, const std::string& size_or_file,
                                         int threads) {
  const std::string self = std::filesystem::read_symlink("/proc/self/exe");
  std::istringstream answer(
      test::run({self, kMemoryCommand, stage, size_or_file, std::to_string(threads)}).output);
  PeakMemory memory;
  if (answer >> memory.peak_bytes >> memory.input_bytes >> memory.output_bytes >>
      memory.layer_bytes) {
    return memory;
  }
  std::cerr << "isomesh-bench: the memory of " << stage << " on " << size_or_file
            << " could not be measured\n";
  return std::nullopt;
}

int run_memory_command(const std::string& stage, const std::string& size_or_file, int threads) {
  set_threads(threads);
  Peers::set_threads(threads);
  const Samples field = samples_of(stage, size_or_file);
  if (!reset_peak()) return 1;
  const std::uint64_t before = own_status("VmRSS");
  const PeakMemory memory = run_stage(stage, field);
  const std::uint64_t peak = own_status("VmHWM") - before + memory.input_bytes;
  std::cout << peak << ' ' << memory.input_bytes << ' ' << memory.output_bytes << ' '
            << memory.layer_bytes << '\n';
  return 0;
}

}  // namespace isomesh::bench
