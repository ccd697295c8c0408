// One request to a PACS over HTTP. Nothing of the answer's body is looked at here.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>

#include "server/hospital/orders/pacs.h"

namespace isomesh::dicomweb {

// A body that is sent.
struct RequestBody {
  std::string content_type;
  std::uint64_t bytes = 0;
  // Fills the buffer as far as there is something left; returns how much.
  std::function<std::size_t(std::span<std::byte> buffer)> read;
};

struct PeerRequest {
  std::string target;  // path and query below the PACS' address
  std::string accept;
  const RequestBody* body = nullptr;  // null: a GET
  std::filesystem::path answer;       // the file that the answer's body is written to
  std::uint64_t most_bytes = 0;       // of it
};

struct PeerAnswerHead {
  int status = 0;
  std::string content_type;  // printable; as the PACS wrote it
  std::chrono::seconds retry_after{0};
};

// Thread safe.
class HttpPeer {
 public:
  explicit HttpPeer(const orders::PacsSettings& settings) : settings_(settings) {}

  // Throws PacsFailure kUnreachable or kTimeout, kUnauthorized when the file of the password or
  // token cannot be read, Error kTooLarge when the answer has more than most_bytes, kOutOfSpace,
  // and kCancelled when `stop` is requested.
  PeerAnswerHead send(const PeerRequest& request, const std::stop_token& stop) const;

 private:
  const orders::PacsSettings settings_;
};

}  // namespace isomesh::dicomweb
