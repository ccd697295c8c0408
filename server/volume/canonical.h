// The canonical volume: the only form in which volumes are stored.
//
// A canonical file has a header of kHeaderBytes bytes (one JSON object, padded with spaces, ending
// in a newline), and then the samples, little-endian, x fastest. The header holds only properties
// that identify the samples: version, dims, type, spacing, origin, direction. So the SHA-256 of the
// file, Volume::samples, is the same for equal samples and geometry, whatever their original
// format.
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

// Writes a canonical file. Not thread safe.
class CanonicalWriter {
 public:
  // Creates the file at its full size and maps it. Throws Error kOutOfSpace or kInternal.
  CanonicalWriter(const std::filesystem::path& path, const CanonicalHeader& header);
  ~CanonicalWriter();
  CanonicalWriter(const CanonicalWriter&) = delete;
  CanonicalWriter& operator=(const CanonicalWriter&) = delete;

  // The caller syncs the file to disk.
  std::span<std::byte> samples();

  // Replaces the header and shortens the file to the size in it, which is no larger. The samples
  // stay as they are. Throws Error kInternal.
  void shorten(const CanonicalHeader& header);

 private:
  void write_header(const CanonicalHeader& header);

  std::byte* data_ = nullptr;
  std::size_t mapped_ = 0;
  std::size_t size_ = 0;  // of the file
  int file_ = -1;
};

// Reads samples by copying, so that truncation of the file is an error and not a signal. For
// processes that serve several clients. Safe to read from several threads.
class CanonicalFile {
 public:
  // Throws Error kInternal unless the file is a canonical volume of exactly the size in its header.
  explicit CanonicalFile(const std::filesystem::path& path);
  explicit CanonicalFile(InputFile file);

  const CanonicalHeader& header() const { return header_; }

  // Fills `target` from byte `offset` of the samples; the range must lie within them. Throws Error
  // kUnusableVolume if the file was truncated, kInternal if reading fails.
  void read(std::uint64_t offset, std::span<std::byte> target) const;

 private:
  friend class CanonicalVolume;

  InputFile file_;
  CanonicalHeader header_;
};

// A canonical file, mapped for reading. Immutable, so safe to read from several threads. If the
// file is truncated meanwhile, SIGBUS ends the process: only for processes with a single task.
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

  // Starts reading the samples into memory ahead of their use.
  void preload() const;

 private:
  CanonicalHeader header_;
  const std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace isomesh::volume
