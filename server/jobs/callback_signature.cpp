#include "server/jobs/callback_signature.h"

#include <array>
#include <optional>
#include <sstream>

#include <openssl/evp.h>
#include <openssl/hmac.h>

#include "server/store/files.h"

namespace isomesh::jobs {
namespace {

constexpr std::size_t kShortestKey = 24;

Error at_fault(const std::string& what) { return invalid_parameter("callback-secret-file", what); }

std::string to_base64(const unsigned char* bytes, std::size_t size) {
  std::string text((size + 2) / 3 * 4 + 1, '\0');
  const int length =
      EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()), bytes, static_cast<int>(size));
  text.resize(static_cast<std::size_t>(length));
  return text;
}

std::optional<std::string> from_base64(const std::string& text) {
  constexpr std::size_t kGroup = 4;
  if (text.empty() || text.size() % kGroup != 0) return std::nullopt;
  std::string bytes(text.size() / kGroup * 3, '\0');
  const int length = EVP_DecodeBlock(reinterpret_cast<unsigned char*>(bytes.data()),
                                     reinterpret_cast<const unsigned char*>(text.data()),
                                     static_cast<int>(text.size()));
  if (length < 0) return std::nullopt;
  // The decoder counts the padding as zeros.
  const std::size_t padding = text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0;
  bytes.resize(static_cast<std::size_t>(length) - padding);
  return bytes;
}

}  // namespace

std::vector<std::string> read_callback_secrets(const std::filesystem::path& file) {
  constexpr std::string_view kPrefix = "whsec_";
  std::vector<std::string> secrets;
  std::string text;
  try {
    text = store::read_whole(file);
  } catch (const Error&) {
    throw at_fault("the file cannot be read");
  }
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line.ends_with('\r')) line.pop_back();
    if (line.empty()) continue;
    const auto key =
        line.starts_with(kPrefix) ? from_base64(line.substr(kPrefix.size())) : std::optional(line);
    if (!key) throw at_fault("behind whsec_ there must be base64");
    if (key->size() < kShortestKey) throw at_fault("a key must have 24 bytes at least");
    secrets.push_back(*key);
  }
  if (secrets.empty()) throw at_fault("the file holds no key");
  return secrets;
}

std::string callback_signature(const std::vector<std::string>& secrets, std::string_view id,
                               std::int64_t timestamp, std::string_view body) {
  std::string content(id);
  content.append(".").append(std::to_string(timestamp)).append(".").append(body);
  std::string signatures;
  for (const std::string& secret : secrets) {
    std::array<unsigned char, EVP_MAX_MD_SIZE> mac = {};
    unsigned size = 0;
    if (HMAC(EVP_sha256(), secret.data(), static_cast<int>(secret.size()),
             reinterpret_cast<const unsigned char*>(content.data()), content.size(), mac.data(),
             &size) == nullptr) {
      throw Error(ErrorCode::kInternal, "HMAC failed");
    }
    if (!signatures.empty()) signatures += ' ';
    signatures += "v1," + to_base64(mac.data(), size);
  }
  return signatures;
}

}  // namespace isomesh::jobs
