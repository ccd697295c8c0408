// The peak memory of a stage.
//
// A stage runs in a process of its own, which is this program started again with the arguments of
// `measure_memory`: a fork alone would share the parent's memory and have no threads of oneTBB.
// That process makes the samples, sets the kernel's mark of its largest resident size back to the
// present size (/proc/self/clear_refs), runs the stage once and reads the mark (VmHWM in
// /proc/self/status). What the samples take is added; what libraries and code take is not.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace isomesh::bench {

inline constexpr const char* kMemoryCommand = "measure-memory";

struct PeakMemory {
  std::uint64_t peak_bytes = 0;  // samples included
  std::uint64_t input_bytes = 0;
  std::uint64_t output_bytes = 0;  // the mesh, or what was encoded
  std::uint64_t layer_bytes = 0;   // the bound that smoothing gives of its own memory
};

inline constexpr const char* kExtractStage = "extraction";
inline constexpr const char* kSmoothStage = "extraction + smoothing";  // 5 passes
inline constexpr const char* kJobStage = "job";                        // with the encoder
inline constexpr const char* kLabelJobStage = "label-job";             // to a GLB
inline constexpr const char* kPeerExtractStage = "flying-edges";
inline constexpr const char* kPeerJobStage = "peer-pipeline";

// On the synthetic field of that size, six tetrahedra; by labels, on the body of that size or on a
// file of labels. Empty, with a message on standard error, if the process does not answer.
std::optional<PeakMemory> measure_memory(const std::string& stage, const std::string& size_or_file,
                                         int threads);

// Runs in that process: prints one line for `measure_memory`. Returns the exit status.
int run_memory_command(const std::string& stage, const std::string& size_or_file, int threads);

}  // namespace isomesh::bench
