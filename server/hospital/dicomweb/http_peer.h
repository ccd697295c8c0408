// One HTTP request to a PACS. Does not parse the response's body.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>

#include "server/hospital/orders/pacs.h"

namespace isomesh::dicomweb {

struct RequestBody {
  std::string content_type;
  std::uint64_t bytes = 0;
  // Fills the buffer with the next bytes; returns their number, 0 at the end.
  std::function<std::size_t(std::span<std::byte> buffer)> read;
};

struct PeerRequest {
  std::string target;  // path and query, relative to the PACS' address
  std::string accept;
  const RequestBody* body = nullptr;    // null: a GET
  bool is_put = false;                  // otherwise a body is sent by POST
  std::filesystem::path response_file;  // for the response's body
  std::uint64_t most_bytes = 0;         // limit of the response's body
  // Limit of the whole exchange, more than 0; empty: it may last as long as there is progress.
  std::optional<std::chrono::milliseconds> most_time = {};
};

struct PeerResponseHead {
  int status = 0;
  std::string content_type;  // as sent by the PACS; printable characters only
  std::chrono::seconds retry_after{0};
  bool has_more_results = false;  // a Warning header says so (PS3.18, 8.3.4.4)
};

// Thread safe.
class HttpPeer {
 public:
  explicit HttpPeer(const orders::PacsSettings& settings) : settings_(settings) {}

  // Throws PacsFailure kUnreachable or kTimeout; kUnauthorized if the file of the password or token
  // cannot be read; Error kTooLarge if the response has more than most_bytes; kOutOfSpace;
  // kCancelled if `stop` is requested.
  PeerResponseHead send(const PeerRequest& request, const std::stop_token& stop) const;

 private:
  const orders::PacsSettings settings_;
};

}  // namespace isomesh::dicomweb
