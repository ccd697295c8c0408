#include "tests/support/s3_peer.h"

#include <sstream>
#include <stdexcept>

#include <httplib.h>

namespace isomesh::test {
namespace {

// Debian's Python, which has Debian's packages.
constexpr const char* kPython = "/usr/bin/python3";

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> all;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) all.push_back(line);
  return all;
}

}  // namespace

std::string S3Peer::missing() {
  static const std::string reason = [] {
    const bool is_there = run({kPython, "-c", "import botocore.auth"}).status == 0;
    return is_there ? "" : "NOT TESTED: the package python3-botocore is missing";
  }();
  return reason;
}

S3Peer::S3Peer() : process_({kPython, "-B", ISOMESH_S3_PEER}), endpoint_(process_.first_line()) {
  if (!endpoint_.starts_with("http://")) throw std::runtime_error("no S3 peer: " + endpoint_);
}

std::string S3Peer::url(const std::string& prefix) const {
  return "s3://bucket" + (prefix.empty() ? "" : '/' + prefix) + "?endpoint=" + endpoint_ +
         "&region=eu-test-1";
}

std::string S3Peer::credentials(bool right) {
  return std::string("[default]\naws_access_key_id = isomesh-test\naws_secret_access_key = ") +
         (right ? "not/a+secret" : "another") + "\n";
}

void S3Peer::fail(const std::string& what, int count, const std::string& method,
                  const std::string& part) {
  std::string target = "/-/fail?what=" + what + "&method=" + method + "&part=" + part;
  if (count > 0) target += "&count=" + std::to_string(count);
  tell(target);
}

void S3Peer::put(const std::string& key, std::string_view bytes) {
  tell("/-/put?key=" + key, bytes);
}

void S3Peer::age(const std::string& key, std::chrono::seconds by) {
  tell("/-/age?key=" + key + "&seconds=" + std::to_string(by.count()));
}

void S3Peer::list_in_pages_of(int objects) { tell("/-/set?page=" + std::to_string(objects)); }

void S3Peer::forget_conditions() { tell("/-/set?conditions=no"); }

std::vector<std::string> S3Peer::keys() { return lines_of(tell("/-/keys")); }

int S3Peer::count(const std::string& method, const std::string& part) {
  return std::stoi(tell("/-/count?method=" + method + "&part=" + part));
}

int S3Peer::open_uploads() { return std::stoi(tell("/-/uploads")); }

std::string S3Peer::tell(const std::string& target, std::string_view body) {
  httplib::Client client(endpoint_);
  client.set_read_timeout(std::chrono::minutes(5));
  const auto answer = client.Post(target, body.data(), body.size(), "application/octet-stream");
  if (!answer || answer->status != 200) throw std::runtime_error("the S3 peer: " + target);
  return answer->body;
}

}  // namespace isomesh::test
