#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>

#include <httplib.h>

#include "server/store/data_folder.h"

namespace isomesh::http {

struct UploadLimits {
  std::uint64_t max_bytes = std::uint64_t{8} << 30;
  std::chrono::seconds max_time = std::chrono::hours(1);  // in all; each read has its own limit
};

// A request's body on disk: streamed, counted, checked against its Content-Digest. Removed when it
// goes. Not thread safe.
class Upload {
 public:
  // Receives the body, or the one field `file` of a form. Throws Error kTooLarge, kDigestMismatch,
  // kUnsupportedMedia for an encoded body, kInvalidParameter for a broken or empty one,
  // kRequestTimeout, kOutOfSpace, and kUnavailable once `stopping` is true.
  Upload(const store::DataFolder& folder, const UploadLimits& limits,
         const std::atomic<bool>& stopping, const httplib::Request& request,
         const httplib::ContentReader& read_body);

  const std::filesystem::path& path() const { return path_; }

 private:
  store::ScratchFolder scratch_;
  std::filesystem::path path_;
};

// A small body, whole in memory. Throws Error kTooLarge beyond `max_bytes`, kUnsupportedMedia,
// kInvalidParameter, kRequestTimeout.
std::string read_text(const httplib::Request& request, const httplib::ContentReader& read_body,
                      std::size_t max_bytes);

}  // namespace isomesh::http
