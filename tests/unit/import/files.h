// A folder for one test, and the shortest ways to import what is put there.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"
#include "server/import/import.h"
#include "server/volume/canonical.h"
#include "tests/support/files.h"

namespace isomesh::import::test {

using isomesh::test::read_file;

// Made for one test and removed with everything in it. Every import waits for the disk; in memory
// thousands take seconds.
class Folder {
 public:
  std::filesystem::path path(std::string_view name) const { return folder_.path() / name; }
  std::filesystem::path write(std::string_view name, std::string_view bytes) const;

  // How many files and folders are there.
  std::size_t entries() const;

 private:
  isomesh::test::TemporaryFolder folder_{isomesh::test::fast_place()};
};

using volume::kHeaderBytes;

// Result of an import, or the error. Tests compare with what a file says, so sizes, geometry and
// samples are in the order of its axes.
struct Outcome {
  Volume volume;
  std::string canonical;  // header of the canonical file, and the samples in the file's order
  std::string stored;     // the canonical file as it is
  std::string error;      // empty when it was imported
  ErrorCode code = ErrorCode::kInternal;
  Remedy remedy;  // what the refusal offers

  bool imported() const { return error.empty(); }
  std::string_view sample_bytes() const { return std::string_view(canonical).substr(kHeaderBytes); }
};

// Undoes the canonical order of axes.
Outcome in_files_order(Outcome outcome);

// Runs an import that is given a target; keeps what came of it.
Outcome outcome_of(const std::filesystem::path& target,
                   const std::function<Volume(const std::filesystem::path& target)>& import);

Outcome import_bytes(std::string_view bytes, const SizeLimits& limits = {},
                     const ImportOptions& options = {});
// The same of an import that must succeed. Throws std::runtime_error with its error.
Outcome imported(Outcome outcome);
// The samples of a segmentation from the one at `first` (LPS, mm) on, as many as `dims`: without
// planes that were added at its ends. Throws std::runtime_error if another sample is not zero.
Outcome without_ends(Outcome outcome, const std::array<double, 3>& first,
                     const std::array<std::uint32_t, 3>& dims);
// The codes of the volume's notes, in their order.
std::vector<std::string> codes_of(const Outcome& outcome);
inline Outcome import_raw_bytes(std::string_view bytes, const RawDescription& description,
                                const SizeLimits& limits = {}) {
  return import_bytes(bytes, limits, {.raw = description});
}

// The samples of an outcome as their type.
template <class Sample>
std::vector<Sample> samples_of(const Outcome& outcome) {
  const std::string_view bytes = outcome.sample_bytes();
  std::vector<Sample> samples(bytes.size() / sizeof(Sample));
  std::copy(bytes.begin(), bytes.end(), reinterpret_cast<char*>(samples.data()));
  return samples;
}

}  // namespace isomesh::import::test
