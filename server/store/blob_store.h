// Finished files, named by the SHA-256 of their bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>

#include "server/store/data_folder.h"
#include "server/store/files.h"

namespace isomesh::store {

// What a blob is called and how long it is.
struct Blob {
  std::string key;  // hex SHA-256
  std::uint64_t bytes = 0;
};

// Reads a file and brings it to disk. Throws Error kOutOfSpace or kInternal.
Blob digest_of(const std::filesystem::path& file);

// Blobs as files of the data folder. A blob is seen whole or not at all, and never changes. Thread
// safe; `folder` must outlive it.
class BlobStore {
 public:
  explicit BlobStore(const DataFolder& folder) : folder_(folder) {}

  // Takes a blob's bytes in order. Not thread safe. What is not committed is removed.
  class Writer {
   public:
    explicit Writer(const BlobStore& store);
    ~Writer();
    Writer(const Writer&) = delete;
    Writer& operator=(const Writer&) = delete;

    // Throws Error kOutOfSpace.
    void write(std::span<const std::byte> bytes);

    // Afterwards the blob is there and on disk. To be called once. Throws Error kOutOfSpace.
    Blob commit();

   private:
    const BlobStore& store_;
    std::filesystem::path path_;
    File file_;
    Sha256 digest_;
    std::uint64_t bytes_ = 0;
  };

  // Makes a finished file of the scratch folder, which digest_of named, a blob by moving it. Throws
  // Error kOutOfSpace.
  void adopt(const std::filesystem::path& file, const Blob& blob) const;

  // Throws Error kNotFound.
  File open(const std::string& key) const;

  // Where a blob lies, for those that map it. It may not be there.
  std::filesystem::path path_of(const std::string& key) const;

  // Nothing happens when it is not there. Those that have it open keep what they have.
  void erase(const std::string& key) const;

  // Erases every blob for which `keep` is false.
  void sweep(const std::function<bool(const std::string& key)>& keep) const;

 private:
  void publish_as(const std::filesystem::path& file, const std::string& key) const;

  const DataFolder& folder_;
};

}  // namespace isomesh::store
