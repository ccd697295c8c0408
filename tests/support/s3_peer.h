// A small S3 service on loopback that fails as it is told to, and that checks every signature and
// every digest by an implementation that is not ours (s3_peer.py).
#pragma once

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/process.h"

namespace isomesh::test {

// With one bucket that is empty. Thread safe. Needs python3-botocore.
class S3Peer {
 public:
  // Why there can be none on this machine; empty when there can.
  static std::string missing();

  S3Peer();

  // For --blobs; the prefix may be empty.
  std::string url(const std::string& prefix = "") const;
  const std::string& endpoint() const { return endpoint_; }

  // A file for --blob-credentials; with a wrong key it is refused.
  static std::string credentials(bool right = true);

  // See s3_peer.py for the kinds. Of requests of the method whose target holds the part, the next
  // `count`, or all from now on when it is 0.
  void fail(const std::string& what, int count = 0, const std::string& method = "",
            const std::string& part = "");
  void recover() { fail("nothing"); }
  // As it was at the beginning.
  void reset() { tell("/-/reset"); }

  // Puts an object there as if somebody else had.
  void put(const std::string& key, std::string_view bytes);
  // As if it had been written so long before.
  void age(const std::string& key, std::chrono::seconds by);
  void list_in_pages_of(int objects);
  void forget_conditions();

  std::vector<std::string> keys();
  // How many such requests have come so far.
  int count(const std::string& method, const std::string& part = "");
  // Uploads in parts that were begun and neither completed nor given up.
  int open_uploads();

 private:
  std::string tell(const std::string& target, std::string_view body = {});

  Process process_;
  std::string endpoint_;
};

}  // namespace isomesh::test
