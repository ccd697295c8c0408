// The configured store of volumes and meshes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"

namespace isomesh {

struct BlobOptions {
  std::string place;                             // s3://... or a folder; empty: within --data
  std::uint64_t cache = std::uint64_t{8} << 30;  // bytes of local copies of blobs in S3
  std::filesystem::path credentials;             // a file; empty: the environment
  std::filesystem::path authorities;             // file of certificates; empty: the system's
};

// The name of the store in the log: "data", "folder" or "s3".
std::string_view kind_of(const BlobOptions& options);

// Throws Error kInvalidParameter for errors that can be found without opening the store.
void check_blobs(const BlobOptions& options);

// The folder must outlive the store. Throws Error kUnavailable if a shared folder is missing, and
// as check_blobs does.
std::unique_ptr<store::BlobStore> open_blobs(const BlobOptions& options,
                                             const store::DataFolder& folder);

}  // namespace isomesh
