// vtkSurfaceNets3D of VTK 9.3 or newer, which the VTK that isomesh-bench is built with may not
// have: run by Debian 13's python3-vtk9 in a process of its own (surface_nets.py).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/bench/samples.h"
#include "tests/support/files.h"

namespace isomesh::bench {

inline constexpr int kSurfaceNetsPasses = 16;  // the filter's own default

// The text if there is none.
inline constexpr const char* kNoSurfaceNets =
    "SurfaceNets is left out: --surface-nets-root names no Debian 13 that has it.";

// On one segmentation. Not thread safe.
class SurfaceNets {
 public:
  // `root` is the folder of a Debian 13 that has the packages python3-vtk9 and python3-numpy, as
  // debootstrap makes it, or "/" where that is the system itself; nothing in it is changed and no
  // privilege is needed. Throws std::runtime_error that says what is missing there.
  SurfaceNets(const std::filesystem::path& root, const Samples& samples,
              const std::vector<std::int64_t>& labels, int threads);

  // The time of one run from samples to points and triangles in memory, after one that warms up.
  // Throws std::runtime_error with what the process wrote when it fails.
  double run_ms();

  // The peak of that run's memory, with the samples and without libraries; as memory.h has it. 0
  // before the first run.
  std::uint64_t peak_bytes() const { return peak_bytes_; }

 private:
  std::vector<std::string> command_;
  std::vector<std::string> environment_;
  test::TemporaryFolder folder_;
  std::uint64_t peak_bytes_ = 0;
};

}  // namespace isomesh::bench
