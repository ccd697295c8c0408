// The messages between the daemon and a job process, as lines of JSON over a socket. The daemon
// sends one set-up and then orders, one after the other, and may cancel the current one. The
// process answers an order first with progress, then with the bytes of the files as they are made,
// and with one end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "proto/error.h"
#include "proto/types.h"
#include "server/jobs/making/make_mesh.h"
#include "server/mesh/extract/extract.h"

namespace isomesh::jobs {

// Holds for all orders of a process.
struct JobSetup {
  int threads = 1;                                      // of the kernels
  std::uint64_t memory_bytes = std::uint64_t{1} << 60;  // the most of an order
  std::string scratch = {};  // the folder for what orders set aside; empty: they keep it in memory
};

struct JobOrder {
  enum class Work {
    kMesh,
    kCount,  // only how large the surface is
  };

  Work work = Work::kMesh;
  // The volume's canonical file, found intact. The process receives it open, with the first bytes
  // of the line, and not its path.
  std::filesystem::path file;
  Volume volume;  // its samples and notes
  MeshParameters parameters;
  double iso = 0;  // resolved; the parameters may name none
  Measures measures = {};
  std::uint64_t memory_bytes = 0;
  std::uint64_t disk_bytes = 0;  // of all files together
  Timing expected = {};          // of a mesh; progress follows it
};

struct JobProgress {
  Stage stage = Stage::kLoad;
  double share = 0;
  Timing timing;  // of the stages that have ended
};

// So many bytes follow the line; they are the next ones of a file.
struct JobPiece {
  std::size_t file = 0;  // of files_of(parameters); behind the last: the file of the labels
  std::size_t bytes = 0;
};

struct MadeMesh {
  MeshSummary summary;  // without files; many labels are counted only
  Timing timing;
};

// The last three end the order.
using JobAnswer = std::variant<JobProgress, JobPiece, MadeMesh, CountedSurface, Error>;

inline constexpr std::string_view kCancelMessage = "{\"cancel\":true}\n";

// Each is one line with its line break. The readers throw Error kInternal for any other line.
std::string to_line(const JobSetup& setup);
std::string to_line(const JobOrder& order);
std::string to_line(const JobAnswer& answer);
JobSetup setup_from(std::string_view line);
// Empty if the line asks to cancel.
std::optional<JobOrder> order_from(std::string_view line);
JobAnswer answer_from(std::string_view line);

}  // namespace isomesh::jobs
