// Where the bytes of volumes and meshes are, by what a person has set.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"

namespace isomesh {

struct BlobOptions {
  std::string place;                             // s3://..., or a folder; empty: in that of --data
  std::uint64_t cache = std::uint64_t{8} << 30;  // bytes of copies, of blobs in S3
  std::filesystem::path credentials;             // a file; empty: of the environment
  std::filesystem::path authorities;             // of certificates; empty: the system's
};

// Throws what opening the store would, of what can be told without it: Error kInvalidParameter.
void check_blobs(const BlobOptions& options);

// The folder must outlive it. Throws Error kUnavailable where a shared folder is not there, and
// what check_blobs throws.
std::unique_ptr<store::BlobStore> open_blobs(const BlobOptions& options,
                                             const store::DataFolder& folder);

}  // namespace isomesh
