#include "server/store/s3/address.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "base/clock.h"
#include "base/error.h"
#include "base/files.h"
#include "base/hex.h"
#include "base/sha256.h"
#include "base/text.h"

namespace isomesh::store {
namespace {

constexpr std::string_view kS3Scheme = "s3://";

Error wrong_place(const std::string& what) { return invalid_parameter("blobs", what); }

bool consists_of(std::string_view text, std::string_view others) {
  return std::ranges::all_of(text, [&](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || others.find(c) != others.npos;
  });
}

// A bucket's name may be part of a host name, and never needs escaping.
std::string checked_bucket(std::string_view text) {
  constexpr std::size_t kShortest = 3;
  constexpr std::size_t kLongest = 63;
  if (text.size() < kShortest || text.size() > kLongest || !consists_of(text, ".-")) {
    throw wrong_place("must name a bucket: 3 to 63 lower-case letters, digits, dots and hyphens");
  }
  return std::string(text);
}

std::string checked_prefix(std::string_view text) {
  while (text.ends_with('/')) text.remove_suffix(1);
  if (text.empty()) return {};
  if (!consists_of(text, "ABCDEFGHIJKLMNOPQRSTUVWXYZ._-/") || text.find("//") != text.npos) {
    throw wrong_place(
        "the prefix may contain only letters, digits, dots, hyphens, underscores and slashes");
  }
  return std::string(text) + '/';
}

void check_endpoint(std::string_view endpoint) {
  std::string_view host = endpoint;
  if (endpoint.starts_with("http://")) host.remove_prefix(7);
  if (endpoint.starts_with("https://")) host.remove_prefix(8);
  if (host == endpoint || host.empty() || !consists_of(host, "ABCDEFGHIJKLMNOPQRSTUVWXYZ.-:[]")) {
    throw wrong_place("the endpoint must be http://HOST[:PORT] or https://HOST[:PORT]");
  }
}

// The endpoint with the bucket as a subdomain.
std::string with_bucket(const std::string& endpoint, const std::string& bucket) {
  const std::size_t host = endpoint.find("://") + 3;
  return endpoint.substr(0, host) + bucket + '.' + endpoint.substr(host);
}

std::string variable(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

void check_credentials(const S3Credentials& credentials, const std::string& where) {
  for (const std::string* part :
       {&credentials.access_key, &credentials.secret_key, &credentials.session_token}) {
    if (has_control_characters(*part)) {
      throw invalid_parameter("blob-credentials", where + " contains control characters");
    }
  }
  if (credentials.access_key.empty() || credentials.secret_key.empty()) {
    throw invalid_parameter("blob-credentials",
                            where + " must contain an access key and a secret key");
  }
}

}  // namespace

bool is_s3_url(std::string_view text) { return text.starts_with(kS3Scheme); }

S3Address parse_s3_url(std::string_view text) {
  text.remove_prefix(kS3Scheme.size());
  const std::size_t question = text.find('?');
  const std::string_view place = text.substr(0, question);
  const std::size_t slash = place.find('/');
  const std::string bucket = checked_bucket(place.substr(0, slash));
  S3Address address;
  if (slash != place.npos) address.prefix = checked_prefix(place.substr(slash + 1));
  std::string style;
  if (question != text.npos) {
    for (const std::string_view part : split(text.substr(question + 1), '&')) {
      const std::size_t equals = part.find('=');
      const std::string_view name = part.substr(0, equals);
      std::string* target = name == "endpoint" ? &address.endpoint
                            : name == "region" ? &address.region
                            : name == "style"  ? &style
                                               : nullptr;
      if (target == nullptr || equals == part.npos || !target->empty()) {
        throw wrong_place("only endpoint=, region= and style= may follow the ?, each once");
      }
      *target = part.substr(equals + 1);
    }
  }
  if (address.region.empty()) address.region = "us-east-1";
  if (!consists_of(address.region, "-_ABCDEFGHIJKLMNOPQRSTUVWXYZ")) {
    throw wrong_place("the region may contain only letters, digits, hyphens and underscores");
  }
  // Self-hosted services rarely have a host name for every bucket.
  if (style.empty()) style = address.endpoint.empty() ? "host" : "path";
  if (address.endpoint.empty())
    address.endpoint = "https://s3." + address.region + ".amazonaws.com";
  while (address.endpoint.ends_with('/')) address.endpoint.pop_back();
  check_endpoint(address.endpoint);
  if (style != "path" && style != "host") throw wrong_place("the style must be path or host");
  if (style == "path") {
    address.path = '/' + bucket;
  } else {
    address.endpoint = with_bucket(address.endpoint, bucket);
  }
  return address;
}

S3Credentials read_s3_credentials(const std::filesystem::path& file) {
  S3Credentials credentials;
  if (file.empty()) {
    credentials = {.access_key = variable("AWS_ACCESS_KEY_ID"),
                   .secret_key = variable("AWS_SECRET_ACCESS_KEY"),
                   .session_token = variable("AWS_SESSION_TOKEN")};
    check_credentials(credentials, "the environment (AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY)");
    return credentials;
  }
  std::string text;
  try {
    text = read_whole(file);
  } catch (const Error&) {
    throw invalid_parameter("blob-credentials", "the file cannot be read");
  }
  bool is_ours = true;
  for (const std::string_view line : lines(text)) {
    if (line.starts_with('[')) is_ours = line == "[default]";
    const std::size_t equals = line.find('=');
    if (!is_ours || line.starts_with('#') || equals == line.npos) continue;
    const std::string_view name = trimmed(line.substr(0, equals));
    const std::string value(trimmed(line.substr(equals + 1)));
    if (name == "aws_access_key_id") credentials.access_key = value;
    if (name == "aws_secret_access_key") credentials.secret_key = value;
    if (name == "aws_session_token") credentials.session_token = value;
  }
  check_credentials(credentials, "the file");
  return credentials;
}

std::string presigned_url(const S3Address& address, const S3Credentials& credentials,
                          const std::string& key, const LinkedAs& as,
                          std::chrono::system_clock::time_point from) {
  const std::string time = utc_text(from, "%Y%m%dT%H%M%SZ");
  const std::string day = time.substr(0, 8);
  const std::string scope = day + '/' + address.region + "/s3/aws4_request";
  const std::string disposition = "attachment; filename=\"" + as.name + '"';
  // Sorted by name, as the signature requires.
  std::string query = "X-Amz-Algorithm=AWS4-HMAC-SHA256&X-Amz-Credential=" +
                      percent_encode(credentials.access_key + '/' + scope) + "&X-Amz-Date=" + time +
                      "&X-Amz-Expires=" + std::to_string(as.lasts.count());
  if (!credentials.session_token.empty()) {
    query += "&X-Amz-Security-Token=" + percent_encode(credentials.session_token);
  }
  query += "&X-Amz-SignedHeaders=host&response-content-disposition=" + percent_encode(disposition) +
           "&response-content-type=" + percent_encode(as.media_type);
  const std::string path = address.path + '/' + key;
  const std::string host = address.endpoint.substr(address.endpoint.find("://") + 3);
  const std::string request =
      "GET\n" + path + '\n' + query + "\nhost:" + host + "\n\nhost\nUNSIGNED-PAYLOAD";
  const std::string text = "AWS4-HMAC-SHA256\n" + time + '\n' + scope + '\n' + sha256_of(request);
  std::string signer = hmac_sha256("AWS4" + credentials.secret_key, day);
  for (const std::string& part : {address.region, std::string("s3"), std::string("aws4_request")}) {
    signer = hmac_sha256(signer, part);
  }
  return address.endpoint + path + '?' + query +
         "&X-Amz-Signature=" + to_hex(std::string_view(hmac_sha256(signer, text)));
}

}  // namespace isomesh::store
