#include "server/blobs.h"

#include "base/error.h"
#include "server/store/files/blob_store.h"
#include "server/store/s3/blob_store.h"

namespace isomesh {
namespace {

store::S3ClientOptions client_options(const BlobOptions& options) {
  // Report errors now instead of on the first request.
  store::read_s3_credentials(options.credentials);
  store::S3ClientOptions client;
  client.address = store::parse_s3_url(options.place);
  client.credentials = options.credentials;
  client.authorities = options.authorities;
  return client;
}

}  // namespace

std::string_view kind_of(const BlobOptions& options) {
  if (options.place.empty()) return "data";
  return store::is_s3_url(options.place) ? "s3" : "folder";
}

void check_blobs(const BlobOptions& options) {
  if (store::is_s3_url(options.place)) {
    client_options(options);
  } else if (options.place.find("://") != std::string::npos) {
    throw invalid_parameter("blobs", "must be s3://BUCKET?endpoint=URL&region=NAME or a folder");
  }
}

std::unique_ptr<store::BlobStore> open_blobs(const BlobOptions& options,
                                             const store::DataFolder& folder) {
  check_blobs(options);
  if (options.place.empty()) return std::make_unique<store::FileBlobStore>(folder);
  if (!store::is_s3_url(options.place)) {
    return std::make_unique<store::FileBlobStore>(store::shared_blob_folders(options.place),
                                                  folder.reserve());
  }
  return std::make_unique<store::S3BlobStore>(
      folder, store::S3Options{.client = client_options(options), .cache_bytes = options.cache});
}

}  // namespace isomesh
