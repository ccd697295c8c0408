#include "server/callbacks/signature.h"

#include <optional>
#include <sstream>

#include "base/base64.h"
#include "base/clock.h"
#include "base/files.h"
#include "base/sha256.h"

namespace isomesh::callbacks {
namespace {

constexpr std::size_t kShortestKey = 24;

Error at_fault(const std::string& what) { return invalid_parameter("callback-secret-file", what); }

}  // namespace

std::vector<std::string> read_callback_secrets(const std::filesystem::path& file) {
  constexpr std::string_view kPrefix = "whsec_";
  std::vector<std::string> secrets;
  std::string text;
  try {
    text = read_whole(file);
  } catch (const Error&) {
    throw at_fault("the file cannot be read");
  }
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.ends_with('\r')) line.pop_back();
    if (line.empty()) continue;
    const auto key =
        line.starts_with(kPrefix) ? from_base64(line.substr(kPrefix.size())) : std::optional(line);
    if (!key) throw at_fault("whsec_ must be followed by base64");
    if (key->size() < kShortestKey) throw at_fault("a key must have at least 24 bytes");
    secrets.push_back(*key);
  }
  if (secrets.empty()) throw at_fault("the file contains no key");
  return secrets;
}

std::string callback_signature(const std::vector<std::string>& secrets, std::string_view id,
                               std::int64_t timestamp, std::string_view body) {
  std::string content(id);
  content.append(".").append(std::to_string(timestamp)).append(".").append(body);
  std::string signatures;
  for (const std::string& secret : secrets) {
    if (!signatures.empty()) signatures += ' ';
    signatures += "v1," + to_base64(hmac_sha256(secret, content));
  }
  return signatures;
}

}  // namespace isomesh::callbacks
