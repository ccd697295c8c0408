// Bounded bodies of requests, in a file or in memory.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>

#include "base/files.h"
#include "server/http/requests/request.h"
#include "server/import/message/upload_name.h"
#include "server/store/files/data_folder.h"

namespace isomesh::http {

struct UploadLimits {
  std::uint64_t max_bytes = std::uint64_t{8} << 30;
  std::chrono::seconds max_time = std::chrono::hours(1);  // in total; each read has its own limit
};

struct ReceivedBody {
  std::filesystem::path path;
  // From the form or the header Content-Disposition. May be empty, and may name a patient.
  import::UploadName name;
};

// Throws Error kLengthRequired if the request says nothing about its body: a client whose framing
// was lost must not be taken for one that sends an empty body. All that reads bodies checks it.
void check_has_length(const Request& request);

// A request's body in a file: written as it arrives, counted, checked against its Content-Digest.
// The destructor removes the file. Not thread safe.
class Upload {
 public:
  // Receives the body, or the single field `file` of a form. Throws Error kTooLarge,
  // kDigestMismatch, kUnsupportedMedia for an encoded body, kInvalidParameter for a malformed or
  // empty one, kRequestTimeout, kOutOfSpace, and kUnavailable once `stopping` is true.
  Upload(const store::DataFolder& folder, const UploadLimits& limits,
         const std::atomic<bool>& stopping, const Request& request);

  const ReceivedBody& body() const { return body_; }

 private:
  ScratchFile file_;
  ReceivedBody body_;
};

class PartialUpload;
struct PartialLease;

// Appends the request's body. Received bytes stay even if the rest is missing, unless they
// contradict Content-Digest. Throws as Upload does, except for an empty body, and as
// PartialUpload's functions do.
void receive_part(PartialUpload& upload, const PartialLease& lease, const store::DataFolder& folder,
                  const UploadLimits& limits, const std::atomic<bool>& stopping,
                  const Request& request);

// Reads a small body into memory. Throws Error kTooLarge beyond `max_bytes`, kUnsupportedMedia,
// kInvalidParameter, kRequestTimeout.
std::string read_text(const Request& request, std::size_t max_bytes);

}  // namespace isomesh::http
