// A downsampled 8-bit copy of a volume, small enough for a client to hold and draw.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/volume/canonical.h"
#include "server/volume/thin_parts.h"

namespace isomesh::volume {

struct PreviewChoice {
  std::uint32_t most = 128;           // samples along each axis; at least 1
  std::array<double, 2> window = {};  // mapped to 0 and to 255
};

// An NRRD file (uint8, raw, space left-posterior-superior), generated in pieces while it is sent.
// Along each axis the same number of samples, the smallest that leaves at most `most`, is averaged,
// ignoring NaN, and mapped to eight bits by the window; what is thin stays (thin_parts.h). The last
// block of an axis may be smaller. A sample's position is the centre of a full block.
//
// The bytes depend only on the volume and the choice. Not thread safe.
class PreviewNrrd {
 public:
  PreviewNrrd(std::shared_ptr<const CanonicalFile> volume, const PreviewChoice& choice);

  // Limit of samples read per call of next(), rounded up to a whole row.
  static constexpr std::size_t kSamplesPerPiece = std::size_t{1} << 20;

  std::uint64_t size() const;

  // Returns the next bytes of the file, possibly none; empty at its end. Throws Error
  // kUnusableVolume if the volume's file was truncated, kInternal if reading fails.
  std::optional<std::string_view> next();

 private:
  std::string header() const;
  std::uint64_t add_rows();
  template <class Sample>
  void add_row(const std::byte* samples, std::size_t row);
  void begin_layer();
  void end_layer();
  void write_layer();
  bool is_reduced() const;

  std::shared_ptr<const CanonicalFile> volume_;
  PreviewChoice choice_;
  std::array<std::uint32_t, 3> block_;  // samples averaged along each axis
  std::array<std::uint32_t, 3> dims_;
  bool has_begun_ = false;
  std::uint32_t row_ = 0;
  std::uint32_t slice_ = 0;
  // Each block of the layer that is read has one of these.
  std::vector<double> sums_;
  std::vector<double> least_;
  std::vector<double> greatest_;
  std::vector<std::uint32_t> counts_;
  ThinParts thin_;
  // The last layers that were read, of which the next to write has the number `written_`.
  std::deque<ThinParts::KnownLayer> layers_;
  std::uint32_t read_ = 0;
  std::uint32_t written_ = 0;
  std::vector<std::byte> rows_;
  std::string bytes_;
};

}  // namespace isomesh::volume
