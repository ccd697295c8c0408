// Bodies of requests, bounded: in a file or in memory.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>

#include "base/files.h"
#include "server/http/request.h"
#include "server/store/files/data_folder.h"

namespace isomesh::http {

struct UploadLimits {
  std::uint64_t max_bytes = std::uint64_t{8} << 30;
  std::chrono::seconds max_time = std::chrono::hours(1);  // in all; each read has its own limit
};

// A request's body in a file: written as it comes, counted, checked against its Content-Digest. The
// destructor removes the file. Not thread safe.
class Upload {
 public:
  // Receives the body, or the one field `file` of a form. Throws Error kTooLarge, kDigestMismatch,
  // kUnsupportedMedia for an encoded body, kInvalidParameter for a broken or empty one,
  // kRequestTimeout, kOutOfSpace, and kUnavailable once `stopping` is true.
  Upload(const store::DataFolder& folder, const UploadLimits& limits,
         const std::atomic<bool>& stopping, const Request& request);

  const std::filesystem::path& path() const { return file_.path(); }
  // What the client calls the file, without folders: the name in the form, or in the header
  // Content-Disposition. May be empty, and may name a patient.
  const std::string& name() const { return name_; }

 private:
  ScratchFile file_;
  std::string name_;
};

// A small body, whole in memory. Throws Error kTooLarge beyond `max_bytes`, kUnsupportedMedia,
// kInvalidParameter, kRequestTimeout.
std::string read_text(const Request& request, std::size_t max_bytes);

}  // namespace isomesh::http
