#include "proto/record_digest.h"

#include "base/error.h"
#include "base/sha256.h"

namespace isomesh {
namespace {

// A program that writes the object anew drops the blank. So an older version that changed the
// record leaves one without a digest, not one with a wrong digest.
constexpr std::string_view kBegin = R"(, "digest":")";
constexpr std::string_view kEnd = R"("})";
constexpr std::size_t kDigits = 32;  // of the 64 of SHA-256
constexpr std::size_t kBytes = kBegin.size() + kDigits + kEnd.size();

std::string digest_of(std::string_view json) { return sha256_of(json).substr(0, kDigits); }

}  // namespace

std::string with_digest(std::string json) {
  const std::string digest = digest_of(json);
  json.pop_back();
  return json.append(kBegin).append(digest).append(kEnd);
}

std::string without_digest(std::string_view record) {
  if (record.size() < kBytes) return std::string(record);
  const std::string_view end = record.substr(record.size() - kBytes);
  if (!end.starts_with(kBegin)) return std::string(record);
  std::string json(record.substr(0, record.size() - kBytes));
  json += '}';
  if (!end.ends_with(kEnd) || end.substr(kBegin.size(), kDigits) != digest_of(json)) {
    throw Error(ErrorCode::kInternal, "has another digest");
  }
  return json;
}

}  // namespace isomesh
