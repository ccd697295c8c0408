// A small S3 service on loopback with configurable failures. It checks every signature and digest
// with an independent implementation (s3_peer.py).
#pragma once

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/process.h"

namespace isomesh::test {

// Has one empty bucket. Thread safe. Needs python3-botocore.
class S3Peer {
 public:
  // The reason why it cannot run on this machine; empty if it can.
  static std::string missing();

  S3Peer();

  // For --blobs; the prefix may be empty.
  std::string url(const std::string& prefix = "") const;
  const std::string& endpoint() const { return endpoint_; }

  // A file for --blob-credentials; a wrong key is rejected.
  static std::string credentials(bool right = true);

  // Injects a failure; s3_peer.py lists the kinds. Applies to the next `count` requests, or to all
  // if it is 0, with that method and with `part` in their target.
  void fail(const std::string& what, int count = 0, const std::string& method = "",
            const std::string& part = "");
  void recover() { fail("nothing"); }
  void reset() { tell("/-/reset"); }

  // Stores an object as if another client had.
  void put(const std::string& key, std::string_view bytes);
  void age(const std::string& key, std::chrono::seconds by);
  void list_in_pages_of(int objects);
  void forget_conditions();

  std::vector<std::string> keys();
  int count(const std::string& method, const std::string& part = "");
  // Multipart uploads that are neither completed nor aborted.
  int open_uploads();

 private:
  std::string tell(const std::string& target, std::string_view body = {});

  Process process_;
  std::string endpoint_;
};

}  // namespace isomesh::test
