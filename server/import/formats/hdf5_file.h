// HDF5 files (https://docs.hdfgroup.org), as far as images need them: groups, attributes and arrays
// of numbers, read with bounded memory. Internal to the reader.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <hdf5.h>

#include "server/import/source/stored_samples.h"

namespace isomesh::import {

// Owns an identifier of the library.
class Hdf5Handle {
 public:
  using Close = herr_t (*)(hid_t);

  // Throws Error kUnusableVolume if the identifier is invalid.
  Hdf5Handle(hid_t id, Close close);
  ~Hdf5Handle();
  Hdf5Handle(Hdf5Handle&& other) noexcept;
  Hdf5Handle(const Hdf5Handle&) = delete;
  Hdf5Handle& operator=(const Hdf5Handle&) = delete;
  Hdf5Handle& operator=(Hdf5Handle&&) = delete;

  hid_t id() const { return id_; }

 private:
  hid_t id_;
  Close close_;
};

// An array of real numbers; the last size belongs to the axis that runs fastest.
class Hdf5Array {
 public:
  // Throws Error kUnusableVolume for other types, for arrays in other files, for filters other than
  // deflate, shuffle and checksums, and for implausible chunks.
  explicit Hdf5Array(Hdf5Handle dataset);

  const std::vector<std::uint64_t>& sizes() const { return sizes_; }
  StoredType type() const { return type_; }
  hid_t id() const { return dataset_.id(); }

  // Passes the samples with the first indices [first, first + count) to the sink, in order and in
  // the byte order of this machine. Throws Error kUnusableVolume if the file is damaged.
  void read(std::uint64_t first, std::uint64_t count,
            const std::function<void(std::span<const std::byte>)>& sink) const;

  // All numbers of a small array. Throws Error kUnusableVolume if it has more than a million.
  std::vector<double> numbers() const;

 private:
  void read_box(std::span<const std::uint64_t> first, std::span<const std::uint64_t> size,
                std::span<std::byte> target) const;

  Hdf5Handle dataset_;
  std::vector<std::uint64_t> sizes_;
  StoredType type_;
};

// The library is not thread safe, so one file is open at a time in a process.
class Hdf5File {
 public:
  // Throws Error kUnusableVolume if it is damaged.
  explicit Hdf5File(const std::filesystem::path& path);

  // Paths are as in "a/b/c". Links to other places are not followed.
  bool has(const std::string& path) const;

  // Throw Error kUnusableVolume if there is no such array, or as Hdf5Array does.
  Hdf5Array array(const std::string& path) const;

  // Values of an attribute of the object at `path`; empty if it has none of that name and kind. At
  // most a thousand numbers.
  std::vector<double> numbers(const std::string& path, const std::string& attribute) const;
  std::optional<std::string> text(const std::string& path, const std::string& attribute) const;

 private:
  std::optional<Hdf5Handle> open_attribute(const std::string& path,
                                           const std::string& attribute) const;

  std::lock_guard<std::mutex> lock_;
  Hdf5Handle file_;
};

}  // namespace isomesh::import
