// The canonical volume: the one form in which volumes are kept, whatever they came in as.
//
// A canonical file has a header of kHeaderBytes bytes (one JSON object, padded with spaces, ending
// in a newline), and then the samples, little-endian, x fastest. The header holds only what
// identifies the volume: version, dims, type, spacing, origin, direction. So the SHA-256 of the
// file can be the volume's id: the same samples and geometry have the same id in whatever format
// they came.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "base/files.h"
#include "proto/types.h"

namespace isomesh::volume {

inline constexpr std::size_t kHeaderBytes = 4096;  // a page, so that mapped samples are aligned

struct CanonicalHeader {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  SampleType type = SampleType::kUint8;
  Geometry geometry;

  std::uint64_t sample_bytes() const {
    return std::uint64_t{dims[0]} * dims[1] * dims[2] * bytes_per_sample(type);
  }
};

// A canonical file that is being written. Not thread safe.
class CanonicalWriter {
 public:
  // Creates the file at its full size and maps it. Throws Error kOutOfSpace or kInternal.
  CanonicalWriter(const std::filesystem::path& path, const CanonicalHeader& header);
  ~CanonicalWriter();
  CanonicalWriter(const CanonicalWriter&) = delete;
  CanonicalWriter& operator=(const CanonicalWriter&) = delete;

  // Whoever keeps the file brings it to disk.
  std::span<std::byte> samples();

 private:
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
  int file_ = -1;
};

// A canonical file whose samples are copied out of it, so that one which is cut meanwhile is an
// error and no signal: for those who serve others besides. Safe to read from several threads.
class CanonicalFile {
 public:
  // Throws Error kInternal when the file is not a canonical volume of exactly the size that its
  // header tells.
  explicit CanonicalFile(const std::filesystem::path& path);
  explicit CanonicalFile(InputFile file);

  const CanonicalHeader& header() const { return header_; }

  // Fills `target` with what is `offset` bytes behind the beginning of the samples, all of which is
  // to lie within them. Throws Error kUnusableVolume when the file has become shorter, kInternal
  // when the disk fails.
  void read(std::uint64_t offset, std::span<std::byte> target) const;

 private:
  friend class CanonicalVolume;

  InputFile file_;
  CanonicalHeader header_;
};

// A canonical file, mapped for reading. Immutable, so safe to read from several threads. A file
// that is cut meanwhile ends the process with SIGBUS: for processes that do nothing else.
class CanonicalVolume {
 public:
  // Throws as CanonicalFile does.
  explicit CanonicalVolume(const std::filesystem::path& path);
  explicit CanonicalVolume(InputFile file);
  ~CanonicalVolume();
  CanonicalVolume(CanonicalVolume&&) noexcept;
  CanonicalVolume& operator=(CanonicalVolume&&) = delete;
  CanonicalVolume(const CanonicalVolume&) = delete;
  CanonicalVolume& operator=(const CanonicalVolume&) = delete;

  const CanonicalHeader& header() const { return header_; }
  std::span<const std::byte> samples() const;

  // Brings the samples into memory, so that what follows does not wait for the disk.
  void preload() const;

 private:
  CanonicalHeader header_;
  const std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace isomesh::volume
