#include "server/store/s3/link.h"

#include <array>
#include <cstring>
#include <ctime>

#include <openssl/evp.h>
#include <openssl/hmac.h>

#include "base/error.h"
#include "base/hex.h"
#include "base/sha256.h"

namespace isomesh::store {
namespace {

std::string mac_of(std::string_view key, std::string_view text) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> mac = {};
  unsigned size = 0;
  if (HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()),
           reinterpret_cast<const unsigned char*>(text.data()), text.size(), mac.data(),
           &size) == nullptr) {
    throw Error(ErrorCode::kInternal, "HMAC failed");
  }
  return {reinterpret_cast<const char*>(mac.data()), size};
}

// For example 20130524T000000Z.
std::string compact_time(std::chrono::system_clock::time_point time) {
  const std::time_t seconds = std::chrono::system_clock::to_time_t(time);
  std::tm utc = {};
  ::gmtime_r(&seconds, &utc);
  std::array<char, 32> text = {};
  std::strftime(text.data(), text.size(), "%Y%m%dT%H%M%SZ", &utc);
  return text.data();
}

}  // namespace

std::string uri_escaped(std::string_view text) {
  constexpr std::string_view kBare =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~";
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string escaped;
  for (const char c : text) {
    if (kBare.find(c) != kBare.npos) {
      escaped += c;
    } else {
      const auto byte = static_cast<unsigned char>(c);
      escaped.append({'%', kDigits[byte >> 4], kDigits[byte & 15]});
    }
  }
  return escaped;
}

std::string presigned_url(const S3Address& address, const S3Credentials& credentials,
                          const std::string& key, const LinkedAs& as,
                          std::chrono::system_clock::time_point from) {
  const std::string time = compact_time(from);
  const std::string day = time.substr(0, 8);
  const std::string scope = day + '/' + address.region + "/s3/aws4_request";
  const std::string disposition = "attachment; filename=\"" + as.name + '"';
  // Sorted by name, as the signature requires.
  std::string query = "X-Amz-Algorithm=AWS4-HMAC-SHA256&X-Amz-Credential=" +
                      uri_escaped(credentials.access_key + '/' + scope) + "&X-Amz-Date=" + time +
                      "&X-Amz-Expires=" + std::to_string(as.lasts.count());
  if (!credentials.session_token.empty()) {
    query += "&X-Amz-Security-Token=" + uri_escaped(credentials.session_token);
  }
  query += "&X-Amz-SignedHeaders=host&response-content-disposition=" + uri_escaped(disposition) +
           "&response-content-type=" + uri_escaped(as.media_type);
  const std::string path = address.path + '/' + key;
  const std::string host = address.endpoint.substr(address.endpoint.find("://") + 3);
  const std::string request =
      "GET\n" + path + '\n' + query + "\nhost:" + host + "\n\nhost\nUNSIGNED-PAYLOAD";
  const std::string text = "AWS4-HMAC-SHA256\n" + time + '\n' + scope + '\n' + sha256_of(request);
  std::string signer = mac_of("AWS4" + credentials.secret_key, day);
  for (const std::string& part : {address.region, std::string("s3"), std::string("aws4_request")}) {
    signer = mac_of(signer, part);
  }
  return address.endpoint + path + '?' + query +
         "&X-Amz-Signature=" + to_hex(std::string_view(mac_of(signer, text)));
}

}  // namespace isomesh::store
