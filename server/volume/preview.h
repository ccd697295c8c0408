// A whole volume, reduced and in eight bits: what a client can hold and draw at once.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/volume/canonical.h"

namespace isomesh::volume {

struct PreviewChoice {
  std::uint32_t most = 128;           // samples along each axis; at least 1
  std::array<double, 2> window = {};  // what becomes 0 and what becomes 255
};

// An NRRD file (uint8, raw, space left-posterior-superior) that is made piece by piece, as it is
// sent. Along each axis the same whole number of samples, the smallest that leaves at most `most`,
// becomes one: their mean, without those that are no numbers, in eight bits over the window. The
// last of an axis may be the mean of fewer. A sample's place is the middle of a whole block.
//
// The bytes depend on the volume and the choice alone. Not thread safe.
class PreviewNrrd {
 public:
  PreviewNrrd(std::shared_ptr<const CanonicalFile> volume, const PreviewChoice& choice);

  // Samples that one call of next() reads at most, but for the rest of a row.
  static constexpr std::size_t kSamplesPerPiece = std::size_t{1} << 20;

  // Bytes of the whole file.
  std::uint64_t size() const;

  // The next bytes of the file; nothing at its end. A piece may be empty. Throws Error
  // kUnusableVolume when the volume's file has become shorter, kInternal when the disk fails.
  std::optional<std::string_view> next();

 private:
  std::string header() const;
  std::uint64_t add_rows();
  template <class Sample>
  void add_row(const std::byte* samples, std::size_t row);
  void end_layer();

  std::shared_ptr<const CanonicalFile> volume_;
  PreviewChoice choice_;
  std::array<std::uint32_t, 3> block_ = {};  // samples along each axis that become one
  std::array<std::uint32_t, 3> dims_ = {};   // what is left
  bool has_begun_ = false;
  std::uint32_t row_ = 0;  // the next to be read
  std::uint32_t slice_ = 0;
  std::vector<double> sums_;  // of the layer that is being made
  std::vector<std::uint32_t> counts_;
  std::vector<std::byte> rows_;  // of the file
  std::string bytes_;
};

}  // namespace isomesh::volume
